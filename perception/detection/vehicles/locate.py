"""Location of detections in the scan: the points, the distance and the box of each vehicle."""

from dataclasses import replace

import numpy as np

from perception.detection.vehicles.config import LShapeFitConfig, VehicleConfig
from perception.detection.vehicles.l_shape_fit import ImageSpans, fit_rectangles
from perception.detection.vehicles.vehicle_points import VehiclePoints, find_points
from perception.geometry.se3 import wrap
from perception.maps.projection import camera_of
from perception.types import (
    Boxes3D,
    Calibration,
    Detections,
    Float64,
    Frame,
    FusedDetections,
    GroundModel,
    Int,
    Vehicles,
)


def locate(
    fused: FusedDetections,
    frame: Frame,
    ground: GroundModel | None,
    config: VehicleConfig | None = None,
) -> Vehicles:
    """Locate each detection in the scan.

    Headings are known except for their sign, and lie within half a turn; a tracker adds ids and velocities.
    Detections below the minimum score are not located: a detector may report a hundred of them a frame, and their
    time would be lost for the others.

    Args:
        fused: M detections.
        frame: Frame of the detections.
        ground: Ground model; None takes the lowest points around a vehicle for its ground.
        config: Points, boxes and minimum score.
    """
    config, camera, count = config or VehicleConfig(), camera_of(frame), len(fused)
    boxes_px = fused.detections.boxes_px
    likely = np.flatnonzero(fused.detections.scores >= config.tracker.low_score)
    found = find_points(frame.points_velo, boxes_px[likely], camera, ground, config.points)
    found = replace(found, owners=likely[found.owners])
    owners = np.full(len(frame.points_velo), -1)
    owners[found.rows] = found.owners
    distances_m = np.full(count, np.inf)
    x_m, y_m, z_m = found.xyz_m.T
    np.minimum.at(distances_m, found.owners, np.sqrt(x_m**2 + y_m**2 + z_m**2))
    return Vehicles(
        fused=fused,
        ids=np.full(count, -1),
        boxes=_boxes(found, fused.detections, camera, config.fit),
        distances_m=np.where(np.isfinite(distances_m), distances_m, np.nan),
        velocities_m_s=np.full((count, 2), np.nan),
        covariances=np.full((count, 4, 4), np.nan),
        owners=owners,
    )


def _boxes(
    found: VehiclePoints,
    detections: Detections,
    camera: tuple[Calibration, tuple[int, int]],
    config: LShapeFitConfig,
) -> Boxes3D:
    """Return (M) boxes, each of the size of its class; rows of NaN where there are not enough points."""
    count = len(detections)
    boxes = Boxes3D(
        np.full((count, 3), np.nan), np.full((count, 3), np.nan), np.full(count, np.nan)
    )
    is_shown = np.bincount(found.owners, minlength=count) >= config.min_points
    for name in sorted(set(detections.types[is_shown].tolist())):
        rows = np.flatnonzero(is_shown & (detections.types == name))
        columns_px = detections.boxes_px[rows][:, [0, 2]]
        fitted = _fitted_boxes(found, rows, columns_px, camera, config.for_class(name))
        boxes = boxes.replaced(rows, fitted)
    return boxes


def _fitted_boxes(
    found: VehiclePoints,
    shown: Int,
    columns_px: Float64,
    camera: tuple[Calibration, tuple[int, int]],
    config: LShapeFitConfig,
) -> Boxes3D:
    """Return (F) boxes of some vehicles, at least one, from their points and (F, 2) columns in the image."""
    calibration, size_px = camera
    order, owners = _of_vehicles(found.owners, shown)
    xyz_m, starts = found.xyz_m[order], np.searchsorted(owners, np.arange(len(shown)))
    ground_m = np.add.reduceat(found.ground_m[order], starts) / np.bincount(owners)
    heights_m = np.maximum(np.maximum.reduceat(xyz_m[:, 2], starts) - ground_m, config.min_height_m)
    middles_m = ground_m + heights_m / 2
    spans = ImageSpans(columns_px, calibration.image_P_velo, size_px[0], middles_m)
    rectangles = fit_rectangles(xyz_m[:, :2], owners, spans, config)
    return Boxes3D(
        np.column_stack([rectangles.centers_m, ground_m]),
        np.column_stack([rectangles.sizes_m, heights_m]),
        wrap(rectangles.yaw_rad, np.pi),
    )


def _of_vehicles(owners: Int, shown: Int) -> tuple[Int, Int]:
    """Return the points of some vehicles, vehicle after vehicle, and their owners counted from 0."""
    number = np.full(owners.max() + 1, -1)
    number[shown] = np.arange(len(shown))
    order = np.flatnonzero(number[owners] >= 0)
    order = order[np.argsort(number[owners[order]], kind="stable")]
    return order, number[owners[order]]
