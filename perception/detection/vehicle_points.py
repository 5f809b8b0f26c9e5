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
from perception.detection.height_cells import HeightCells
from perception.geometry.camera import project
from perception.maps.projection import may_be_in_view
from perception.types import Calibration, Float32, Float64, GroundModel, Int


@dataclass(frozen=True)
class PointRules:
    """What tells the points of a vehicle.

    Attributes:
        farthest_m: beyond it along an axis no point is looked at.
        cell_m: edge of the cells in which the lowest point is looked for.
        reach_m: how far around; under a car some ground is seen from one side or the other.
        clearance_m: over the ground, from which on a point stands on it.
        highest_m: over the ground, of lorries and buses.
        model_error_m: by which the lowest point around may miss a ground model that is true there.
        model_reach_m: from the LiDAR, beyond which a ground model knows no better than the scan.
        height_m: of a common car.
        nearer: standard deviation of the logarithm of depth over the depth at which a box would hold a
            common car, for nearer ones: small cars, and boxes that are drawn too high.
        farther: the same for farther ones: vans and lorries.
        cut_off: the same for nearer ones where the image's border cuts the box.
        centrality: standard deviation of how far from the middle of a box, 1 at its sides, its points lie.
        gap_m: between two points of one vehicle, seen from above, close to the sensor.
        gap_per_m: by which the gap grows with distance, as beams spread.
        samples: points of a box that are clustered, evenly picked of more.
    """

    farthest_m: float = 100.0
    cell_m: float = 0.5
    reach_m: float = 1.5
    clearance_m: float = 0.2
    highest_m: float = 3.5
    model_error_m: float = 0.3
    model_reach_m: float = 30.0
    height_m: float = 1.5
    nearer: float = 0.25
    farther: float = 0.5
    cut_off: float = 1.0
    centrality: float = 0.5
    gap_m: float = 0.4
    gap_per_m: float = 0.012
    samples: int = 256


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


@dataclass(frozen=True)
class _Standing:
    """Points that stand on the ground around the boxes."""

    rows: Int
    xyz_m: Float64
    pixels: Float64
    depths_m: Float64
    ground_m: Float64


def find_points(
    points_velo: Float32,
    boxes_px: Float64,
    camera: tuple[Calibration, tuple[int, int]],
    ground: GroundModel | None,
    rules: PointRules = PointRules(),
) -> VehiclePoints:
    """Find the points of the vehicles in (M, 4) boxes.

    Args:
        points_velo: (N, 4) the scan.
        boxes_px: x1 y1 x2 y2.
        camera: its calibration, and (width, height) of its image.
        ground: the ground below, or None: then what is lowest around is the ground.
        rules: every choice.
    """
    calibration, size_px = camera
    near = _standing(points_velo, boxes_px, calibration.image_P_velo, size_px, ground, rules)
    claims = _Claims.of(near, boxes_px, rules)
    likely = _likelihoods(near, boxes_px, claims, camera, rules)
    claimed = np.bincount(claims.some_points, likely, len(near.rows))[claims.some_points]
    say = np.divide(likely**2, claimed, out=np.zeros(len(likely)), where=likely > 0)
    # What hides a vehicle may be the best cluster in the boxes of both. It is the vehicle whose box it fills
    # more; the other one is in what is left.
    first = claims.owners(say, near.pixels, boxes_px)[claims.some_points]
    is_left = (first < 0) | (first == claims.some_boxes)
    owners = claims.owners(say * is_left, near.pixels, boxes_px)
    kept = np.flatnonzero(owners >= 0)
    return VehiclePoints(near.rows[kept], owners[kept], near.xyz_m[kept], near.ground_m[kept])


