"""Segmentation of the points of detected vehicles: neither the ground nor points in front of or behind them.

Every return covers about the same part of the image, so that the vehicle has most of the returns near the middle of its
box. Within each box the points above the ground are clustered in top view; each point votes by how central it is, by
whether a vehicle at its depth would have the height of the box, and by how few other boxes claim it. The cluster with
the most votes is the vehicle.
"""

from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np

from perception.detection.clustering import expand_ranges
from perception.detection.vehicles.frustum_points import (
    FrustumPoints,
    extend_beyond_borders,
    find_frustum_points,
)
from perception.geometry.box_overlap_px import iou_px
from perception.geometry.sorting import sorted_keys
from perception.kernels.graphs import connected_parts
from perception.tracking.vehicles.class_sizes import SizePriors
from perception.tracking.vehicles.duplicates import find_leaders
from perception.tracking.vehicles.observations import SAME_PLACE_IOU
from perception.types import ArrayTable, Bool, Calibration, Float32, Float64, GroundModel, Int

_MAX_HEIGHT_DEVIATIONS = 4.0  # maximum height above the mean of the class, in its deviations
# Standard deviation of the logarithm of depth, relative to the depth at which an object of the
# class has the height of the box, towards the camera: small objects, and boxes drawn too high.
_NEAR_DEVIATION = 0.2
_FAR_DEVIATION = 0.5  # away from the camera: large objects, and those of another class
_CUT_DEVIATION = 1.0  # towards the camera where the image's border cuts the box
_CENTER_DEVIATION = 0.5  # of the points from the middle of the box, where its sides are at 1
_CLUSTER_GAP_WIDTHS = 0.25  # maximum gap in an object in top view, near the sensor, in its widths
_CLUSTER_GAP_PER_M = 0.012  # increase of that gap with distance, as beams spread
_MAX_SAMPLES = 256  # maximum number of points of a box that vote


@dataclass(frozen=True)
class ImageObjects(ArrayTable):
    """M detected objects, as far as their points depend on them.

    Attributes:
        boxes_px: (M, 4) boxes, x1 y1 x2 y2.
        existence: (M,) probabilities that there is an object.
        sizes: (M) sizes of their classes.
    """

    boxes_px: Annotated[Float64, 4]
    existence: Float64
    sizes: SizePriors

    def leaders(self) -> Int:
        """Return (M,) the likeliest object at the place of each in the image: itself, or one that stands for it.

        A network may report one object as several classes; all of them have the same returns.
        """
        is_same = iou_px(self.boxes_px, self.boxes_px) >= SAME_PLACE_IOU
        return find_leaders(is_same, self.existence)


@dataclass(frozen=True)
class VehiclePoints:
    """K points of M vehicles.

    Attributes:
        rows: (K,) rows of the points in the scan.
        owners: (K,) number of the vehicle of each point, from 0 to M - 1.
        xyz_m: (K, 3) positions in the LiDAR frame.
        ground_m: (K,) z of the ground below.
    """

    rows: Int
    owners: Int
    xyz_m: Float64
    ground_m: Float64

    def shared(self, leaders: Int) -> Self:
        """Return the points of D vehicles, each of which has those of its leader.

        Args:
            leaders: (D,) number of the vehicle of which each has the points.
        """
        order = np.argsort(self.owners, kind="stable")
        counts = np.bincount(self.owners, minlength=int(leaders.max(initial=-1)) + 1)
        starts = counts.cumsum() - counts
        owners, places = expand_ranges(starts[leaders], counts[leaders])
        rows = order[places]
        return type(self)(self.rows[rows], owners, self.xyz_m[rows], self.ground_m[rows])


def find_points(
    points_velo: Float32,
    objects: ImageObjects,
    camera: tuple[Calibration, tuple[int, int]],
    ground: GroundModel | None,
    max_depth_m: float,
) -> VehiclePoints:
    """Return the points of M objects.

    Args:
        points_velo: (N, 4) points of the scan.
        objects: (M) detected objects.
        camera: Calibration, and (width, height) of the image.
        ground: Ground model; None takes the lowest points around for the ground.
        max_depth_m: Maximum depth of a point along the optical axis.
    """
    boxes_px, sizes = objects.boxes_px, objects.sizes
    if not len(objects):
        none = np.zeros(0, np.int64)
        return VehiclePoints(none, none, np.zeros((0, 3)), np.zeros(0))
    reached_px = extend_beyond_borders(boxes_px, camera[1][0])
    near = find_frustum_points(points_velo, reached_px, camera, ground, max_depth_m)
    claims = _Claims.of(near, reached_px, sizes)
    likely = _likelihoods(near, boxes_px, claims, sizes, camera)
    likely *= objects.existence[claims.sampled_boxes]
    claimed = np.bincount(claims.sampled_points, likely, len(near.rows))[claims.sampled_points]
    votes = np.divide(likely**2, claimed, out=np.zeros(len(likely)), where=likely > 0)
    # An occluder may be the best cluster in its own box and in that of the occluded vehicle. It belongs to the box
    # in which it is likelier; the other vehicle is among the remaining points.
    first = claims.owners(votes, likely, len(near.rows), len(boxes_px))[claims.sampled_points]
    is_left = (first < 0) | (first == claims.sampled_boxes)
    owners = claims.owners(votes * is_left, likely, len(near.rows), len(boxes_px))
    kept = np.flatnonzero(owners >= 0)
    return VehiclePoints(near.rows[kept], owners[kept], near.xyz_m[kept], near.ground_m[kept])


