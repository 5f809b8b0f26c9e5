"""Errors of poses over LiDAR, frame rate and prior, beside KISS-ICP and small_gicp on the same scans."""

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.studies.frame_rate import frame_step
from benchmarks.studies.report import RESULTS, StreetFlags, publish
from perception.cli.flags import SourceFlags
from perception.cli.parser import FlagGroup
from perception.cli.progress import progress_bar
from perception.errors import DriveError, MissingDependencyError
from perception.evaluation.report import Table
from perception.render.curve_plots import Curve, CurvePanel, plot_curves
from perception.sensor import LidarModel, load_sensor
from perception.types import Drive, Float32, Float64, Frame

if TYPE_CHECKING:
    from benchmarks.registration import Register
    from data.synthetic.drive import SyntheticDrive
    from perception.evaluation.pose_errors import PoseAccuracy, PoseMeasure

log = logging.getLogger(__name__)
_RATES_HZ = (2.0, 5.0, 10.0, 20.0)
# Locates a frame, the next of a drive, and adds its pose to the measure.
Method = Callable[[Frame, "PoseMeasure"], None]
# Errors that the figure shows, and their names there.
_DRAWN = {
    "step_p90_cm": "step p90 [cm]",
    "step_p90_deg": "step p90 [°]",
    "drift_percent": "drift [%]",
}


@dataclass(frozen=True)
class PosesConfig(FlagGroup):
    """What is measured.

    Attributes:
        rates: Frame rates in Hz; none for 2, 5, 10 and 20 in synthetic drives, and for that of a recorded one.
        sensors: LiDAR models of the synthetic drives.
        curve_radius_m: Smallest radius of the curves of their streets; 0 for that of the drawn street.
    """

    rates: tuple[float, ...] = ()
    sensors: tuple[str, ...] = ("VLP-16", "HDL-32E", "HDL-64E", "VLS-128")
    curve_radius_m: float = 45.0


def poses(
    drive: str = "synthetic",
    *,
    source: SourceFlags,
    streets: StreetFlags,
    config: PosesConfig,
    out: Path = RESULTS / "poses.png",
) -> None:
    """Measure poses over LiDAR, frame rate and prior, beside KISS-ICP and small_gicp on the same scans.

    A synthetic drive has exact poses, and --frames at the highest rate; lower rates leave frames out. The reference of a
    recorded drive is its INS. The planar INS states no height: the vehicle's is 0, roll and pitch are kept.

    Example: trifuse study poses --frames 240 --drives 2 --sensors VLP-16,HDL-64E

    Args:
        drive: Drive of any layout with poses, or the word synthetic.
        out: Figure; a JSON file with the numbers is written beside it.

    Raises:
        DriveError: The drive has no poses, or a frame has none.
    """
    measured: dict[str, dict[float, dict[str, list[PoseMeasure]]]] = {}
    if drive == "synthetic":
        rates = config.rates or _RATES_HZ
        for name in config.sensors:
            sensor = replace(load_sensor(name), rate_hz=max(rates))
            for seed in streets.seeds:
                street = _street(sensor, seed, streets.frames, config.curve_radius_m)
                exact = [street.true_world_SE3_velo(index) for index in range(len(street))]
                _measure(street, exact, rates, measured.setdefault(name, {}))
        title = f"Poses, {streets.title}, curves from {config.curve_radius_m:g} m"
    else:
        from data.frames import frame_period_s
        from data.measured_poses import reference_poses
        from data.open_drive import open_drive

        opened = open_drive(
            Path(drive), sequence=source.sequence, config=source.reading, images=False
        )
        reference, is_exact = reference_poses(opened, len(opened))
        rates = config.rates or (1 / frame_period_s(opened),)
        _measure(opened, reference, rates, measured.setdefault(opened.sensor.name, {}))
        title = f"Poses of {opened.name}, beside {'exact ones' if is_exact else 'its INS'}"
    from perception.evaluation.pose_errors import PROTOCOL, PoseAccuracy, pooled

    accuracies = {
        sensor: {
            rate: {method: pooled(one) for method, one in methods.items()}
            for rate, methods in by_rate.items()
        }
        for sensor, by_rate in measured.items()
    }
    rows = {
        f"{sensor}, {rate:g} Hz: {method}": one
        for sensor, by_rate in accuracies.items()
        for rate, methods in by_rate.items()
        for method, one in methods.items()
    }
    panels = [
        _panel(sensor, by_rate, key) for sensor, by_rate in accuracies.items() for key in _DRAWN
    ]
    plot_curves(out, title, panels, columns=len(_DRAWN))
    publish(
        out,
        "none: the thesis measures no poses",
        {"poses": Table(title, PoseAccuracy.columns(), rows, "LiDAR, frame rate: method")},
        {"drive": drive, "drives": streets, "config": config, "protocol": PROTOCOL},
    )


