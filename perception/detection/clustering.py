"""Exact DBSCAN in the plane, by cells in which all points are neighbours.

Points of a cell with enough points are cores without any comparison, and two cells are joined as soon as two of
their cores are close. Single points are compared only where cells do not decide. The labels are those of
scikit-learn: clusters are numbered in the order of their first core, and a border point of several clusters
belongs to the first of them. The author's program gives it to its nearest core.

The 11,000 points above ground of a frame of KITTI take 2 ms here and 65 ms in scikit-learn, on one core.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from perception.detection.point_cells import CellPairs, PointCells, expand_ranges
from perception.errors import UsageError
from perception.types import Bool, Float, Int

# Above this number of comparisons, building a tree is faster than comparing all points.
_MAX_COMPARISONS = 100_000


@dataclass(frozen=True)
class _Cores:
    """Cores among the sorted points, and the neighbours that were compared.

    Attributes:
        is_core: (N,) mask of the cores.
        points: (H,) indices of points that their own and the fully adjacent cells do not make a core.
        neighbours: (H,) index of a neighbour of each, outside these cells.
    """

    is_core: Bool
    points: Int
    neighbours: Int


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
    cells = PointCells.of(xy_m, radius_m)
    pairs = CellPairs.of(cells, radius_m)
    cores = _find_cores(cells, pairs, radius_m, min_points)
    part = _join(cells, pairs, cores.is_core, radius_m)
    number = _number(cells, cores.is_core, part)
    labels = np.empty(len(xy_m), np.int64)
    labels[cells.order] = _label(cells, pairs, cores, number)
    return labels


def _find_cores(cells: PointCells, pairs: CellPairs, radius_m: float, least: int) -> _Cores:
    whole = pairs[pairs.is_whole]
    sure = cells.counts.copy()
    for one, other in ((whole.first, whole.second), (whole.second, whole.first)):
        sure += np.bincount(one, cells.counts[other], len(cells)).astype(np.int64)
    is_open, part = sure < least, pairs[~pairs.is_whole]
    one = np.concatenate([part.first, part.second])
    other = np.concatenate([part.second, part.first])
    asked = np.flatnonzero(is_open[one])
    one, other = one[asked], other[asked]
    owner, points = expand_ranges(cells.starts[one], cells.counts[one])
    near = np.flatnonzero(cells.may_be_near(points, other[owner], radius_m))
    points, other = points[near], other[owner[near]]
    owner, neighbours = expand_ranges(cells.starts[other], cells.counts[other])
    points = points[owner]
    hits = np.flatnonzero(cells.is_near(points, neighbours, radius_m))
    points, neighbours = points[hits], neighbours[hits]
    is_core = (~is_open).repeat(cells.counts)
    is_core |= sure.repeat(cells.counts) + np.bincount(points, minlength=len(is_core)) >= least
    return _Cores(is_core, points, neighbours)


def _join(cells: PointCells, pairs: CellPairs, is_core: Bool, radius_m: float) -> Int:
    """Return the (K,) connected component of the cores of each cell; a cell without cores is one by itself."""
    core_counts = np.add.reduceat(is_core, cells.starts, dtype=np.int64)
    is_full, has_core = core_counts == cells.counts, core_counts > 0
    is_joined = (is_full[pairs.first] & is_full[pairs.second]) & _face(cells, pairs, radius_m)
    is_joined |= pairs.is_whole
    kept = np.flatnonzero(has_core[pairs.first] & has_core[pairs.second])
    pairs, is_joined = pairs[kept], is_joined[kept]
    joined, doubtful = pairs[is_joined], pairs[~is_joined]
    part = connected_parts(len(cells), joined.first, joined.second)
    doubtful = doubtful[part[doubtful.first] != part[doubtful.second]]
    touching = doubtful[_touch(cells, doubtful, is_core, radius_m)]
    if len(touching.first) == 0:
        return part
    first, second = part[touching.first], part[touching.second]
    order = np.argsort(first)
    return connected_parts(len(cells), first[order], second[order])[part]


def _face(cells: PointCells, pairs: CellPairs, radius_m: float) -> Bool:
    """Return the mask of the pairs of cells that must have neighbouring points, by their bounding boxes.

    A bounding box has a point on each side. The points on two facing sides are no farther apart than the gap
    between the sides and the extent of both boxes along them.
    """
    gaps, spans = [], []
    for low_m, high_m in zip(cells.lows_m, cells.highs_m, strict=True):
        one = low_m[pairs.second] - high_m[pairs.first]
        other = low_m[pairs.first] - high_m[pairs.second]
        gaps.append(np.maximum(one, other))
        spans.append(np.minimum(one, other))
    limit, (gap_x, gap_y), (span_x, span_y) = radius_m * radius_m, gaps, spans
    across = gap_x * gap_x + span_y * span_y <= limit
    along = gap_y * gap_y + span_x * span_x <= limit
    return np.asarray(across | along)


def _touch(cells: PointCells, pairs: CellPairs, is_core: Bool, radius_m: float) -> Bool:
    """Return the mask of the pairs of cells with two neighbouring cores, one in each."""
    ones, pair_of_one = _cores_near(cells, pairs.first, pairs.second, is_core, radius_m)
    others, pair_of_other = _cores_near(cells, pairs.second, pairs.first, is_core, radius_m)
    counts = np.bincount(pair_of_other, minlength=len(pairs.first))
    starts = counts.cumsum() - counts
    touches: Bool = np.zeros(len(pairs.first), bool)
    if counts[pair_of_one].sum() > _MAX_COMPARISONS:
        # A third coordinate separates the pairs, so that one tree serves all.
        planes_m = (4 * radius_m * pair for pair in (pair_of_one, pair_of_other))
        one_m, other_m = (
            np.column_stack([cells.x_m[points], cells.y_m[points], plane_m])
            for points, plane_m in zip((ones, others), planes_m, strict=True)
        )
        apart_m, _ = cKDTree(other_m).query(one_m, distance_upper_bound=2 * radius_m)
        # The tree rounds differently: distances close to the radius are compared below.
        touches[pair_of_one[apart_m < radius_m * (1 - 1e-9)]] = True
        is_open = (apart_m < radius_m * (1 + 1e-9)) & ~touches[pair_of_one]
        ones, pair_of_one = ones[is_open], pair_of_one[is_open]
    owner, at = expand_ranges(starts[pair_of_one], counts[pair_of_one])
    hits = cells.is_near(ones[owner], others[at], radius_m)
    touches[pair_of_one[owner[hits]]] = True
    return touches


def _cores_near(
    cells: PointCells, of_cell: Int, to_cell: Int, is_core: Bool, radius_m: float
) -> tuple[Int, Int]:
    """Return the cores of each cell within the radius of another cell's bounding box, and the pair of each."""
    pair, points = expand_ranges(cells.starts[of_cell], cells.counts[of_cell])
    near = is_core[points] & cells.may_be_near(points, to_cell[pair], radius_m)
    return points[near], pair[near]