@dataclass(frozen=True)
class _Claims:
    """L pairs of a box and a point in it, box after box, of which S vote.

    Attributes:
        box: (L,) number of the box.
        point: (L,) number of the point.
        along_m: (L,) coordinate along the line of sight to the box.
        left_m: (L,) coordinate to the left of it.
        sampled: (S,) rows of the pairs that vote.
        labels: (S,) clusters of these; no two boxes have a cluster in common.
    """

    box: Int
    point: Int
    along_m: Float64
    left_m: Float64
    sampled: Int
    labels: Int

    @classmethod
    def of(cls, near: FrustumPoints, boxes_px: Float64, sizes: SizePriors) -> Self:
        """Pair boxes with points that are no higher than their classes, and cluster those of each box."""
        u, v = np.ascontiguousarray(near.pixels.T)
        x1, y1, x2, y2 = boxes_px.T[:, :, None]
        is_in = (u >= x1) & (u <= x2) & (v >= y1) & (v <= y2)
        heights_m = sizes.height_m @ (1.0, _MAX_HEIGHT_DEVIATIONS)
        is_in &= near.above_m <= heights_m[:, None]
        box, point = np.divmod(np.flatnonzero(is_in), max(len(u), 1))
        along_m, left_m = _along_view_axis(near.xyz_m[:, 0][point], near.xyz_m[:, 1][point], box)
        sampled = _sample_each(box, _MAX_SAMPLES)
        gap_m = _CLUSTER_GAP_WIDTHS * sizes.width_m[:, 0]
        labels = _clusters(along_m[sampled], left_m[sampled], box[sampled], gap_m)
        return cls(box, point, along_m, left_m, sampled, labels)

    @property
    def sampled_boxes(self) -> Int:
        """(S,) boxes of the pairs that vote."""
        return self.box[self.sampled]

    @property
    def sampled_points(self) -> Int:
        """(S,) points of the pairs that vote."""
        return self.point[self.sampled]

    def owners(self, votes: Float64, likely: Float64, points: int, boxes: int) -> Int:
        """Return (points,) the box that each point belongs to by (S,) votes and likelihoods, or -1.

        A box has the points within the extent, in top view, of its cluster with the most votes; points within the
        extents of two boxes belong to the likelier one.
        """
        is_best = _is_best(self.labels, self.sampled_boxes, votes)
        best, best_boxes = self.sampled[is_best], self.sampled_boxes[is_best]
        is_within = np.ones(len(self.box), bool)
        for position_m in (self.along_m, self.left_m):
            low_m, high_m = _extents(position_m[best], best_boxes, boxes)
            is_within &= (position_m >= low_m[self.box]) & (position_m <= high_m[self.box])
        own = np.flatnonzero(is_within)
        counts = np.bincount(best_boxes, minlength=boxes)
        likelihoods = np.bincount(best_boxes, likely[is_best], boxes) / np.maximum(counts, 1)
        by_likelihood = np.argsort(likelihoods, kind="stable")
        ranks = np.empty(boxes, np.int64)
        ranks[by_likelihood] = np.arange(boxes)
        highest = np.full(points, -1)
        np.maximum.at(highest, self.point[own], ranks[self.box[own]])
        return np.asarray(np.append(by_likelihood, -1)[highest])


