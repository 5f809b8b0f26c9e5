"""Which points of a scan belong to which detected vehicle: not the ground, nor what is seen before or behind it.

Every return covers about the same part of the image, so that what a box was drawn around holds most of the
returns about its middle. Within each box the points that stand on the ground are clustered from above; each
has a say by how central it lies, by whether a vehicle there would be as high as the box, and by how few
other boxes claim it. The cluster of the greatest say is the vehicle.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from perception.detection.clustering import cluster
from perception.detection.points_in_boxes import PointRules, PointsInBoxes, find_points_in_boxes
from perception.types import Bool, Calibration, Float32, Float64, GroundModel, Int


@dataclass(frozen=True)
class VehiclePoints:
    """K points of M vehicles.

    Attributes:
        rows: (K,) where they are in the scan.
        owners: (K,) whose they are, from 0 to M - 1.
        xyz_m: (K, 3) in the LiDAR frame.
        ground_m: (K,) z of the ground below.
    """

    rows: Int
    owners: Int
    xyz_m: Float64
    ground_m: Float64


def find_points(
    points_velo: Float32,
    boxes_px: Float64,
    camera: tuple[Calibration, tuple[int, int]],
    ground: GroundModel | None,
    rules: PointRules,
) -> VehiclePoints:
    """Find the points of the vehicles in (M, 4) boxes.

    Args:
        points_velo: (N, 4) the scan.
        boxes_px: x1 y1 x2 y2.
        camera: its calibration, and (width, height) of its image.
        ground: the ground below, or None: then what is lowest around is the ground.
        rules: every choice.
    """
    near = find_points_in_boxes(points_velo, boxes_px, camera, ground, rules)
    claims = _Claims.of(near, boxes_px, rules)
    likely = _likelihoods(near, boxes_px, claims, camera, rules)
    claimed = np.bincount(claims.some_points, likely, len(near.rows))[claims.some_points]
    say = np.divide(likely**2, claimed, out=np.zeros(len(likely)), where=likely > 0)
    # What hides a vehicle may be the best cluster in the boxes of both. It is the vehicle in whose box it is
    # the likelier; the other one is in what is left.
    first = claims.owners(say, likely, len(near.rows), len(boxes_px))[claims.some_points]
    is_left = (first < 0) | (first == claims.some_boxes)
    owners = claims.owners(say * is_left, likely, len(near.rows), len(boxes_px))
    kept = np.flatnonzero(owners >= 0)
    return VehiclePoints(near.rows[kept], owners[kept], near.xyz_m[kept], near.ground_m[kept])


@dataclass(frozen=True)
class _Claims:
    """L pairs of a box and a point in it, box after box, of which S are clustered.

    Attributes:
        box: (L,).
        point: (L,).
        places_m: (L, 2) along the line of sight to the box, and to the left of it.
        some: (S,) rows of pairs.
        labels: (S,) their clusters; no two boxes have one in common.
    """

    box: Int
    point: Int
    places_m: Float64
    some: Int
    labels: Int

    @classmethod
    def of(cls, near: PointsInBoxes, boxes_px: Float64, rules: PointRules) -> Self:
        """Pair boxes with points, and cluster those of each box."""
        u, v = near.pixels[:, 0], near.pixels[:, 1]
        x1, y1, x2, y2 = boxes_px.T[:, :, None]
        box, point = np.nonzero((u >= x1) & (u <= x2) & (v >= y1) & (v <= y2))
        places_m = _along_sight(near.xyz_m[point, :2], box, len(boxes_px))
        some = _some_of_each(box, rules.samples)
        labels = _clusters(places_m[some], box[some], len(boxes_px), rules)
        return cls(box, point, places_m, some, labels)

    @property
    def some_boxes(self) -> Int:
        """(S,)."""
        return self.box[self.some]

    @property
    def some_points(self) -> Int:
        """(S,)."""
        return self.point[self.some]

    def owners(self, say: Float64, likely: Float64, points: int, boxes: int) -> Int:
        """Return (points,) the box that each belongs to by (S,) says and likelihoods, or -1.

        To a box belongs what lies, from above, within its cluster of the greatest say.
        """
        is_best = _is_best(self.labels, self.some_boxes, say)
        best, best_boxes = self.some[is_best], self.some_boxes[is_best]
        low_m, high_m = _extents(self.places_m[best], best_boxes, boxes)
        counts = np.bincount(best_boxes, minlength=boxes)
        likelihoods = np.bincount(best_boxes, likely[is_best], boxes) / np.maximum(counts, 1)
        is_within = (self.places_m >= low_m[self.box]) & (self.places_m <= high_m[self.box])
        own = np.flatnonzero(is_within.all(axis=1))
        # Of what is written to one place, the last stays: the box whose cluster is the likeliest.
        own = own[np.argsort(likelihoods[self.box[own]], kind="stable")]
        owners = np.full(points, -1)
        owners[self.point[own]] = self.box[own]
        return owners


def _likelihoods(
    near: PointsInBoxes,
    boxes_px: Float64,
    claims: _Claims,
    camera: tuple[Calibration, tuple[int, int]],
    rules: PointRules,
) -> Float64:
    """Return (S,) how much it looks as if each point were of the vehicle of the box, from 0 to 1."""
    (calibration, size_px), box, point = camera, claims.some_boxes, claims.some_points
    middles = (boxes_px[:, :2] + boxes_px[:, 2:]) / 2
    halves = (boxes_px[:, 2:] - boxes_px[:, :2]) / 2
    off = (near.pixels[point] - middles[box]) / np.maximum(halves[box], 0.5)
    off_center = (off**2).sum(axis=1) / rules.centrality**2
    focal_px = float(calibration.image_P_cam[1, 1])
    expected_m = focal_px * rules.height_m / np.maximum(2 * halves[:, 1], 1.0)
    is_cut = (boxes_px[:, 1] <= 1) | (boxes_px[:, 3] >= size_px[1] - 2)
    ratio = np.log(near.depths_m[point] / expected_m[box])
    nearer = np.where(is_cut, rules.cut_off, rules.nearer)[box]
    deviation = np.where(ratio < 0, nearer, rules.farther)
    return np.asarray(np.exp(-(off_center + (ratio / deviation) ** 2) / 2))


def _along_sight(xy_m: Float64, box: Int, boxes: int) -> Float64:
    """Turn (L, 2) places, box by box, into how far along the line of sight and how far left of it."""
    sums_m = np.column_stack([np.bincount(box, xy_m[:, axis], boxes) for axis in (0, 1)])
    away_m = np.hypot(sums_m[:, 0], sums_m[:, 1])
    cos, sin = (sums_m / np.maximum(away_m, 1e-6)[:, None])[box].T
    x, y = xy_m.T
    return np.column_stack([cos * x + sin * y, cos * y - sin * x])


def _some_of_each(box: Int, most: int) -> Int:
    """Return rows of (L,) rising numbers, evenly picked, so that none is there more often than that."""
    counts = np.bincount(box)
    starts = np.cumsum(counts) - counts
    stride = -(-counts // most)
    return np.flatnonzero((np.arange(len(box)) - starts[box]) % stride[box] == 0)


def _clusters(places_m: Float64, box: Int, boxes: int, rules: PointRules) -> Int:
    """Return (L,) the cluster of each point of each box; boxes have no clusters in common.

    All boxes are clustered at once: each lies in a strip of its own, measured in its own gaps.
    """
    counts = np.maximum(np.bincount(box, minlength=boxes), 1)
    away_m = np.bincount(box, places_m[:, 0], boxes) / counts
    along, left = (places_m / (rules.gap_m + rules.gap_per_m * away_m)[box, None]).T
    low, high = np.zeros(boxes), np.zeros(boxes)
    np.minimum.at(low, box, left)
    np.maximum.at(high, box, left)
    strips = np.cumsum(high - low + 3.0)
    return cluster(np.column_stack([along, left - high[box] + strips[box]]), 1.0, 1)


def _extents(places_m: Float64, box: Int, boxes: int) -> tuple[Float64, Float64]:
    """Return (M, 2) least and greatest place in each box; least above greatest where there is none."""
    low_m, high_m = np.full((boxes, 2), np.inf), np.full((boxes, 2), -np.inf)
    np.minimum.at(low_m, box, places_m)
    np.maximum.at(high_m, box, places_m)
    return low_m, high_m


def _is_best(labels: Int, box: Int, say: Float64) -> Bool:
    """Tell which pairs are of the cluster that has the greatest say in their box, if any has one."""
    if len(labels) == 0:
        return np.zeros(0, bool)
    says = np.bincount(labels, say)
    most = np.zeros(int(box.max()) + 1)
    np.maximum.at(most, box, says[labels])
    return np.asarray((says[labels] >= most[box]) & (say > 0))
