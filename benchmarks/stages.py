"""Each stage beside its reference implementation, the thesis' method, and the best library."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.ground_peers import PatchworkGround, RansacPlane
from benchmarks.measure import Comparison, Contender, add_peer, compare, metric
from benchmarks.reference.voxels import count_voxels_by_unique_rows
from benchmarks.registration_peers import one_call_small_gicp, open3d_point_to_plane
from perception.errors import DriveError
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
        Contender(
            "thesis: whole window (Algorithm 2)",
            lambda i: register_window(prepared.windows[i]),
        ),
    ]
    add_peer(
        contenders,
        lambda: Contender("small_gicp, one call", scan_to_scan(one_call_small_gicp())),
    )
    add_peer(
        contenders,
        lambda: Contender("Open3D, point to plane", scan_to_scan(open3d_point_to_plane())),
    )
    return compare("registration", contenders, len(frames))


def compare_ground(prepared: PreparedDrive) -> Comparison:
    """Estimate the ground by both methods on merged scans; by one plane and Patchwork++ on the newest scan."""
    sensor, config = prepared.drive.sensor, prepared.config
    default = ground_estimator(config.ground, "default", sensor, config.area)
    thesis = ground_estimator(config.ground, "thesis", sensor, config.area)

    def plane() -> Contender:
        peer = RansacPlane()

        def run(i: int) -> GroundModel:
            points_velo = prepared.frames[i].points_velo
            return peer.estimate(points_velo[config.area.contains_xy(points_velo)])

        return Contender("one RANSAC plane (Open3D)", run)

    def patchwork() -> Contender:
        peer = PatchworkGround(sensor)
        return Contender("Patchwork++", lambda i: peer.estimate(prepared.frames[i].points_velo))

    def mde_mm(grounds: list[GroundModel]) -> float:
        bottoms_m = [prepared.drive.labels(i).boxes_velo.bottom_m for i in range(len(grounds))]
        errors = [
            ground_errors(i, ground, bottoms_m[i], config.area) for i, ground in enumerate(grounds)
        ]
        return 1e3 * mean_displacement_error(GroundErrors.concatenate(errors)).mde_m

    contenders = [
        Contender("Trifuse", lambda i: default.update(prepared.windows[i])),
        Contender("thesis: piecewise planes", lambda i: thesis.update(prepared.windows[i])),
    ]
    add_peer(contenders, plane)
    add_peer(contenders, patchwork)
    metrics = [metric("mDE [mm]", mde_mm, ".1f")] if prepared.drive.has_labels else []
    return compare("ground", contenders, len(prepared.frames), *metrics)


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
    return compare("voxel counting", contenders, len(prepared.frames))


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
    return compare("static and moving", contenders, len(prepared.frames))
