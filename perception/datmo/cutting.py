"""Cut points over the ground plane into things, as a spinning LiDAR shows them.

A beam's neighbours to the side hit close by; its neighbours above and below hit a slanted surface, a
bonnet or a windscreen, far in front or behind. So gaps within one thing lie along the line of sight,
and gaps to its neighbour lie across.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from perception.types import Bool, Float, Float64, Int, UInt8


@dataclass(frozen=True)
class CutRules:
    """Which gaps do not part a thing.

    Attributes:
        cell_m: points so close are one.
        side_gap_m: across the line of sight: more than between a walker's legs, less than between two
            walkers side by side.
        depth_gap_m: along the line of sight, at least: a bonnet to a windscreen.
        most_depth_gap_m: along the line of sight, at most: less than from one car to the next.
        rise: slope of the flattest surface that is bridged between two beams.
    """

    cell_m: float = 0.15
    side_gap_m: float = 0.4
    depth_gap_m: float = 0.6
    most_depth_gap_m: float = 1.5
    rise: float = 1 / 3


def cut_moving(points_velo: Float, elevation_step_rad: float, rules: CutRules) -> Int:
    """Return (N,) the number of each point's thing, from 0.

    Args:
        points_velo: (N, 2+) with the sensor at the origin.
        elevation_step_rad: between two beams.
        rules: which gaps do not part a thing.
    """
    if len(points_velo) == 0:
        return np.zeros(0, np.int64)
    cell_of, places_m = _cells(points_velo, rules.cell_m)
    ranges_m = np.hypot(*places_m.T)
    depth_gaps_m = np.clip(
        ranges_m * elevation_step_rad / rules.rise, rules.depth_gap_m, rules.most_depth_gap_m
    )
    reach_m = float(depth_gaps_m.max())
    pairs = cKDTree(places_m).query_pairs(reach_m, output_type="ndarray")
    pairs = pairs[_is_one(places_m, depth_gaps_m, pairs, rules.side_gap_m)]
    links = coo_matrix((np.ones(len(pairs)), pairs.T), (len(places_m), len(places_m)))
    _, thing_of_cell = connected_components(links, directed=False)
    return np.asarray(thing_of_cell[cell_of], np.int64)


@dataclass(frozen=True)
class StandingCells:
    """Which cells over the ground plane hold standing points.

    Attributes:
        picture: (X, Y) 1 where a standing point is.
        first: cell of the picture's corner, counted from the sensor.
        cell_m: edge of a cell.
        cell_of: (N, 2) cell of each standing point within the picture.
    """

    picture: UInt8
    first: Int
    cell_m: float
    cell_of: Int

    @classmethod
    def under(cls, points_velo: Float, cell_m: float) -> "StandingCells":
        """Draw the picture of (N, 2+) points, at least one."""
        cells = _cell_numbers(points_velo, cell_m)
        first = cells.min(axis=0) - 1  # a margin of one empty cell on every side
        cell_of = cells - first
        picture = np.zeros(cell_of.max(axis=0) + 2, np.uint8)
        picture[cell_of[:, 0], cell_of[:, 1]] = 1
        return cls(picture, first, cell_m, cell_of)

    def cut(self, length_m: float) -> Int:
        """Return (N,) the number of each point's thing, from 0; -1 where it is too long to be one.

        Cells with a common corner are one.
        """
        _, labels, stats, _ = cv2.connectedComponentsWithStats(self.picture, connectivity=8)
        longest = stats[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1)
        is_thing = longest * self.cell_m <= length_m
        is_thing[0] = False  # the space between
        number = np.where(is_thing, np.cumsum(is_thing) - 1, -1)
        return np.asarray(number[labels[self.cell_of[:, 0], self.cell_of[:, 1]]], np.int64)

    def touches(self, points_velo: Float) -> Bool:
        """Tell which of (P, 2+) points lie in a cell with a standing point or beside one."""
        grown = cv2.dilate(self.picture, np.ones((3, 3), np.uint8))
        cells = _cell_numbers(points_velo, self.cell_m) - self.first
        is_on = ((cells >= 0) & (cells < grown.shape)).all(axis=1)
        x, y = np.where(is_on[:, None], cells, 0).T
        return np.asarray(is_on & (grown[x, y] > 0))


def _cell_numbers(points_velo: Float, cell_m: float) -> Int:
    return np.floor(points_velo[:, :2] * np.float32(1 / cell_m)).astype(np.int32)


def _cells(points_velo: Float, cell_m: float) -> tuple[Int, Float64]:
    """Return (N,) the cell of each point and (C, 2) the mean place of each cell's points."""
    xy_m = np.asarray(points_velo[:, :2], np.float64)
    cells = np.floor(xy_m / cell_m).astype(np.int64)
    cells -= cells.min(axis=0)
    keys = cells[:, 0] * (int(cells[:, 1].max()) + 1) + cells[:, 1]
    _, cell_of, counts = np.unique(keys, return_inverse=True, return_counts=True)
    sums = [np.bincount(cell_of, xy_m[:, axis]) for axis in (0, 1)]
    return np.asarray(cell_of, np.int64), np.column_stack(sums) / counts[:, None]


def _is_one(places_m: Float64, depth_gaps_m: Float64, pairs: Int, side_gap_m: float) -> Bool:
    """Tell which (L, 2) pairs of cells lie within an ellipse along the line of sight."""
    first, second = places_m[pairs[:, 0]], places_m[pairs[:, 1]]
    sight = first + second
    sight /= np.maximum(np.linalg.norm(sight, axis=1, keepdims=True), 1e-6)
    apart = second - first
    along = (apart * sight).sum(axis=1)
    across = apart[:, 0] * sight[:, 1] - apart[:, 1] * sight[:, 0]
    depth_m = depth_gaps_m[pairs].mean(axis=1)
    return np.asarray((along / depth_m) ** 2 + (across / side_gap_m) ** 2 <= 1)
