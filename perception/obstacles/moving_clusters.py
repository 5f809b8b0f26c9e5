"""Clusters of voxels, and the decision which of them are moving.

A single voxel is unreliable: a window reflects once and not the next time, a beam just misses an edge. So voxels are
joined to clusters over the ground plane, and a cluster is moving where enough of its voxels appeared in free space
(at least `min_voxels`, in enough scans, and more than those that persisted), or where nothing contradicts that it is a
body that moved in the scan before.

Leaves, fences and what is behind them appear in free space without moving, since beams find another way through them
in every scan. Older scans have hit most of their voxels, and these persist whatever younger ones have found.
"""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from perception.kernels.columns import (
    columns_of,
    count_in_groups,
    groups_near,
    joinable_columns,
)
from perception.obstacles.free_space import MARGIN_M, VisibilityHistory
from perception.obstacles.range_image import Visibility
from perception.types import Bool, Float, Float32, Float64, Int, UInt8

_CELL_M = 0.25  # edge of the ground cells in which voxels are joined: it keeps a pedestrian's legs together
# Edge of the cells in which, or beside which, a body moved in the scan before, 10 m/s at 10 Hz, and the largest distance at
# which a departed object is the cluster behind it.
_NEAR_M = 0.7
# Distance that is bridged, in those of two beams: on a surface that leans by 30 degrees, returns are twice as far apart.
_GAP_RATIO = 2.0

# Observations of its voxels that appeared, over the queried scans, of a cluster that begins to move.
_MIN_OBSERVATIONS = 15
_CLEAR_AGE_S = 0.5  # after which a pedestrian at 1 m/s no longer overlaps his earlier place
# Where the youngest queried scan, old enough to tell standing from walking, has hit all that came of a cluster, it is
# static again.
_STOP_AGE_S = 0.3

_ACCELERATION_M_S2 = 2.0  # by which an object that departs falls short of its steady path

# Of a body of the scan before and its heir, the smaller number of voxels to the larger one; of an object's voxels, those
# that move, from which on all of it moves. An heir moves where no more than the other share of its voxels contradicts.
_SAME_RATIO, _MAX_CONTRADICTED = 0.5, 0.15

# Length of the moving part of an object from which on it is a vehicle, not a person, who is in three neighbouring cells.
_VEHICLE_LENGTH_M = 3 * _NEAR_M


@dataclass(frozen=True)
class BodiesBefore:
    """Bodies that moved in the scan before, at V voxels of the newest.

    Attributes:
        of: (V,) the body that was in the ground cell of each voxel, from 1, 0 for none.
        near: (V,) the same, or a body in a neighbouring cell.
        sizes: Number of voxels of each body.
    """

    of: Int
    near: Int
    sizes: Int

    @classmethod
    def at(cls, centers_m: Float32, moved_m: Float32) -> "BodiesBefore":
        """Return the bodies of (B, 3) voxels that moved, at (V, 3) voxels."""
        bodies = VoxelColumns.over(moved_m).occupied if len(moved_m) else np.zeros(0, np.int64)
        of, near = groups_near(centers_m, moved_m, bodies, _NEAR_M)
        return cls(of, near, np.bincount(bodies, minlength=1))


