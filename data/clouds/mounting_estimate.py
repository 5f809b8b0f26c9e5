"""How a LiDAR is mounted, from its scans alone: which axis points where, its tilt and its height over the road.

The axis of rotation is that along which rays point least, the ground is the plane at one of its ends, and forward is
where the vehicle drives to.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perception.geometry.planes import (
    fit_height_plane,
    geman_mcclure_weights,
    lowest_in_cells,
    planes_through,
)
from perception.geometry.se3 import from_rotation_translation
from perception.localization.alignment import align, preprocess_points, share_on_surfaces
from perception.types import Float32, Float64

_SAMPLE = 40_000
_NEAR_M = (2.0, 20.0)  # beyond the vehicle itself; where a road is still a plane
_CELL_M = 1.0
_MIN_CELLS = 20
_ROUGHNESS_M = 0.05  # of the distances that count little: kerbs, grass
_TRIPLES, _MAX_TILT_RAD = 2_000, np.radians(25)
_ROUNDS = 15
_SUPPORT_M = 0.1
_LANE_M = 1.75  # to either side of the wheels; beyond, roads fall to their kerbs
_MIN_LANE_POINTS = 200
_MIN_SUPPORT = (
    0.1  # of the near points on the ground; a plane that is not the ground holds 0.08 at most
)
_MIN_MOTION_M = 0.15  # between two scans; less may be the error of the alignment
_EXACT_M = 1e-9
_MIN_SHARE = 0.3  # of the points that lie on surfaces of the scan before
_SURFACE_M = 0.1
_VOXEL_M = 0.5
_MATCH_M = 1.0
_STARTS_M = (1.5, 3.0)  # 54 and 108 km/h at 10 Hz
_MAX_OFF_AXIS_RAD = np.radians(30)
_NAMES = {0: ("forward", "backward"), 1: ("left", "right"), 2: ("up", "down")}


@dataclass(frozen=True)
class GroundPlane:
    """The ground under one scan.

    Attributes:
        normal: (3,) unit vector up, in the axes of the points.
        height_m: Height of the LiDAR over it in metres.
        support: Share of the near points that lie on it.
    """

    normal: Float64
    height_m: float
    support: float


@dataclass(frozen=True)
class MountingEstimate:
    """Mounting of a LiDAR.

    Attributes:
        axes: Directions in which x, y and z of the scans point.
        roll_rad: Roll against the road, left side up positive.
        pitch_rad: Pitch against the road, front down positive.
        height_m: Height over the road, or None where no ground was found.
        ground_support: Share of the near points on the ground.
        moved_m: Distance driven between the scans that were compared; 0 where forward is a guess.
    """

    axes: tuple[str, str, str]
    roll_rad: float
    pitch_rad: float
    height_m: float | None
    ground_support: float
    moved_m: float

    @property
    def is_forward_known(self) -> bool:
        """Whether a motion showed which way is forward."""
        return self.moved_m > 0


def estimate_mounting(
    scans: Sequence[Float32], pairs: Sequence[tuple[Float32, Float32]] = ()
) -> MountingEstimate:
    """Estimate the mounting from some scans of a drive.

    Args:
        scans: (N, 3) points of some scans, in the axes of the files.
        pairs: Some scans with the next one each; without motion x is taken as forward, or y where x cannot be.
    """
    up, sign = upward_axis(scans)
    moved = np.sum([_motion(*pair) for pair in pairs], axis=0) if pairs else np.zeros(3)
    turn, moved_m = _turn(up, sign, np.asarray(moved))
    axes = _axis_names(turn)
    lane_m = _LANE_M if moved_m else None
    found = [fit_ground(scan @ turn.T.astype(np.float32), lane_m) for scan in scans]
    planes = [plane for plane in found if plane is not None]
    if not planes:
        return MountingEstimate(axes, 0.0, 0.0, None, 0.0, moved_m)
    # The normals of the scans scatter with the road; their medians do not.
    normal = np.median([plane.normal for plane in planes], axis=0)
    normal /= np.linalg.norm(normal)
    pitch_rad = float(np.arcsin(np.clip(-normal[0], -1, 1)))
    roll_rad = float(np.arctan2(normal[1], normal[2]))
    height_m = float(np.median([plane.height_m for plane in planes]))
    support = float(np.median([plane.support for plane in planes]))
    return MountingEstimate(axes, roll_rad, pitch_rad, height_m, support, moved_m)


def upward_axis(scans: Sequence[Float32]) -> tuple[int, int]:
    """Return the axis that points along the vertical, and 1 where it points up, -1 where down."""
    spreads, votes = [], {}
    for scan in scans:
        ranges_m = np.linalg.norm(scan, axis=1)
        rays = scan[ranges_m > 1.0] / ranges_m[ranges_m > 1.0, None]
        if len(rays):
            spreads.append(np.square(rays).mean(axis=0))
    spread = np.mean(spreads, axis=0) if spreads else np.array([1.0, 1.0, 0.0])
    up = int(spread.argmin())
    for sign in (1, -1):
        turn = _turn(up, sign, np.zeros(3))[0].astype(np.float32)
        planes = [fit_ground(scan @ turn.T) for scan in scans]
        votes[sign] = sum(plane.support for plane in planes if plane is not None)
    return up, 1 if votes[1] >= votes[-1] else -1


def fit_ground(points: Float32, lane_m: float | None = None) -> GroundPlane | None:
    """Fit the ground to (N, 3) points of a scan with z up; None where there is none.

    Args:
        points: Points with z along the vertical, up to a tilt.
        lane_m: Distance to either side of x in which the road is a plane, or None where x is not forward.
    """
    sample = points[:: max(1, len(points) // _SAMPLE)].astype(np.float64)
    radius_m = np.hypot(sample[:, 0], sample[:, 1])
    near = sample[(radius_m > _NEAR_M[0]) & (radius_m < _NEAR_M[1])]
    xy, z = near[:, :2], near[:, 2]
    lowest = lowest_in_cells(xy, z, _CELL_M)
    if len(lowest) < _MIN_CELLS:
        return None
    # From the plane with most of the lowest points of cells to all points close to it.
    plane = _fit(xy, z, _best_plane(near[lowest]))
    away_m = np.abs(xy @ plane[:2] + plane[2] - z)
    support = float((away_m < _SUPPORT_M).mean())
    in_lane = (np.abs(xy[:, 1]) < (lane_m or 0.0)) & (away_m < 2 * _SUPPORT_M)
    if in_lane.sum() >= _MIN_LANE_POINTS:
        plane = _fit(xy[in_lane], z[in_lane], plane)
    normal = np.array([-plane[0], -plane[1], 1.0]) / np.sqrt(1 + plane[0] ** 2 + plane[1] ** 2)
    height_m = -float(plane[2] * normal[2])
    if height_m <= 0 or support < _MIN_SUPPORT:
        return None
    return GroundPlane(normal, height_m, support)


def _best_plane(points: Float64) -> Float64:
    """Return a, b, c of the plane z = a x + b y + c with most of (N, 3) points, by RANSAC."""
    random = np.random.default_rng(0)
    planes = planes_through(points[random.integers(len(points), size=(_TRIPLES, 3))])
    planes = planes[planes[:, 2] > np.cos(_MAX_TILT_RAD)]
    if len(planes) == 0:
        return np.array([0.0, 0.0, np.quantile(points[:, 2], 0.3)])
    away_m = np.abs(planes[:, :3] @ points.T + planes[:, 3:])
    best = planes[(away_m < _SUPPORT_M).sum(axis=1).argmax()]
    return np.asarray(-best[[0, 1, 3]] / best[2])


def _fit(xy: Float64, z: Float64, start: Float64) -> Float64:
    return fit_height_plane(
        xy, z, start, scale_m=_ROUGHNESS_M, rounds=_ROUNDS, weights_of=geman_mcclure_weights
    )


def _motion(before: Float32, after: Float32) -> Float64:
    """Return (3,) the motion of the LiDAR from one scan to the next; zeros where it is not sure."""
    # The distances of zero of a repeated scan would tell against standing.
    if np.array_equal(before, after):
        return np.zeros(3)
    target = preprocess_points(before, _VOXEL_M)
    source = preprocess_points(after, _VOXEL_M)
    starts = [
        np.zeros(3),
        *(sign * far_m * axis for far_m in _STARTS_M for axis in np.eye(3) for sign in (1, -1)),
    ]
    best, best_share = np.zeros(3), _MIN_SHARE
    for start in starts:
        guess = from_rotation_translation(np.eye(3), start)
        motion = align(target, source, guess, _MATCH_M).target_SE3_source
        # Points without a surface have no distance, and speak for any motion.
        share, vague = (
            share_on_surfaces(source, target, motion, reach_m) for reach_m in (_SURFACE_M, _EXACT_M)
        )
        share -= vague
        if share > best_share:
            best, best_share = motion[:3, 3], share
    return best if np.linalg.norm(best) > _MIN_MOTION_M else np.zeros(3)


def _turn(up: int, sign: int, moved: Float64) -> tuple[Float64, float]:
    """Return the (3, 3) turn to x forward, y left, z up, and the distance by which forward is known."""
    vertical = np.zeros(3)
    vertical[up] = sign
    across = [axis for axis in range(3) if axis != up]
    forward_axis = max(across, key=lambda axis: abs(moved[axis]))
    along = abs(moved[forward_axis])
    aside = float(np.linalg.norm(np.delete(moved, [forward_axis, up])))
    is_known = along > 0 and np.arctan2(aside, along) < _MAX_OFF_AXIS_RAD
    if not is_known:
        forward_axis = across[0] if up != 0 else 2
    forward = np.zeros(3)
    forward[forward_axis] = np.sign(moved[forward_axis]) if is_known else 1.0
    turn = np.stack([forward, np.cross(vertical, forward), vertical])
    return turn, float(along) if is_known else 0.0


def _axis_names(turn: Float64) -> tuple[str, str, str]:
    names = []
    for axis in range(3):
        row = int(np.abs(turn[:, axis]).argmax())
        names.append(_NAMES[row][0 if turn[row, axis] > 0 else 1])
    first, second, third = names
    return first, second, third
