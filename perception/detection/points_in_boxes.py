"""What stands on the ground where boxes in the image look, and how high the ground is there."""

from dataclasses import dataclass

import numpy as np

from perception.detection.height_cells import HeightCells
from perception.geometry.camera import project
from perception.maps.projection import may_be_in_view
from perception.types import Bool, Calibration, Float32, Float64, GroundModel, Int


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
class PointsInBoxes:
    """K points of a scan that stand on the ground around boxes in the image.

    Attributes:
        rows: (K,) where they are in the scan.
        xyz_m: (K, 3) in the LiDAR frame.
        pixels: (K, 2) column and row.
        depths_m: (K,) along the optical axis.
        ground_m: (K,) z of the ground below.
    """

    rows: Int
    xyz_m: Float64
    pixels: Float64
    depths_m: Float64
    ground_m: Float64


def find_points_in_boxes(
    points_velo: Float32,
    boxes_px: Float64,
    camera: tuple[Calibration, tuple[int, int]],
    ground: GroundModel | None,
    rules: PointRules,
) -> PointsInBoxes:
    """Find what stands on the ground in (M, 4) boxes, and how high the ground is there."""
    image_P_velo, size_px = camera[0].image_P_velo, camera[1]
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
    return PointsInBoxes(rows[kept], xyz_m[kept], pixels[kept], depths_m[kept], ground_m[kept])


def _is_around(pixels: Float64, boxes_px: Float64, size_px: tuple[int, int]) -> Bool:
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
