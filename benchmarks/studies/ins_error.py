"""Effect of INS errors on the tracks of moving objects (7.1.1: up to 1 m is claimed harmless)."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.studies.report import RESULTS, StreetFlags, publish
from benchmarks.studies.tracking_metrics import (
    PROTOCOL,
    by_metric,
    measure_methods,
    total,
    tracking_table,
)
from perception.cli.parser import FlagGroup
from perception.render.curve_plots import metric_panels, plot_curves
from perception.sensor import load_sensor

if TYPE_CHECKING:
    from data.synthetic.ins import InsNoise


@dataclass(frozen=True)
class InsErrorConfig(FlagGroup):
    """Errors of the INS.

    Attributes:
        positions_m: Standard deviations of the position along each axis in metres, angles exact.
        angles_deg: Standard deviations of the angle about each axis in degrees, position exact.
    """

    positions_m: tuple[float, ...] = (0.0, 0.1, 0.25, 0.5, 1.0)
    angles_deg: tuple[float, ...] = (0.0, 0.5, 1.0, 2.0)

    def cases(self) -> list["InsNoise"]:
        """Return every INS, each once."""
        from data.synthetic.ins import InsNoise

        by_position = [InsNoise(position_m, 0.0) for position_m in self.positions_m]
        by_angle = [InsNoise(0.0, angle_deg) for angle_deg in self.angles_deg]
        return list(dict.fromkeys([*by_position, *by_angle]))


def ins_error(
    *,
    streets: StreetFlags,
    config: InsErrorConfig,
    sensor: str = "HDL-64E",
    out: Path = RESULTS / "ins-error.png",
) -> None:
    """Measure the tracks of moving objects over the error of the INS, 0 to 1 m and 0 to 2° (7.1.1).

    Example: trifuse study ins-error --frames 20

    Args:
        sensor: LiDAR model, such as HDL-64E, VLP-16 or OS1-64, or a .yaml or .json file that describes one.
        out: Figure; a JSON file with the numbers is written beside it.
    """
    from data.synthetic.drive import CachedDrive
    from data.synthetic.ins import InsNoise

    model = load_sensor(sensor)
    parts = []
    for seed in streets.seeds:
        drive = CachedDrive(streets.frames, seed=seed, sensor=model)
        parts.append({ins: measure_methods(drive.with_ins(ins)) for ins in config.cases()})
    metrics = {ins: total([part[ins] for part in parts]) for ins in config.cases()}
    title = f"Tracks of moving objects over the error of the INS, {model.name}, {streets.title}"
    positions = [metrics[InsNoise(position_m, 0.0)] for position_m in config.positions_m]
    angles = [metrics[InsNoise(0.0, angle_deg)] for angle_deg in config.angles_deg]
    by_position, by_angle = by_metric(positions), by_metric(angles)
    panels = [
        *metric_panels("position error of the INS, σ [m]", config.positions_m, by_position),
        *metric_panels("angle error of the INS, σ [°]", config.angles_deg, by_angle),
    ]
    plot_curves(out, title, panels, columns=len(by_position), share_y="col")
    cases = {f"{ins.position_m:g} m, {ins.angle_deg:g}°": one for ins, one in metrics.items()}
    publish(
        out,
        "7.1.1, tolerance to localization error",
        {"tracks": tracking_table(title, "INS error: method", cases)},
        {"drives": streets, "config": config, "sensor": model, "protocol": PROTOCOL},
    )
