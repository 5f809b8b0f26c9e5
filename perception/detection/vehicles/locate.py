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
        boxes=_boxes(found, boxes_px, camera, config.fit),
        distances_m=np.where(np.isfinite(distances_m), distances_m, np.nan),
        velocities_m_s=np.full((count, 2), np.nan),
        covariances=np.full((count, 4, 4), np.nan),
        owners=owners,
    )


def _boxes(
    found: VehiclePoints,
    boxes_px: Float64,
    camera: tuple[Calibration, tuple[int, int]],
    config: LShapeFitConfig,
) -> Boxes3D:
    """Return (M) boxes; rows of NaN where there are not enough points."""
    count = len(boxes_px)
    bottom_m, size_m = np.full((count, 3), np.nan), np.full((count, 3), np.nan)
    yaw_rad = np.full(count, np.nan)
    counts = np.bincount(found.owners, minlength=count)
    shown = np.flatnonzero(counts >= config.min_points)
    if len(shown):
        order, owners = _of_vehicles(found.owners, shown, count)
        xyz_m, starts = found.xyz_m[order], np.searchsorted(owners, np.arange(len(shown)))
        ground_m = np.add.reduceat(found.ground_m[order], starts) / counts[shown]
        top_m = np.maximum.reduceat(xyz_m[:, 2], starts)
        heights_m = np.maximum(top_m - ground_m, config.min_height_m)
        calibration, size_px = camera
        spans = ImageSpans(
            boxes_px[shown][:, [0, 2]],
            calibration.image_P_velo,
            size_px[0],
            ground_m + heights_m / 2,
        )
        rectangles = fit_rectangles(xyz_m[:, :2], owners, spans, config)
        bottom_m[shown] = np.column_stack([rectangles.centers_m, ground_m])
        size_m[shown] = np.column_stack([rectangles.sizes_m, heights_m])
        yaw_rad[shown] = wrap(rectangles.yaw_rad, np.pi)
    return Boxes3D(bottom_m, size_m, yaw_rad)


def _of_vehicles(owners: Int, shown: Int, count: int) -> tuple[Int, Int]:
    """Return the points of some vehicles, vehicle after vehicle, and their owners counted from 0."""
    number = np.full(count, -1)
    number[shown] = np.arange(len(shown))
    order = np.flatnonzero(number[owners] >= 0)
    order = order[np.argsort(number[owners[order]], kind="stable")]
    return order, number[owners[order]]
