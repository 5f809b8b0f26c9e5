"""Joining of the detections of several cameras: an object that two of them see is one vehicle.

Cameras beside each other overlap at the borders of their images, where each shows a part of an object. The returns of
the LiDAR tell whether both parts are of one object; the camera that shows more of it, more surely, keeps it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from perception.detection.vehicles.config import VehicleConfig
from perception.geometry.box_overlap import center_distances_m, paired_iou_bev
from perception.geometry.box_overlap_px import iou_px
from perception.geometry.camera import box_outlines_px
from perception.maps.projection import camera_of
from perception.tracking.vehicles.class_sizes import SizePriors
from perception.tracking.vehicles.duplicates import find_leaders
from perception.tracking.vehicles.observations import ASSUMED_HEIGHT_M, FrameGeometry
from perception.types import Bool, Boxes3D, Float64, Frame, Int, Vehicles

_MIN_SHARED = 0.5  # minimum share of the returns of the one that has fewer which both have
_MIN_IOU = 0.2  # minimum IoU of both boxes on the ground, unless they share returns
_MIN_IOU_PX = 0.4  # minimum IoU in one image, to which the one without a box on the ground is moved


def join_cameras(
    located: Mapping[int, Vehicles],
    frame: Frame,
    min_existence: float = VehicleConfig.min_existence,
) -> Vehicles:
    """Return the vehicles of all cameras, each once, with the detection of the camera that shows it better.

    Detections below the minimum score, which are not located, are not joined either.

    Args:
        located: Located detections in at least one camera of the frame, by its number.
        frame: Frame of the detections.
        min_existence: Minimum existence of a detection that is joined.
    """
    if not located:
        return Vehicles.empty(len(frame.points_velo))
    if located.keys() == {0}:
        return located[0]
    vehicles, owners = _concatenated(located)
    cameras = [
        FrameGeometry(frame.stamp_s, np.eye(4), calibration.image_P_velo, size_px)
        for calibration, size_px in map(camera_of, frame.views)
    ]
    is_same = _share_returns(owners, len(vehicles))
    likely = np.flatnonzero(vehicles.fused.existence >= min_existence)
    is_same[np.ix_(likely, likely)] |= _overlap(vehicles.select(likely), cameras)
    is_same &= vehicles.cameras[:, None] != vehicles.cameras
    has_sides = SizePriors.of(vehicles.fused.detections.types).has_sides
    is_same &= has_sides[:, None] == has_sides  # a person may stand in front of a car
    quality = vehicles.fused.existence * _visible_shares(vehicles, cameras)
    leaders = find_leaders(is_same, quality)
    distances_m = np.full(len(vehicles), np.inf)
    np.fmin.at(distances_m, leaders, vehicles.distances_m)
    joined = replace(
        vehicles,
        distances_m=np.where(np.isfinite(distances_m), distances_m, np.nan),
        owners=_merged_owners(owners, leaders, quality),
    )
    kept = np.flatnonzero(leaders == np.arange(len(leaders)))
    best_first = np.argsort(-vehicles.fused.detections.scores[kept], kind="stable")
    return joined.select(kept[best_first])


def _concatenated(located: Mapping[int, Vehicles]) -> tuple[Vehicles, Int]:
    """Return all M vehicles with their cameras, and (C, N) the vehicle of each point by each of the cameras."""
    parts = [replace(part, cameras=np.full(len(part), camera)) for camera, part in located.items()]
    starts = np.cumsum([0, *(len(part) for part in parts[:-1])])
    owners = np.array([part.owners for part in parts], np.int64)
    owners[owners >= 0] += starts.repeat((owners >= 0).sum(axis=1))
    return Vehicles.concatenate(parts, owners[0]), owners


def _share_returns(owners: Int, count: int) -> Bool:
    """Return (M, M) whether two vehicles have most returns of one of them in common."""
    shared = np.zeros((count, count), np.int64)
    claimed = owners[:, (owners >= 0).sum(axis=0) > 1]  # few points are in two images
    for first, second in combinations(claimed, 2):
        both = np.flatnonzero((first >= 0) & (second >= 0))
        np.add.at(shared, (first[both], second[both]), 1)
    shared += shared.T
    counts = np.bincount(owners[owners >= 0], minlength=count)
    fewer = np.minimum(counts[:, None], counts)
    return np.asarray((fewer > 0) & (shared >= _MIN_SHARED * fewer))


def _overlap(vehicles: Vehicles, cameras: Sequence[FrameGeometry]) -> Bool:
    """Return (M, M) whether two vehicles overlap on the ground, or in an image where one has no place there."""
    numbers, boxes = vehicles.cameras, vehicles.boxes
    boxes_px = vehicles.fused.detections.boxes_px
    is_located = np.asarray(np.isfinite(boxes.yaw_rad))
    is_same = np.zeros((len(vehicles), len(vehicles)), bool)
    located = np.flatnonzero(is_located)
    first, second = (located[one] for one in _near_pairs(boxes[located]))
    is_same[first, second] = paired_iou_bev(boxes[first], boxes[second]) >= _MIN_IOU
    corners_velo = _corners_velo(vehicles, cameras)
    for number in np.unique(numbers).tolist():
        others, rows = np.flatnonzero(numbers == number), np.flatnonzero(numbers != number)
        if is_located.all() or not len(rows):
            break
        camera = cameras[number]
        moved_px = _moved_px(corners_velo[:, rows], camera)
        outlines_px = box_outlines_px(camera.image_P_velo, boxes[rows], camera.image_size_px)
        seen_px = np.where(is_located[rows, None], outlines_px, moved_px)
        in_image = iou_px(np.nan_to_num(seen_px), boxes_px[others]) >= _MIN_IOU_PX
        in_image &= ~(is_located[rows, None] & is_located[others])
        is_same[np.ix_(rows, others)] |= in_image
    return is_same | is_same.T


def _near_pairs(boxes: Boxes3D) -> tuple[Int, Int]:
    """Return the rows of the pairs of boxes that may touch."""
    reach_m = np.linalg.norm(boxes.size_m[:, :2], axis=1).max(initial=0.0)
    first, second = np.nonzero(np.triu(center_distances_m(boxes, boxes) <= reach_m, 1))
    return first, second


def _corners_velo(vehicles: Vehicles, cameras: Sequence[FrameGeometry]) -> Float64:
    """Return (4, M, 3) where the corners of boxes in the images are, of objects of the assumed height."""
    boxes_px = vehicles.fused.detections.boxes_px
    heights_px = np.maximum(boxes_px[:, 3] - boxes_px[:, 1], 1.0)
    corners = np.empty((4, len(vehicles), 3))
    for number in np.unique(vehicles.cameras).tolist():
        rows, camera = np.flatnonzero(vehicles.cameras == number), cameras[number]
        depths_m = camera.focal_px * ASSUMED_HEIGHT_M / heights_px[rows]
        places = ([column, row] for column in (0, 2) for row in (1, 3))
        for corner, place in zip(corners, places, strict=True):
            corner[rows] = camera.unproject(boxes_px[rows][:, place], depths_m)
    return corners


def _moved_px(corners_velo: Float64, other: FrameGeometry) -> Float64:
    """Return (M, 4) boxes around (4, M, 3) corners in the image of a camera; NaN behind it."""
    moved = np.stack([other.project(corner) for corner in corners_velo])
    return other.clip(np.hstack([moved[..., :2].min(axis=0), moved[..., :2].max(axis=0)]))


def _visible_shares(vehicles: Vehicles, cameras: Sequence[FrameGeometry]) -> Float64:
    """Return (M,) the share of the outline of each 3D box that is within its image; 1 without a box."""
    shares = np.ones(len(vehicles))
    for camera, geometry in enumerate(cameras):
        rows = np.flatnonzero(vehicles.cameras == camera)
        whole_px, cut_px = (
            box_outlines_px(geometry.image_P_velo, vehicles.boxes[rows], size_px)
            for size_px in (None, geometry.image_size_px)
        )
        whole, cut = (np.prod(one[:, 2:] - one[:, :2], axis=1) for one in (whole_px, cut_px))
        shares[rows] = np.nan_to_num(cut / whole, nan=1.0)
    return shares


def _merged_owners(owners: Int, leaders: Int, quality: Float64) -> Int:
    """Return (N,) the vehicle of each point, of several the best."""
    merged = np.full(owners.shape[1], -1)
    best = np.full(owners.shape[1], -np.inf)
    for of_camera in owners:
        rows = np.flatnonzero(of_camera >= 0)
        vehicle = leaders[of_camera[rows]]
        is_better = quality[vehicle] > best[rows]
        rows, vehicle = rows[is_better], vehicle[is_better]
        merged[rows], best[rows] = vehicle, quality[vehicle]
    return merged
