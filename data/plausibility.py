"""Plausibility checks: times, INS motion, calibration, labels."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from data.kitti.oxts import InsPacket, Mercator, velocity_world_m_s
from perception.geometry.camera import is_in_view
from perception.geometry.se3 import inverse, rotation_angle_rad
from perception.types import Calibration, Float64, Frame, Labels

_MAX_PERIODS = 1.5  # between two scans
_JUMP_M = 1.0  # the INS off its own velocity between two scans; KITTI: 0.1 at most, measured
_MAX_SPEED_M_S = 70.0
_MAX_ACCELERATION_M_S2 = 30.0  # no wheel holds three times the weight
_MAX_TURN_RATE_RAD_S = 3.0
_ORTHONORMAL = 1e-3  # the files print seven digits
_MIN_SHARE_IN_VIEW = 0.1  # of the points ahead; KITTI: 0.49 to 0.76, measured
_AHEAD_M = 5.0
_BORDER_PX = 2.0
_MAX_DISTANCE_M = 250.0


@dataclass(frozen=True)
class Anomaly:
    """One implausible value.

    Attributes:
        what: Kind of the anomaly.
        example: Sentence that says where it is, what was expected, and what was found.
    """

    what: str
    example: str


def describe_invalid_points(frame: Frame) -> str:
    """Return a sentence on the points of a scan that were no measurement."""
    return (
        f"{frame.source}: {frame.invalid_points} of {len(frame.points_velo)} points are NaN, infinite "
        "or beyond 10 km; they keep their rows, without a return"
    )


def time_anomalies(stamps_s: Mapping[int, float]) -> Iterator[Anomaly]:
    """Find gaps between consecutive frames, and time that does not advance."""
    steps = {b: stamps_s[b] - stamps_s[a] for a, b in pairwise(stamps_s) if b == a + 1}
    if not steps:
        return
    usual_s = float(np.median(list(steps.values())))
    for index, step_s in steps.items():
        where = f"frame {index}"
        if step_s <= 0:
            yield Anomaly("time runs backwards", f"{where}: {step_s:.3f} s after the frame before")
        elif step_s > _MAX_PERIODS * usual_s:
            yield Anomaly(
                "gaps in time",
                f"{where}: expected {usual_s:.3f} s after the frame before, found {step_s:.3f} s",
            )


def motion_anomalies(
    packets: Mapping[int, InsPacket], stamps_s: Mapping[int, float], period_s: float
) -> Iterator[Anomaly]:
    """Find steps of the INS that contradict its own velocity, or exceed what a vehicle can do."""
    if not packets:
        return
    world = Mercator.around(next(iter(packets.values())))
    for before, after, step_s in _steps(packets, stamps_s, period_s):
        yield from _step_anomalies(world, packets[before], packets[after], step_s, f"frame {after}")


def pose_anomalies(
    poses: Mapping[int, Float64], stamps_s: Mapping[int, float], period_s: float
) -> Iterator[Anomaly]:
    """Find steps from one pose to the next that exceed what a vehicle can do."""
    for before, after, step_s in _steps(poses, stamps_s, period_s):
        motion = inverse(poses[before]) @ poses[after]
        limits = (
            ("speed", float(np.linalg.norm(motion[:3, 3])) / step_s, _MAX_SPEED_M_S, "m/s"),
            ("turning", rotation_angle_rad(motion) / step_s, _MAX_TURN_RATE_RAD_S, "rad/s"),
        )
        for what, value, limit, unit in limits:
            if value > limit:
                yield Anomaly(
                    f"{what} between poses implausible",
                    f"frame {after}: expected at most {limit:g} {unit}, found {value:.1f}",
                )


def _steps(
    numbers: Iterable[int], stamps_s: Mapping[int, float], period_s: float
) -> Iterator[tuple[int, int, float]]:
    """Yield the numbers of neighbouring frames and the time between them, where it advances."""
    for before, after in pairwise(numbers):
        known = before in stamps_s and after in stamps_s
        step_s = stamps_s[after] - stamps_s[before] if known else (after - before) * period_s
        if step_s > 0:
            yield before, after, step_s


def _step_anomalies(
    world: Mercator, before: InsPacket, after: InsPacket, step_s: float, where: str
) -> Iterator[Anomaly]:
    pose_before, pose_after = world.world_SE3_imu(before), world.world_SE3_imu(after)
    velocities = velocity_world_m_s(before), velocity_world_m_s(after)
    expected_m = step_s * (velocities[0] + velocities[1]) / 2
    moved_m = pose_after[:3, 3] - pose_before[:3, 3]
    off_m = float(np.linalg.norm(moved_m - expected_m))
    if off_m > _JUMP_M:
        yield Anomaly(
            "INS jumps",
            f"{where}: expected {np.linalg.norm(expected_m):.2f} m moved as its velocity says, "
            f"found {np.linalg.norm(moved_m):.2f} m, {off_m:.2f} m off",
        )
    turn_rad_s = rotation_angle_rad(inverse(pose_before) @ pose_after) / step_s
    limits = (
        ("INS speed", float(np.linalg.norm(velocities[1])), _MAX_SPEED_M_S, "m/s"),
        (
            "INS acceleration",
            float(np.linalg.norm(velocities[1] - velocities[0])) / step_s,
            _MAX_ACCELERATION_M_S2,
            "m/s2",
        ),
        ("INS turning", turn_rad_s, _MAX_TURN_RATE_RAD_S, "rad/s"),
    )
    for what, value, limit, unit in limits:
        if value > limit:
            yield Anomaly(
                f"{what} implausible",
                f"{where}: expected at most {limit:g} {unit}, found {value:.1f}",
            )


def rotation_anomalies(dst_SE3_src: Float64, where: str) -> Iterator[Anomaly]:
    """Find a rotation matrix that is not orthonormal."""
    rotation = dst_SE3_src[:3, :3]
    error = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    if error > _ORTHONORMAL or np.linalg.det(rotation) < 0:
        found = "a mirror" if error <= _ORTHONORMAL else f"R R' off the identity by {error:.3g}"
        yield Anomaly("invalid rotations", f"{where}: expected a rotation matrix, found {found}")


def calibration_anomalies(calibration: Calibration) -> Iterator[Anomaly]:
    """Find a LiDAR-to-camera rotation that is not orthonormal, and a principal point outside the image."""
    yield from rotation_anomalies(calibration.cam_SE3_velo, f"{calibration.source} cam_SE3_velo")
    size = calibration.image_size_px
    center_px = calibration.image_P_cam[:2, 2]
    if size is not None and not ((center_px > 0) & (center_px < size)).all():
        yield Anomaly(
            "principal points outside the image",
            f"{calibration.source}: expected it within {size[0]}x{size[1]} pixels, "
            f"found {center_px[0]:.1f}, {center_px[1]:.1f}",
        )


def projection_anomalies(frame: Frame, *, is_forward: bool = True) -> Iterator[Anomaly]:
    """Find a LiDAR whose points ahead are not projected into the image.

    Args:
        frame: Frame with a calibration.
        is_forward: Whether ahead is ahead of the vehicle; False for ahead of the camera, as its calibration has it.
    """
    calibration = frame.calibration
    if calibration is None or calibration.image_size_px is None:
        return
    # Distance ahead of the LiDAR, or of the camera.
    row = np.eye(4)[0] if is_forward else calibration.cam_SE3_velo[2]
    ahead_m = frame.points_velo[:, :3] @ row[:3] + row[3]
    ahead = frame.points_velo[ahead_m > _AHEAD_M]
    if len(ahead) == 0:
        return
    share = float(is_in_view(calibration, ahead, calibration.image_size_px).mean())
    if share < _MIN_SHARE_IN_VIEW:
        yield Anomaly(
            "LiDAR and camera calibration that contradict each other",
            f"{frame.source}: expected the camera to see at least {_MIN_SHARE_IN_VIEW:.0%} of "
            f"the points ahead as {calibration.source} has it, found {share:.1%}",
        )


def label_anomalies(
    labels: Labels, image_size_px: tuple[int, int] | None, where: str
) -> Iterator[Anomaly]:
    """Find boxes outside the image, without size, or beyond the range of any LiDAR."""
    boxes = labels.boxes_velo
    reach_m = np.linalg.norm(boxes.bottom_m, axis=1)
    for kind, size_m, distance_m in zip(labels.types, boxes.size_m, reach_m, strict=True):
        if size_m.min() <= 0 or distance_m > _MAX_DISTANCE_M:
            yield Anomaly(
                "label boxes implausible",
                f"{where}: expected a {kind} with a size within {_MAX_DISTANCE_M:g} m, "
                f"found {size_m.round(2)} m at {distance_m:.0f} m",
            )
    edges = labels.boxes_px
    is_inverted = (edges[:, 2:] <= edges[:, :2]).any(axis=1)
    limit_px = np.asarray(image_size_px or (np.inf, np.inf)) + _BORDER_PX
    is_outside = ((edges[:, :2] < -_BORDER_PX) | (edges[:, 2:] > limit_px)).any(axis=1)
    for row in np.flatnonzero(is_inverted | is_outside):
        yield Anomaly(
            "label boxes outside the image",
            f"{where}: expected x1 y1 x2 y2 of a {labels.types[row]} within "
            f"{image_size_px or 'the image'}, found {edges[row].round(1)}",
        )
