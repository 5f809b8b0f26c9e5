"""Each stage beside its reference implementation, the thesis' method, and the best library."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.ground_peers import PatchworkGround, RansacPlane
from benchmarks.measure import Cell, Contender, Timing, time_interleaved, timing_table
from benchmarks.reference.voxels import count_voxels_by_unique_rows
from benchmarks.registration_peers import one_call_small_gicp, open3d_point_to_plane
from perception.errors import DriveError, MissingDependencyError, ModelError
from perception.evaluation.ground import GroundErrors, ground_errors, mean_displacement_error
from perception.geometry.se3 import inverse
from perception.localization.odometry import LidarOdometry
from perception.localization.registration import register_window
from perception.localization.scan_window import PosedScan, ScanWindow
from perception.obstacles.ground import ground_estimator
from perception.obstacles.motion_segmentation import motion_segmenter
from perception.obstacles.voxels import count_voxels
from perception.pipeline import PipelineConfig
from perception.types import Drive, Frame, GroundModel

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Comparison:
    """The timings of one stage, and the metrics of its contenders.

    Attributes:
        stage: Name of the stage.
        timings: Timings, that of Trifuse first.
        metrics: Values of each contender, by metric with unit.
    """

    stage: str
    timings: list[Timing]
    metrics: dict[str, dict[str, Cell]]

    def table(self) -> str:
        """Return it as text."""
        return timing_table(self.stage, self.timings, **self.metrics)


@dataclass(frozen=True)
class PreparedDrive:
    """A stretch of a drive in memory, registered once, for all stages alike.

    Attributes:
        drive: Drive that was read.
        frames: Frames in order.
        windows: Window of scans of each frame, with registered poses.
        config: Pipeline configuration.
    """

    drive: Drive
    frames: list[Frame]
    windows: list[ScanWindow]
    config: PipelineConfig


def prepare(drive: Drive, frames: int, config: PipelineConfig) -> PreparedDrive:
    """Read and register a number of frames from the start of a drive."""
    odometry, scans, read = LidarOdometry(config.registration), [], []
    for index in range(min(frames, len(drive))):
        frame = drive[index]
        pose = odometry.update(
            frame.points_velo, frame.stamp_s, frame.world_SE3_velo, frame.source
        ).world_SE3_velo
        read.append(frame)
        scans.append(PosedScan(frame.points_velo, pose))
    if len(scans) < 2:
        raise DriveError(drive.root, expected="at least two frames", found=str(len(scans)))
    windows = []
    for newest in range(len(scans)):
        window = ScanWindow(config.motion.previous_scans)
        for scan in scans[max(0, newest - config.motion.previous_scans) : newest + 1]:
            window.push(scan)
        windows.append(window)
    return PreparedDrive(drive, read, windows, config)


def compare_registration(prepared: PreparedDrive) -> Comparison:
    """Register scan by scan, beside library calls from scan to scan and the thesis' whole window."""
    frames, odometry = prepared.frames, LidarOdometry(prepared.config.registration)

    def ours(i: int) -> object:
        frame = frames[i]
        return odometry.update(frame.points_velo, frame.stamp_s, frame.world_SE3_velo)

    def scan_to_scan(register: Callable[..., object]) -> Callable[[int], object]:
        def run(i: int) -> object:
            before, now = frames[max(i - 1, 0)], frames[i]
            guess = np.eye(4)
            if before.world_SE3_velo is not None and now.world_SE3_velo is not None:
                guess = inverse(before.world_SE3_velo) @ now.world_SE3_velo
            return register(before.points_velo, now.points_velo, guess)

        return run

    contenders = [
        Contender("Trifuse", ours),
        Contender("small_gicp, one call", scan_to_scan(one_call_small_gicp)),
        Contender(
            "thesis: whole window (Algorithm 2)",
            lambda i: register_window(prepared.windows[i]),
        ),
    ]
    add_peer(
        contenders,
        lambda: Contender("Open3D, point to plane", scan_to_scan(open3d_point_to_plane())),
    )
    return Comparison("registration", time_interleaved(contenders, len(frames)), {})


def compare_ground(prepared: PreparedDrive) -> Comparison:
    """Estimate the ground by both methods on merged scans; by one plane and Patchwork++ on the newest scan."""
    sensor, config = prepared.drive.sensor, prepared.config
    default = ground_estimator(config.ground, "default", sensor, config.area)
    thesis = ground_estimator(config.ground, "thesis", sensor, config.area)

    def newest(i: int) -> Any:  # noqa: ANN401 - a float32 array
        return prepared.frames[i].points_velo

    contenders = [
        Contender("Trifuse", lambda i: default.update(prepared.windows[i])),
        Contender("thesis: piecewise planes", lambda i: thesis.update(prepared.windows[i])),
    ]

    def plane() -> Contender:
        peer = RansacPlane()
        return Contender(
            "one RANSAC plane (Open3D)",
            lambda i: peer.estimate(newest(i)[config.area.contains_xy(newest(i))]),
        )

    def patchwork() -> Contender:
        peer = PatchworkGround(sensor)
        return Contender("Patchwork++", lambda i: peer.estimate(newest(i)))

    add_peer(contenders, plane)
    add_peer(contenders, patchwork)
    feet: dict[str, list[GroundErrors]] = {contender.name: [] for contender in contenders}

    def evaluate(name: str, i: int, ground: GroundModel) -> None:
        if prepared.drive.has_labels:
            bottoms = prepared.drive.labels(i).boxes_velo.bottom_m
            feet[name].append(ground_errors(i, ground, bottoms, config.area))

    timings = time_interleaved(contenders, len(prepared.frames), evaluate)
    errors: dict[str, Cell] = {
        name: f"{1e3 * mean_displacement_error(GroundErrors.concatenate(rows)).mde_m:.1f}"
        for name, rows in feet.items()
        if rows
    }
    return Comparison("ground", timings, {"mDE [mm]": errors} if errors else {})


def compare_voxels(prepared: PreparedDrive) -> Comparison:
    """Count the voxels of whole scans, beside numpy's unique rows."""
    size_m = 0.1
    contenders = [
        Contender("Trifuse", lambda i: count_voxels(prepared.frames[i].points_velo, size_m)),
        Contender(
            "reference: np.unique over rows",
            lambda i: count_voxels_by_unique_rows(prepared.frames[i].points_velo, size_m),
        ),
    ]
    return Comparison("voxel counting", time_interleaved(contenders, len(prepared.frames)), {})


def compare_motion(prepared: PreparedDrive) -> Comparison:
    """Segment motion by free space and by the thesis' counters, on the same ground."""
    sensor, config = prepared.drive.sensor, prepared.config
    estimator = ground_estimator(config.ground, "default", sensor, config.area)
    grounds = [estimator.update(window) for window in prepared.windows]
    free_space = motion_segmenter(config.motion, "default", sensor, config.area)
    counters = motion_segmenter(config.motion, "thesis", sensor, config.area)
    contenders = [
        Contender("Trifuse", lambda i: free_space.update(prepared.windows[i], grounds[i])),
        Contender(
            "thesis: counters (Fig. 5.6)",
            lambda i: counters.update(prepared.windows[i], grounds[i]),
        ),
    ]
    return Comparison("static and moving", time_interleaved(contenders, len(prepared.frames)), {})


def add_peer(contenders: list[Contender], make: Callable[[], Contender]) -> None:
    """Add a peer, or log why it is not measured."""
    try:
        contenders.append(make())
    except (MissingDependencyError, ModelError) as error:
        log.warning("not measured: %s", error)
