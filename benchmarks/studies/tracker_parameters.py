"""The thesis' studies of its baselines: the gate of 3D-KF and the iterations of 3D-MS (App. A.1)."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from benchmarks.studies.report import RESULTS, publish
from benchmarks.studies.single_object import target_of
from perception.cli.flags import DriveFlags
from perception.cli.parser import FlagGroup
from perception.cli.progress import progress_bar
from perception.errors import UsageError
from perception.evaluation.report import Column, Table
from perception.render.curve_plots import Curve, CurvePanel, plot_curves
from perception.sensor import LidarModel, load_sensor
from perception.tracking.single_object.config import SingleObjectTrackerConfig
from perception.types import Drive

if TYPE_CHECKING:
    from perception.evaluation.single_object.metrics import SingleObjectMetrics
    from perception.evaluation.single_object.track import TargetObject
    from perception.evaluation.single_object.tracker_runs import TrackerMakers

ObjectClass = Literal["Car", "Cyclist", "Pedestrian"]
Metrics = Mapping[float, "SingleObjectMetrics"]
_NOTES = (
    "gate: length and width in those of the box. App. A.1 compares 1, 1.5 and 2 and finds 1 best; the author's code",
    "doubles them, so that these are 2, 3 and 4 here. Of 3, 5 and 10 iterations it finds 3 best.",
)


@dataclass(frozen=True)
class TrackerParametersConfig(FlagGroup):
    """Parameters and scenes.

    Attributes:
        gates: Lengths and widths of the gate of 3D-KF, in those of the box.
        iterations: Maximum numbers of mean shifts of 3D-MS.
        object_class: Class of the object in synthetic scenes.
        duration_s: Duration of each synthetic scene in seconds.
        seed: Seed of the synthetic scenes.
    """

    gates: tuple[float, ...] = (1.0, 1.5, 2.0, 3.0, 4.0)
    iterations: tuple[int, ...] = (3, 5, 10)
    object_class: ObjectClass = "Car"
    duration_s: float = 6.0
    seed: int = 0

    def __post_init__(self) -> None:
        """Validate the values of both parameters."""
        for flag, values in (("--gates", self.gates), ("--iterations", self.iterations)):
            if not values or not all(0 < value < np.inf for value in values):
                found = ",".join(map(str, values)) or "none"
                raise UsageError(flag, expected="values above 0", found=found)


def tracker_parameters(
    drive: str,
    *,
    source: DriveFlags,
    config: TrackerParametersConfig,
    out: Path = RESULTS / "tracker-parameters.png",
) -> None:
    """Measure 3D-KF by the size of its gate, and 3D-MS by the number of its iterations (App. A.1).

    Example: trifuse study tracker-parameters kitti/tracking --sequence 0000

    Args:
        drive: Folder whose labelled tracks are tracked, or the word synthetic for scenes with exact truth.
        out: Figure; a JSON file with the numbers is written beside it.
    """
    from data.derived.otd_objects import run_trackers
    from perception.evaluation.single_object.measure import SingleObjectMeasure

    names = [*map(_gate_name, config.gates), *map(_shift_name, config.iterations)]
    measure, frames = SingleObjectMeasure(tuple(dict.fromkeys(names))), 0
    for one, targets in _drives(drive, source, config):
        frames += sum(len(target.truth) for target in targets)
        makers = _makers(one.sensor, config)
        for target, runs in zip(
            targets, run_trackers(one, targets, makers, progress=progress_bar), strict=True
        ):
            measure.update(target, runs, one.calibration)
    report = measure.compute()
    metrics = {n: m for n, m in report.metrics_of().items() if m is not None}
    gates = {gate: metrics[_gate_name(gate)] for gate in config.gates}
    iterations = {float(count): metrics[_shift_name(count)] for count in config.iterations}
    title = f"Baselines on {drive}; objects: {len(report.objects)}, labelled frames: {frames}"
    panels = [
        *_panels("3D-KF", "gate [boxes]", gates),
        *_panels("3D-MS", "iterations, at most", iterations),
    ]
    plot_curves(out, title, panels, columns=3)
    table = Table(title, _COLUMNS, metrics, "tracker", _NOTES)
    conditions = {"drive": drive, "source": source, "config": config}
    publish(out, "gates and iterations of App. A.1", {"trackers": table}, conditions)


def _drives(
    drive: str, source: DriveFlags, config: TrackerParametersConfig
) -> "Iterator[tuple[Drive, Sequence[TargetObject]]]":
    """Yield the scenes, or the drives of a folder, with their objects."""
    if drive == "synthetic":
        from data.synthetic.scenarios import ScenarioDrive, all_scenarios

        sensor = load_sensor(source.sensor or "HDL-64E")
        for scenario in all_scenarios(config.object_class, config.duration_s):
            scene = ScenarioDrive(scenario, seed=config.seed, sensor=sensor, images=False)
            yield scene, [target_of(scene)]
        return
    from data.derived.otd_objects import ObjectSetConfig, find_objects

    objects = ObjectSetConfig(
        Path(drive), "present", source.sequence, frames=source.frames, reading=source.reading
    )
    for found in find_objects(objects).drives:
        yield found.drive, found.objects


def _makers(sensor: LidarModel, config: TrackerParametersConfig) -> "TrackerMakers":
    """Return a tracker for each value of each parameter."""
    from perception.tracking.single_object.trackers import single_object_tracker

    default = SingleObjectTrackerConfig()
    makers = {}
    for gate in config.gates:
        changed = replace(default, point=replace(default.point, gate=gate))
        makers[_gate_name(gate)] = partial(single_object_tracker, "3d-kf", sensor, changed)
    for count in config.iterations:
        shift = replace(default.baselines.mean_shift, max_iterations=count)
        changed = replace(default, baselines=replace(default.baselines, mean_shift=shift))
        makers[_shift_name(count)] = partial(single_object_tracker, "3d-ms", sensor, changed)
    return makers


def _gate_name(gate: float) -> str:
    return f"3d-kf, gate {gate:g}"


def _shift_name(count: int) -> str:
    return f"3d-ms, {count} iterations"


def _panels(tracker: str, label: str, metrics: Metrics) -> list[CurvePanel]:
    """Return success of overlap, success of heading, and centre error over a parameter."""
    values = sorted(metrics)

    def panel(title: str, unit: str, y: list[float], top: float) -> CurvePanel:
        curves = [Curve(tracker, values, y)]
        title = f"{tracker}: {title}"
        return CurvePanel(title, label, unit, curves, y_limits=(0, top), x_ticks=values)

    center_m = [metrics[value].center_m for value in values]
    overlap = [100 * metrics[value].overlap_success for value in values]
    heading = [100 * metrics[value].heading_success for value in values]
    return [
        panel("overlap success (A.1)", "[%]", overlap, 105),
        panel("heading success (A.2)", "[%]", heading, 105),
        panel("E3D", "[m]", center_m, 1.1 * max(center_m)),
    ]


_COLUMNS: list[Column["SingleObjectMetrics"]] = [
    Column("overlap success [%]", lambda m: m.overlap_success, ".1%", "overlap_success"),
    Column("heading success [%]", lambda m: m.heading_success, ".1%", "heading_success"),
    Column("E3D [m]", lambda m: m.center_m, ".2f", "center_m"),
    Column("E_phi [rad]", lambda m: m.folded_heading_rad, ".3f", "folded_heading_rad"),
    Column("lost [%]", lambda m: m.lost, ".1%", "lost"),
    Column("drifted [%]", lambda m: m.drifted, ".1%", "drifted"),
    Column("time [ms/frame]", lambda m: m.ms_per_frame, ".1f", "ms_per_frame"),
]
