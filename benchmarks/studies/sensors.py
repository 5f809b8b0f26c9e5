"""Effect of the LiDAR's number of beams on the tracks of moving objects."""

from collections.abc import Sequence
from pathlib import Path

from benchmarks.studies.report import RESULTS, StreetFlags, publish
from benchmarks.studies.tracking_metrics import (
    PROTOCOL,
    by_metric,
    measure_methods,
    total,
    tracking_table,
)
from perception.render.bar_plots import plot_groups
from perception.sensor import HDL_32E, HDL_64E, VLP_16, LidarModel

SENSORS: Sequence[LidarModel] = (HDL_64E, HDL_32E, VLP_16)


def sensors(*, streets: StreetFlags, out: Path = RESULTS / "sensors.png") -> None:
    """Measure the tracks of moving objects on the same streets by HDL-64E, HDL-32E and VLP-16.

    Example: trifuse study sensors --frames 20

    Args:
        out: Figure; a JSON file with the numbers is written beside it.
    """
    from data.synthetic.drive import SyntheticDrive

    metrics = {
        sensor.name: total(
            [
                measure_methods(
                    SyntheticDrive(streets.frames, seed=seed, sensor=sensor, images=False)
                )
                for seed in streets.seeds
            ]
        )
        for sensor in SENSORS
    }
    title = f"Tracks of moving objects by LiDAR, {streets.title}"
    plot_groups(out, title, list(metrics), by_metric(list(metrics.values())))
    publish(
        out,
        "none: the thesis has one sensor",
        {"tracks": tracking_table(title, "LiDAR: method", metrics)},
        {"drives": streets, "sensors": SENSORS, "protocol": PROTOCOL},
    )