def _standing(
    points_velo: Float32,
    boxes_px: Float64,
    image_P_velo: Float64,
    size_px: tuple[int, int],
    ground: GroundModel | None,
    rules: PointRules,
) -> _Standing:
    """Find what stands on the ground in the boxes, and how high the ground is there."""
    rows = np.flatnonzero(may_be_in_view(points_velo, image_P_velo, size_px))
    rows = rows[(np.abs(points_velo[rows, :2]) <= rules.farthest_m).all(axis=1)]
    pixels, depths_m = project(image_P_velo, points_velo[rows])
    around = np.flatnonzero((depths_m > 0) & _is_around(pixels, boxes_px, size_px))
    rows, pixels, depths_m = rows[around], pixels[around], depths_m[around]
    xyz_m = points_velo[rows, :3].astype(np.float64)
    cells = HeightCells.of(xyz_m, rules.cell_m)
    lowest_m = cells.lowest_m(rules.reach_m)
    ground_m = lowest_m
    if ground is not None and len(rows):
        model_m = ground.height_m(xyz_m[:, :2])
        # A model goes on beyond what it was fitted to, but does not hold there.
        is_near = np.hypot(xyz_m[:, 0], xyz_m[:, 1]) <= rules.model_reach_m
        holds = is_near & (np.abs(model_m - lowest_m) < rules.model_error_m)
        ground_m = np.where(holds, model_m, lowest_m)
    over_m = xyz_m[:, 2] - np.maximum(ground_m, lowest_m)
    kept = np.flatnonzero((over_m >= rules.clearance_m) & (over_m <= rules.highest_m))
    return _Standing(rows[kept], xyz_m[kept], pixels[kept], depths_m[kept], ground_m[kept])


def _is_around(pixels: Float64, boxes_px: Float64, size_px: tuple[int, int]) -> np.ndarray:
    """Tell which pixels lie in a box, or as far below one as the ground before it shows."""
    width, height = size_px
    is_near = np.zeros((height + 2, width + 2), bool)
    heights = boxes_px[:, 3] - boxes_px[:, 1]
    grown = boxes_px + np.column_stack([0 * heights, 0 * heights, 0 * heights, heights / 3])
    last_px = np.array([width, height, width, height])
    for x1, y1, x2, y2 in np.clip(grown, 0, last_px).astype(np.int64).tolist():
        is_near[y1 : y2 + 2, x1 : x2 + 2] = True
    columns, rows = np.clip(np.nan_to_num(pixels, nan=-1), 0, size_px).astype(np.int64).T
    return np.asarray(is_near[rows, columns])


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
    def of(cls, near: _Standing, boxes_px: Float64, rules: PointRules) -> Self:
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

    def owners(self, say: Float64, pixels: Float64, boxes_px: Float64) -> Int:
        """Return the box that each point belongs to by (S,) says, or -1.

        To a box belongs what lies, from above, within its cluster of the greatest say.
        """
        best = self.some[_is_best(self.labels, self.some_boxes, say)]
        low_m, high_m = _extents(self.places_m[best], self.box[best], len(boxes_px))
        is_within = (self.places_m >= low_m[self.box]) & (self.places_m <= high_m[self.box])
        own = np.flatnonzero(is_within.all(axis=1))
        box, point = self.box[own], self.point[own]
        low_px, high_px = _extents(pixels[point], box, len(boxes_px))
        sizes_px = np.maximum(boxes_px[:, 2:] - boxes_px[:, :2], 1.0)
        filled = (np.where(low_px < high_px, high_px - low_px, 0.0) / sizes_px).prod(axis=1)
        # Of what is written to one place, the last stays: the box that is filled best.
        order = np.argsort(filled[box], kind="stable")
        owners = np.full(len(pixels), -1)
        owners[point[order]] = box[order]
        return owners


def _likelihoods(
    near: _Standing,
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


def _is_best(labels: Int, box: Int, say: Float64) -> np.ndarray:
    """Tell which pairs are of the cluster that has the greatest say in their box, if any has one."""
    if len(labels) == 0:
        return np.zeros(0, bool)
    says = np.bincount(labels, say)
    most = np.zeros(int(box.max()) + 1)
    np.maximum.at(most, box, says[labels])
    return np.asarray((says[labels] >= most[box]) & (say > 0))
