"""Check of the mounting: x forward, y left, z up, at the height of the LiDAR model.

One scan is enough. A spinning LiDAR covers all azimuths but few elevations, so the axis along which its rays point
least is its axis of rotation, and the ground is the plane at one end of that axis.
"""

from dataclasses import dataclass

import numpy as np

from perception.errors import MountingError
from perception.geometry.planes import fit_height_plane, lowest_in_cells
from perception.sensor import LidarModel
from perception.types import Float, Float32

_AXES = "xyz"
_SAMPLE = 6_000  # points are plenty: the check takes milliseconds
_NEAR_M = (2.0, 20.0)  # beyond the vehicle itself; where a road is still a plane
_CELL_M = 2.0
_INLIER_M = 0.15  # a few range noises (thesis: ground within 0.2 m)
_FIT_ROUNDS = 10
# Shares of the near points that lie on the ground: 0.3 to 0.9 in KITTI's frames, 0.06 to 0.2 where walls
# fill the view of few beams; a plane that is not the ground holds 0.08 at most, ceilings apart (measured).
_SEEN_SUPPORT = 0.15
_SURE_SUPPORT = 0.2
_HEIGHT_TOLERANCE_M = 0.5
_MIN_CELLS = 8
_MIN_RAYS = 100  # of fewer, the directions say nothing


@dataclass(frozen=True)
class _Plane:
    """A plane that bounds a scan at one end of an axis.

    Attributes:
        height_m: Height of the sensor over the plane; negative where the plane is above the sensor.
        support: Share of the near points that lie on it.
    """

    height_m: float
    support: float


def check_mounting(points_velo: Float32, sensor: LidarModel, source: str = "first scan") -> None:
    """Validate that a scan has its ground below, at the sensor's height; pass where that is uncertain.

    Args:
        points_velo: (N, 4) points of one scan.
        sensor: LiDAR model with the mounting height.
        source: File of the scan, for the error message.

    Raises:
        MountingError: another axis points up, or the sensor is mounted at another height.
    """
    sample = points_velo[:: max(1, len(points_velo) // _SAMPLE), :3]
    up = _spin_axis(sample)
    if up != 2:
        raise _swapped_axes(sample, up, source)
    below = _bounding_plane(sample, up=2, sign=1)
    error_m = abs(below.height_m - sensor.height_m)
    # A LiDAR that looks up rather than down has few points on the road, and many on a ceiling.
    share_below = float(np.clip(2 * (sensor.elevations_rad <= 0).mean(), 0.01, 1.0))
    if below.support >= _SEEN_SUPPORT * share_below and error_m <= _HEIGHT_TOLERANCE_M:
        return
    ground = _ground(sample, up=2)
    is_right = abs(ground.height_m - sensor.height_m) <= _HEIGHT_TOLERANCE_M
    if is_right or ground.support < _SURE_SUPPORT / share_below:
        return
    if ground.height_m < 0:
        raise MountingError(
            source,
            expected="the ground below the LiDAR, z pointing up",
            found=f"the ground {-ground.height_m:.2f} m above the LiDAR",
            advice="the LiDAR is mounted upside down: rotate the points by 180 degrees about x",
        )
    raise MountingError(
        source,
        expected=f"the ground {sensor.height_m:.2f} m below the LiDAR, as {sensor.name} says",
        found=f"the ground {ground.height_m:.2f} m below the LiDAR",
        advice="set model and height_m in a .yaml file and pass it with --sensor",
    )


def _spin_axis(points: Float) -> int:
    """Return the axis along which the rays point least; z unless another is clearly less."""
    ranges_m = np.linalg.norm(points, axis=1)
    seen = ranges_m > 1.0
    rays = points[seen] / ranges_m[seen, None]
    if len(rays) < _MIN_RAYS:
        return 2
    spread = np.square(rays).mean(axis=0)
    axis = int(spread.argmin())
    # KITTI's frames have 0.04 along z and over 0.4 along x and y, measured.
    return axis if spread[axis] < spread[2] / 2 else 2


def _swapped_axes(points: Float, up: int, source: str) -> MountingError:
    sign = "+" if _ground(points, up).height_m > 0 else "-"
    return MountingError(
        source,
        expected="a LiDAR with x forward, y left and z up",
        found=f"{sign}{_AXES[up]} pointing up",
        advice="swap the axes of the points when you record them",
    )


def _ground(points: Float, up: int) -> _Plane:
    """Return that of the two bounding planes which holds more points.

    In the open the highest point of most cells is ground as well: either plane can be the ground.
    """
    low, high = (_bounding_plane(points, up, sign) for sign in (1, -1))
    return low if low.support >= high.support else high


def _bounding_plane(points: Float, up: int, sign: int) -> _Plane:
    """Fit a plane to the outermost points of the cells around the sensor: the lowest for sign 1."""
    across = [axis for axis in range(3) if axis != up]
    radius_m = np.linalg.norm(points[:, across], axis=1)
    near = (radius_m > _NEAR_M[0]) & (radius_m < _NEAR_M[1])
    xy = points[near][:, across].astype(np.float64)
    z = sign * points[near, up].astype(np.float64)
    lowest = lowest_in_cells(xy, z, _CELL_M)
    if len(lowest) < _MIN_CELLS:
        return _Plane(0.0, 0.0)
    # Most outliers are above the ground, so the fit starts from a low quantile.
    start = np.array([0.0, 0.0, np.quantile(z[lowest], 0.3)])
    plane = fit_height_plane(xy[lowest], z[lowest], start, scale_m=_INLIER_M, rounds=_FIT_ROUNDS)
    distances_m = np.abs(xy @ plane[:2] + plane[2] - z)
    return _Plane(-sign * float(plane[2]), float((distances_m < _INLIER_M).mean()))
