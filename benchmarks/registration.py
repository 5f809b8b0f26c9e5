"""Registration scan by scan: time, and drift where the poses are known exactly."""

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.measure import Comparison, Contender, Measurement, add_peer, compare, metric
from benchmarks.stages import PreparedDrive
from data.derived.moving_methods import true_poses
from perception.errors import optional_package
from perception.evaluation.report import Column
from perception.geometry.se3 import inverse, rotation_angle_rad
from perception.localization.odometry import LidarOdometry
from perception.localization.registration import register_window
from perception.types import Float32, Float64

# (target points, source points, first guess of target_SE3_source) to target_SE3_source.
Register = Callable[[Float32, Float32, Float64], Float64]
# Scans from the first to the last pose of which the error is measured: a second.
_SPAN = 10


def one_call_small_gicp() -> Register:
    """Return small_gicp's one-line call with its defaults on two threads."""
    with optional_package(
        "small_gicp", needed_for="the small_gicp registration peer", extra="bench"
    ):
        import small_gicp

    def register(target: Float32, source: Float32, guess: Float64) -> Float64:
        result = small_gicp.align(
            target[:, :3].astype(np.float64),
            source[:, :3].astype(np.float64),
            init_T_target_source=guess,
            num_threads=2,
        )
        return np.asarray(result.T_target_source)

    return register


def kiss_icp_odometry() -> Callable[[Float32], Float64]:
    """Return KISS-ICP with its defaults on one thread: the points of the next scan to its (4, 4) world_SE3_velo.

    Synthetic scans and those of KITTI are taken at one instant, so that nothing is deskewed.

    Raises:
        MissingDependencyError: The package is not installed.
    """
    with optional_package("kiss-icp", needed_for="the KISS-ICP peer", extra="bench"):
        from kiss_icp.config import load_config
        from kiss_icp.kiss_icp import KissICP
    config = load_config(None)
    config.data.deskew = False
    config.registration.max_num_threads = 1
    odometry = KissICP(config)

    def update(points_velo: Float32) -> Float64:
        odometry.register_frame(points_velo[:, :3].astype(np.float64), np.zeros(0))
        return np.array(odometry.last_pose)

    return update


def open3d_point_to_plane(voxel_size_m: float = 0.5, reach_m: float = 1.0) -> Register:
    """Return point-to-plane ICP by Open3D on scans thinned to one point a box."""
    with optional_package("open3d", needed_for="the Open3D registration peer", extra="bench"):
        import open3d
    registration = open3d.pipelines.registration

    def thin(points: Float32) -> object:
        cloud = open3d.geometry.PointCloud()
        cloud.points = open3d.utility.Vector3dVector(points[:, :3].astype(np.float64))
        return cloud.voxel_down_sample(voxel_size_m)

    def register(target: Float32, source: Float32, guess: Float64) -> Float64:
        fixed, moving = thin(target), thin(source)
        fixed.estimate_normals()  # type: ignore[attr-defined]
        found = registration.registration_icp(
            moving,
            fixed,
            reach_m,
            guess,
            registration.TransformationEstimationPointToPlane(),
        )
        return np.asarray(found.transformation)

    return register


def compare_registration(prepared: PreparedDrive) -> Comparison:
    """Register scan by scan, beside library calls from scan to scan, KISS-ICP and the thesis' whole window."""
    contenders = [
        _odometry("Trifuse", prepared, has_ins=True),
        _odometry("Trifuse, without INS", prepared, has_ins=False),
        Contender("thesis: whole window (Algorithm 2)", lambda i: _register_window(prepared, i)),
    ]
    add_peer(
        contenders,
        lambda: _scan_to_scan("small_gicp, one call", one_call_small_gicp(), prepared),
    )
    add_peer(
        contenders,
        lambda: _scan_to_scan("Open3D, point to plane", open3d_point_to_plane(), prepared),
    )
    add_peer(contenders, lambda: _kiss_icp(prepared))
    known = true_poses(prepared.drive)
    title = "registration" if known else "registration, errors beside the INS"
    poses = [known[f.index] if known else f.world_SE3_velo for f in prepared.frames]
    truth = [pose for pose in poses if pose is not None]
    columns = _drift_columns(np.array(truth)) if len(truth) == len(poses) else []
    return compare(title, contenders, len(prepared.frames), *columns)