def connected_parts(count: int, first: Int, second: Int) -> Int:
    """Return the (count,) connected component of each node of a graph.

    Args:
        count: Number of nodes.
        first: (E,) first node of each edge, ascending.
        second: (E,) second node of each edge.
    """
    ends = np.zeros(count + 1, np.int32)
    np.cumsum(np.bincount(first, minlength=count), out=ends[1:])
    edges = csr_matrix((np.ones(len(first)), second.astype(np.int32), ends), (count, count))
    return np.asarray(connected_components(edges, directed=False)[1], np.int64)


def _number(cells: PointCells, is_core: Bool, part: Int) -> Int:
    """Return the (K,) cluster of the cores of each cell, numbered by first core; N for a cell without cores."""
    count = len(cells.order)
    first_core = np.minimum.reduceat(np.where(is_core, cells.order, count), cells.starts)
    first_of_part = np.full(len(cells), count)
    np.minimum.at(first_of_part, part, first_core)
    rank = np.empty(len(cells), np.int64)
    rank[np.argsort(first_of_part, kind="stable")] = np.arange(len(cells))
    return np.where(first_core < count, rank[part], count)


def _label(cells: PointCells, pairs: CellPairs, cores: _Cores, number: Int) -> Int:
    """Return the (N,) clusters of the sorted points."""
    whole, lowest = pairs[pairs.is_whole], number.copy()
    np.minimum.at(lowest, whole.first, number[whole.second])
    np.minimum.at(lowest, whole.second, number[whole.first])
    labels = number.repeat(cells.counts)
    cell = np.arange(len(cells)).repeat(cells.counts)
    border = np.flatnonzero(~cores.is_core)
    labels[border] = lowest[cell[border]]
    reached = np.flatnonzero(~cores.is_core[cores.points] & cores.is_core[cores.neighbours])
    np.minimum.at(labels, cores.points[reached], number[cell[cores.neighbours[reached]]])
    labels[border[labels[border] == len(labels)]] = -1
    return labels