def moving_voxels(
    centers_m: Float32,
    history: VisibilityHistory,
    before: BodiesBefore,
    beam_step_rad: float,
    min_voxels: int = 10,
    columns: "VoxelColumns | None" = None,
) -> Bool:
    """Return which of V occupied voxels belong to moving clusters.

    Args:
        centers_m: (V, 3) positions of the voxels.
        history: Visibility of these positions in earlier scans.
        before: What moved in the scan before.
        beam_step_rad: Angle between two beams; between them, parts of one object lie apart.
        min_voxels: Smallest number of voxels of a moving cluster that appeared in free space.
        columns: Columns of the voxels, where they are known.
    """
    if len(centers_m) == 0 or len(history.ages_s) == 0:
        return np.zeros(len(centers_m), bool)
    static_weight = _static_weight(history)
    columns = columns or VoxelColumns.over(centers_m)
    cluster = columns.join(history.persisted, _GAP_RATIO * beam_step_rad, static_weight)
    clusters = int(cluster.max()) + 1

    def count_by_cluster(voxels: Bool) -> Float64:
        return np.asarray(count_in_groups(cluster, voxels, clusters), np.float64)

    came, kept_away = _departures(cluster, clusters, history)
    leaves = count_by_cluster(history.uncovered) * ((came > 0) & (came >= kept_away))
    appeared = count_by_cluster(history.appeared) + leaves
    persisted = count_by_cluster(history.persisted) * static_weight
    goes_on = count_by_cluster(before.near > 0) > 0
    moves = (appeared >= np.where(goes_on, 1, min_voxels * static_weight)) & (appeared > persisted)
    new = np.flatnonzero(history.appeared | history.uncovered)
    states, of_new = history.states[:, new], cluster[new]
    is_hit = states == Visibility.HIT
    is_clear = (states == Visibility.FREE) | (states == Visibility.UNCOVERED)
    observations = np.bincount(of_new, (is_clear | is_hit).sum(axis=0), clusters)
    moves &= goes_on | (observations >= _MIN_OBSERVATIONS)
    sizes = np.bincount(cluster, minlength=clusters)
    # A gap that was kept, which is that of two surfaces, tells half as much as a return.
    contradicted = persisted + np.maximum(kept_away / 2 - came, 0)
    moves |= _heirs(cluster, before) & (contradicted <= _MAX_CONTRADICTED * sizes)
    if history.ages_s[0] >= _STOP_AGE_S:
        was_clear, was_hit = (np.bincount(of_new, one[0], clusters) for one in (is_clear, is_hit))
        moves &= (was_clear > 0) | (was_hit == 0)
    moves[0] = False
    return _complete(centers_m, columns, moves[cluster], history.persisted)


def _heirs(cluster: Int, before: BodiesBefore) -> Bool:
    """Return which clusters are bodies of the scan before: each the nearest to one, and about as large as it."""
    near, bodies = np.flatnonzero((cluster > 0) & (before.near > 0)), len(before.sizes)
    pairs, counts = np.unique(cluster[near] * bodies + before.near[near], return_counts=True)
    heir, body = np.divmod(pairs[np.argsort(counts, kind="stable")], bodies)
    heir_of: Int = np.zeros(bodies, np.int64)
    heir_of[body] = heir  # the last one, with most voxels near the body, stays
    sizes = np.bincount(cluster)
    ratio = sizes[heir_of] / np.maximum(before.sizes, 1)
    is_heir = np.zeros(len(sizes), bool)
    is_heir[heir_of[(ratio >= _SAME_RATIO) & (ratio <= 1 / _SAME_RATIO)]] = True
    return is_heir


def _static_weight(history: VisibilityHistory) -> float:
    """Return the weight of a persisting voxel against one that appeared, and the share of voxels that must appear.

    While the history is short a pedestrian still overlaps his earlier place, and only his front has appeared.
    """
    return min(1.0, float(history.ages_s[-1]) / _CLEAR_AGE_S)


@dataclass(frozen=True)
class VoxelColumns:
    """The vertical columns over the ground plane of V voxels; each has one state (5.3).

    Attributes:
        of: (V,) the column of each voxel.
        extent: (4,) first row and column of the rectangle around them, and its numbers of rows and columns.
    """

    of: Int
    extent: Int

    @classmethod
    def over(cls, centers_m: Float) -> "VoxelColumns":
        """Return the columns of (V, 3) voxels, at least one."""
        return cls(*columns_of(np.ascontiguousarray(centers_m, np.float32), _CELL_M))

    @cached_property
    def occupied(self) -> Int:
        """(V,) cluster of each voxel, from 1: columns are joined with their eight neighbours."""
        _, _, rows, columns = self.extent.tolist()
        image = np.zeros(rows * columns, np.uint8)
        image[self.of] = 1
        return _components(image.reshape(rows, columns))[self.of].astype(np.int64)

    def join(self, persisted: Bool, gap_rad: float, static_weight: float) -> Int:
        """Return the (V,) cluster of each voxel, 0 in columns that mostly persisted.

        Columns are joined with their eight neighbours, and within that angle over those in which nothing persisted: a
        passing car is not one with the parked car beside it.
        """
        chosen, image = joinable_columns(
            self.of, np.ascontiguousarray(persisted), self.extent, static_weight, gap_rad
        )
        return np.where(chosen[self.of], _components(image)[self.of], 0).astype(np.int64)