def _odometry(name: str, prepared: PreparedDrive, *, has_ins: bool) -> Contender:
    odometry = LidarOdometry(prepared.config.registration)

    def run(i: int) -> Float64:
        frame = prepared.frames[i]
        pose_ins = frame.world_SE3_velo if has_ins else None
        return odometry.update(frame.points_velo, frame.stamp_s, pose_ins).world_SE3_velo

    return Contender(name, run)


def _register_window(prepared: PreparedDrive, i: int) -> None:
    """Register a whole window, whose poses are known to each other already: the time alone tells."""
    register_window(prepared.windows[i])


def _scan_to_scan(name: str, register: Register, prepared: PreparedDrive) -> Contender:
    """Return a library's call, which starts at the motion by the INS."""
    frames, pose = prepared.frames, np.eye(4)

    def run(i: int) -> Float64:
        nonlocal pose
        before, now = frames[max(i - 1, 0)], frames[i]
        guess = np.eye(4)
        if before.world_SE3_velo is not None and now.world_SE3_velo is not None:
            guess = inverse(before.world_SE3_velo) @ now.world_SE3_velo
        pose = pose @ register(before.points_velo, now.points_velo, guess)
        return pose

    return Contender(name, run)


def _kiss_icp(prepared: PreparedDrive) -> Contender:
    odometry = kiss_icp_odometry()
    return Contender("KISS-ICP, without INS", lambda i: odometry(prepared.frames[i].points_velo))


def _drift_columns(truth: Float64) -> list[Column[Measurement]]:
    """Return the errors of the motion over a second.

    Args:
        truth: (F, 4, 4) poses that are exact, or those of the INS.
    """

    def of_motions(value: Callable[[Float64, Float64], float]) -> Callable[[list[Any]], Any]:
        return lambda poses: None if poses[0] is None else value(motion_errors(poses, truth), truth)

    def percentile_mm(percent: float) -> Callable[[Float64, Float64], float]:
        return lambda errors, _: 1e3 * float(np.percentile(_lengths_m(errors), percent))

    def drift_percent(errors: Float64, truth: Float64) -> float:
        span = len(truth) - len(errors)
        moved = np.linalg.inv(truth[:-span]) @ truth[span:]
        return 100 * float(_lengths_m(errors).sum() / _lengths_m(moved).sum())

    def rotation_deg(errors: Float64, _: Float64) -> float:
        return float(np.degrees(np.median([rotation_angle_rad(error) for error in errors])))

    return [
        metric("1 s p50 [mm]", of_motions(percentile_mm(50)), ".0f"),
        metric("p90 [mm]", of_motions(percentile_mm(90)), ".0f"),
        metric("drift [%]", of_motions(drift_percent), ".2f"),
        metric("1 s p50 [°]", of_motions(rotation_deg), ".3f"),
    ]


def motion_errors(poses: list[Float64], truth: Float64) -> Float64:
    """Return the (K, 4, 4) errors of the motions over a second, or over the whole drive where it is shorter.

    Args:
        poses: (F) poses world_SE3_velo in any world.
        truth: (F, 4, 4) exact poses.
    """
    estimated, span = np.array(poses), min(_SPAN, len(poses) - 1)
    true_motions = np.linalg.inv(truth[:-span]) @ truth[span:]
    return np.asarray(
        np.linalg.inv(true_motions) @ np.linalg.inv(estimated[:-span]) @ estimated[span:]
    )


def _lengths_m(motions: Float64) -> Float64:
    return np.asarray(np.linalg.norm(motions[:, :3, 3], axis=-1))