def _likelihoods(
    near: FrustumPoints,
    boxes_px: Float64,
    claims: _Claims,
    sizes: SizePriors,
    camera: tuple[Calibration, tuple[int, int]],
) -> Float64:
    """Return (S,) the likelihood, 0 to 1, that each point is of the vehicle of its box."""
    (calibration, size_px), box, point = camera, claims.sampled_boxes, claims.sampled_points
    x1, y1, x2, y2 = boxes_px.T
    off_center = np.zeros(len(box))
    for place_px, low_px, high_px in ((near.pixels[:, 0], x1, x2), (near.pixels[:, 1], y1, y2)):
        half_px = np.maximum((high_px - low_px) / 2, 0.5)
        off_center += ((place_px[point] - ((low_px + high_px) / 2)[box]) / half_px[box]) ** 2
    focal_px = float(calibration.image_P_cam[1, 1])
    expected_m = focal_px * sizes.height_m[:, 0] / np.maximum(y2 - y1, 1.0)
    is_cut = (y1 <= 1) | (y2 >= size_px[1] - 2)
    ratio = np.log(near.depths_m[point] / expected_m[box])
    near_deviation = np.where(is_cut, _CUT_DEVIATION, _NEAR_DEVIATION)[box]
    deviation = np.where(ratio < 0, near_deviation, _FAR_DEVIATION)
    return np.asarray(np.exp(-(off_center / _CENTER_DEVIATION**2 + (ratio / deviation) ** 2) / 2))


def _along_view_axis(x_m: Float64, y_m: Float64, box: Int) -> tuple[Float64, Float64]:
    """Return (L,) coordinates along the line of sight to the mean of each box's points, and to the left of it."""
    x_sum_m, y_sum_m = np.bincount(box, x_m), np.bincount(box, y_m)
    away_m = np.maximum(np.hypot(x_sum_m, y_sum_m), 1e-6)
    cos, sin = (x_sum_m / away_m)[box], (y_sum_m / away_m)[box]
    return cos * x_m + sin * y_m, cos * y_m - sin * x_m


def _sample_each(box: Int, max_count: int) -> Int:
    """Return rows of (L,) rising numbers, evenly sampled, so that none occurs more often than a maximum."""
    counts = np.bincount(box)
    starts = np.cumsum(counts) - counts
    stride = -(-counts // max_count)
    return np.flatnonzero((np.arange(len(box)) - starts[box]) % stride[box] == 0)


# Steps from a cell to those whose middles are no more than a gap away, less the offsets of points from the middles;
# in one half of the directions: number of cells along, and range of cells to the left.
_CELLS_PER_GAP = 3
_STEPS = np.array([(0, 1, 2), (1, -2, 2), (2, -1, 1)])


def _clusters(along_m: Float64, left_m: Float64, box: Int, gap_m: Float64) -> Int:
    """Return (L,) the cluster of each point of each box; boxes have no clusters in common.

    Points lie in cells of a fraction of a gap, separate for each box; cells about a gap apart are connected.
    """
    if not len(box):
        return np.zeros(0, np.int64)
    away_m = np.bincount(box, along_m) / np.maximum(np.bincount(box), 1)
    gap_m = gap_m[: len(away_m)] + _CLUSTER_GAP_PER_M * away_m
    cell_m = (gap_m / _CELLS_PER_GAP)[box]
    along = np.floor(along_m / cell_m).astype(np.int64)
    left = np.floor(left_m / cell_m).astype(np.int64)
    along, left = along - along.min(), left - left.min()
    # Empty cells beyond the last one of a row keep a step from leading to another row.
    row = int(left.max()) + 1 + _CELLS_PER_GAP
    keys = (box * (int(along.max()) + 1 + _CELLS_PER_GAP) + along) * row + left
    ordered, order = sorted_keys(keys)
    is_first = np.append(True, ordered[1:] != ordered[:-1])
    cells, cell_of = ordered[is_first], np.empty(len(keys), np.int64)
    cell_of[order] = is_first.cumsum() - 1
    # Cells are numbered row by row, so that all cells that a step leads to are adjacent.
    along, low, high = _STEPS.T[:, :, None]
    starts = np.searchsorted(cells, cells + along * row + low).T.ravel()
    ends = np.searchsorted(cells, cells + along * row + high, side="right").T.ravel()
    step, second = expand_ranges(starts, ends - starts)
    return connected_parts(len(cells), step // len(_STEPS), second)[cell_of]


def _extents(position_m: Float64, box: Int, boxes: int) -> tuple[Float64, Float64]:
    """Return (M,) minimum and maximum coordinate in each box; the minimum is larger where there is none."""
    low_m, high_m = np.full(boxes, np.inf), np.full(boxes, -np.inf)
    np.minimum.at(low_m, box, position_m)
    np.maximum.at(high_m, box, position_m)
    return low_m, high_m


def _is_best(labels: Int, box: Int, votes: Float64) -> Bool:
    """Return whether each pair is of the cluster with the most votes in its box, if there are votes."""
    if len(labels) == 0:
        return np.zeros(0, bool)
    vote_sums = np.bincount(labels, votes)
    most = np.zeros(int(box.max()) + 1)
    np.maximum.at(most, box, vote_sums[labels])
    return np.asarray((vote_sums[labels] >= most[box]) & (votes > 0))