def _components(image: UInt8) -> Int:
    """Return the flat number of the part of an image that each pixel is in, 0 outside of all."""
    _, labels = cv2.connectedComponents(image, connectivity=8)
    return np.asarray(labels.ravel(), np.int32)


def _complete(centers_m: Float, columns: VoxelColumns, moves: Bool, was_always_hit: Bool) -> Bool:
    """Extend motion to the whole object where much of it moves: the side of a slow car fills the place it filled before.

    What moves and is short is a person, who reaches little farther: the bush that he passes lies beyond, and the post
    that he touches was hit in every queried scan.
    """
    whole = columns.occupied
    sizes = np.bincount(whole)
    share = count_in_groups(whole, moves, len(sizes)) / np.maximum(sizes, 1)
    completed = moves.copy()
    for number in np.flatnonzero((share >= _SAME_RATIO) & (share < 1)):
        rows = np.flatnonzero(whole == number)
        outline = _Rectangle.around(centers_m[rows[moves[rows]], :2])
        is_person = 2 * outline.half_m.max() < _VEHICLE_LENGTH_M
        reach_m = _CELL_M if is_person else np.inf
        is_part = outline.contains(centers_m[rows, :2], reach_m)
        completed[rows] |= is_part & ~(was_always_hit[rows] & is_person)
    return completed


@dataclass(frozen=True)
class _Rectangle:
    """The smallest rectangle around places on the ground plane, as its middle, its two axes and half their lengths."""

    middle_m: Float64
    axes: Float64
    half_m: Float64

    @classmethod
    def around(cls, places_m: Float) -> "_Rectangle":
        middle_m, sides_m, angle_deg = cv2.minAreaRect(places_m.astype(np.float32))
        cos, sin = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
        return cls(np.array(middle_m), np.array([[cos, sin], [-sin, cos]]), np.array(sides_m) / 2)

    def contains(self, places_m: Float, margin_m: float) -> Bool:
        """Return which (P, 2) places lie within the margin around the rectangle."""
        away_m = np.abs((places_m - self.middle_m) @ self.axes.T) - self.half_m
        return np.asarray((away_m <= margin_m).all(axis=1))


def _departures(cluster: Int, clusters: int, history: VisibilityHistory) -> tuple[Int, Int]:
    """Return how many voxels of each cluster tell that the departed object before it is its own back, and how many not.

    An object that drives away occluded its present place from its earlier one: the gap shrinks to nothing when its
    path is extrapolated to now, but for what it sped up. An object that appears behind a passer-by keeps some
    distance to him, even where several sides of his occluded it in turn. Where the gap of then was far too large,
    something else was in the way, nearer to the sensor, and tells nothing.
    """
    young_s, *older_s = history.ages_s.tolist()
    behind = np.flatnonzero(history.uncovered & (history.states[0] == Visibility.UNCOVERED))
    cluster, gap_m = cluster[behind], history.gaps_m[0, behind]
    was_behind, comes, keeps_away = np.zeros((3, len(behind)), bool)
    for row, old_s in enumerate(older_s, start=1):
        if old_s == young_s:
            continue
        behind_twice = history.states[row, behind] == Visibility.UNCOVERED
        gap_now_m = (old_s * gap_m - young_s * history.gaps_m[row, behind]) / (old_s - young_s)
        # Errors of both gaps, and what an object that speeds up falls short of its steady path.
        error_m = MARGIN_M * (old_s + young_s) / (old_s - young_s)
        limit_m = error_m + young_s * old_s / 2 * _ACCELERATION_M_S2
        limit_m = np.minimum(_SAME_RATIO * gap_m, min(limit_m, _NEAR_M))
        was_behind |= behind_twice
        comes |= behind_twice & (gap_now_m >= -_NEAR_M) & (gap_now_m <= limit_m)
        keeps_away |= behind_twice & (gap_now_m > limit_m)
    comes = np.where(was_behind, comes & ~keeps_away, gap_m < _NEAR_M)
    # One observation can only confirm: the gap may still be shrinking.
    came, kept_away = (np.bincount(cluster, one, clusters) for one in (comes, keeps_away))
    return came, kept_away