def _street(sensor: LidarModel, seed: int, frames: int, curve_radius_m: float) -> "SyntheticDrive":
    """Return a synthetic drive through a drawn street with curves."""
    from data.synthetic.drive import SyntheticDrive
    from data.synthetic.world_kinds import draw_config

    street = draw_config(np.random.default_rng(seed))
    if curve_radius_m > 0:
        street = replace(street, road=replace(street.road, curvature_1_m=1 / curve_radius_m))
    return SyntheticDrive(frames, seed=seed, sensor=sensor, config=street, images=False)


def _measure(
    drive: Drive,
    reference: Sequence[Float64],
    rates: Sequence[float],
    measured: "dict[float, dict[str, list[PoseMeasure]]]",
) -> None:
    """Locate the frames of a drive at each rate by each method, and add a measure of each."""
    from benchmarks.measure import processor_clock
    from perception.evaluation.pose_errors import PoseMeasure

    runs = list[tuple[int, Method, PoseMeasure]]()
    for rate_hz in rates:
        measures = measured.setdefault(round(rate_hz, 1), {})
        for name, locate in _methods(drive.sensor).items():
            measure = PoseMeasure(reference)
            measures.setdefault(name, []).append(measure)
            runs.append((frame_step(drive, rate_hz), locate, measure))
    with processor_clock():
        for frame in progress_bar(drive, f"{drive.sensor.name} {drive.name}", len(drive)):
            for step, locate, measure in runs:
                if frame.index % step == 0:
                    locate(frame, measure)


def _methods(sensor: LidarModel) -> Mapping[str, Method]:
    """Return Trifuse with each prior, and the peers that are installed."""
    from benchmarks.registration import kiss_icp_odometry, one_call_small_gicp

    def planar(frame: Frame) -> Frame:
        pose = planar_pose(_pose_of(frame), sensor.height_m)
        return replace(frame, world_SE3_velo=pose)

    methods = {
        "Trifuse, INS": _trifuse(sensor, lambda frame: frame),
        "Trifuse, planar INS": _trifuse(sensor, planar),
        "Trifuse, no INS": _trifuse(sensor, lambda frame: replace(frame, world_SE3_velo=None)),
    }
    peers: dict[str, Callable[[], Method]] = {
        "KISS-ICP": lambda: _odometry(kiss_icp_odometry()),
        "small_gicp, scan to scan, INS": lambda: _scan_to_scan(one_call_small_gicp()),
    }
    for name, make in peers.items():
        try:
            methods[name] = make()
        except MissingDependencyError as error:
            log.warning("not measured: %s", error)
    return methods


def _trifuse(sensor: LidarModel, prior: Callable[[Frame], Frame]) -> Method:
    """Return the stages of the LiDAR up to static and moving, on frames with another INS."""
    from perception.pipeline import PipelineConfig
    from perception.pipeline.lidar_stages import LidarStages

    stages = LidarStages(sensor, PipelineConfig.for_obstacles())
    return lambda frame, measure: measure.update(stages.segment(prior(frame))[0], None, None)


def _odometry(update: Callable[[Float32], Float64]) -> Method:
    """Return an odometry by scans alone."""

    def locate(frame: Frame, measure: "PoseMeasure") -> None:
        start_s = time.perf_counter()
        pose = update(frame.points_velo)
        measure.add(frame.index, pose, time.perf_counter() - start_s)

    return locate


def _scan_to_scan(register: "Register") -> Method:
    """Return a library's call on each scan and the one before, which starts at the step of the INS."""
    from perception.geometry.se3 import inverse

    last: Frame | None = None
    pose = np.eye(4)

    def locate(frame: Frame, measure: "PoseMeasure") -> None:
        nonlocal last, pose
        start_s = time.perf_counter()
        if last is not None:
            step = inverse(_pose_of(last)) @ _pose_of(frame)
            pose = pose @ register(last.points_velo, frame.points_velo, step)
        last = frame
        measure.add(frame.index, pose, time.perf_counter() - start_s)

    return locate


def planar_pose(world_SE3_velo: Float64, height_m: float) -> Float64:
    """Return a pose as of an INS without height: the place on the road below the LiDAR keeps height 0.

    Args:
        world_SE3_velo: (4, 4) pose of the LiDAR.
        height_m: Height of the LiDAR above the road.
    """
    pose = world_SE3_velo.copy()
    pose[2, 3] = height_m * pose[2, 2]
    return pose


def _pose_of(frame: Frame) -> Float64:
    if frame.world_SE3_velo is None:
        raise DriveError(frame.source, expected="a pose in every frame", found="none")
    return frame.world_SE3_velo


def _panel(
    sensor: str, by_rate: "Mapping[float, Mapping[str, PoseAccuracy]]", error: str
) -> CurvePanel:
    """Return the curves of one error over the frame rate, one for each method."""
    curves = [
        Curve(name, list(by_rate), [getattr(one[name], error) for one in by_rate.values()])
        for name in next(iter(by_rate.values()))
    ]
    return CurvePanel(sensor, "frame rate [Hz]", _DRAWN[error], curves, x_ticks=list(by_rate))
