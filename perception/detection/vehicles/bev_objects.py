"""Objects of the bird's-eye view as vehicles: their points, and the image that shows each."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from perception.detection.bev.boxes import BevDetections
from perception.detection.config import NmsConfig
from perception.geometry.box_overlap_px import area_px
from perception.geometry.camera import box_outlines_px
from perception.kernels.box_owners import owners_in_boxes
from perception.maps.projection import camera_of
from perception.tracking.vehicles.class_sizes import SizePriors
from perception.tracking.vehicles.evidence import log_odds, probability
from perception.types import (
    BoxDeviations,
    Boxes3D,
    Detections,
    Float32,
    Float64,
    Frame,
    FusedDetections,
    Int,
    Vehicles,
)

_CELL_M = 0.2  # edge of the cells by which returns are found in boxes
_MARGIN_M = 0.1  # by which boxes are grown for these
_GROUND_M = 0.15  # above the bottom of a box, below which returns are of the ground
_MIN_VISIBLE_SHARE = 0.3  # minimum share of the outline of a box in an image that shows it
_MIN_POSITION_M, _MIN_SIZE_M, _MIN_AXIS_RAD = 0.1, 0.05, 0.03  # minimum standard deviations
_ANY_AXIS_RAD = np.pi / np.sqrt(12)  # standard deviation of an axis of any direction
LEAST = 1e-3  # smallest probability whose log-odds count
# Log-odds that there is an object: slope over those of its score, and offset; of vehicles and of people and cycles, fitted
# to 140 frames of synthetic streets, of 64 and 32 beams, which agree.
_ODDS = ((2.6, 2.1), (3.0, 1.65))
_MIN_OWNER = 0.2  # minimum probability of an object that has returns, as of one that is tracked


def bev_vehicles(
    found: BevDetections,
    class_names: Sequence[str],
    frame: Frame,
    min_score: float = NmsConfig.min_score,
) -> Vehicles:
    """Return the objects of the bird's-eye view as vehicles, without ids.

    The box of each in the image is the outline of its 3D box in the camera that shows most of it; NaN where none does.

    Args:
        found: M objects in the LiDAR frame, best first.
        class_names: Names of the classes.
        frame: Frame of the scan.
        min_score: Probability below which none is returned.
    """
    types = np.array(class_names, np.str_)[found.classes]
    probable = probabilities(found.scores, types)
    rows = np.flatnonzero(probable >= min_score)
    found, types, probable = found[rows], types[rows], probable[rows]
    count, boxes, points_velo = len(found), found.boxes, frame.points_velo
    likely = np.flatnonzero(probable >= _MIN_OWNER)
    owners = np.append(likely, -1)[owners_of_points(boxes[likely], points_velo)]
    inside = np.flatnonzero(owners >= 0)
    distances_m = np.full(count, np.inf)
    np.minimum.at(distances_m, owners[inside], np.linalg.norm(points_velo[inside, :3], axis=1))
    cameras, boxes_px = _best_images(boxes, frame)
    detections = Detections(boxes_px, probable, types)
    position_m, _, *size_m, axis_rad = np.maximum(
        found.deviations, [_MIN_POSITION_M, *(4 * [_MIN_SIZE_M]), _MIN_AXIS_RAD]
    ).T
    covariances = np.full((count, 4, 4), np.nan)
    covariances[:, :2, :2] = position_m[:, None, None] ** 2 * np.eye(2)
    return Vehicles(
        fused=FusedDetections.unfused(detections),
        ids=np.full(count, -1),
        boxes=boxes,
        distances_m=np.where(np.isfinite(distances_m), distances_m, np.nan),
        velocities_m_s=np.full((count, 2), np.nan),
        covariances=covariances,
        box_deviations=BoxDeviations(
            np.column_stack(size_m), np.minimum(axis_rad, _ANY_AXIS_RAD), found.reversals
        ),
        owners=owners,
        cameras=cameras,
        bev_scores=found.scores,
        bev_types=types,
    )


def owners_of_points(boxes: Boxes3D, points_velo: Float32) -> Int:
    """Return (N,) the row of the box above the ground around each point, of several the first; -1 without one."""
    columns = np.column_stack([boxes.bottom_m, boxes.size_m, boxes.yaw_rad])
    points = np.ascontiguousarray(points_velo, np.float32)
    return owners_in_boxes(points, columns, _CELL_M, _MARGIN_M, _GROUND_M)


def probabilities(scores: Float64, types: NDArray[np.str_]) -> Float64:
    """Return the (M,) probabilities that there are objects of (M,) classes by their scores from above."""
    slopes, offsets = np.where(SizePriors.of(types).has_sides[:, None], *_ODDS).T
    return probability(slopes * log_odds(scores, LEAST) + offsets)


def _best_images(boxes: Boxes3D, frame: Frame) -> tuple[Int, Float64]:
    """Return (M,) the camera that shows most of each box, -1 without one, and (M, 4) the outline there."""
    cameras, boxes_px = np.full(len(boxes), -1), np.full((len(boxes), 4), np.nan)
    best = np.full(len(boxes), _MIN_VISIBLE_SHARE)
    for number, view in enumerate(frame.views):
        if view.calibration is None:
            continue
        calibration, size_px = camera_of(view)
        whole_px = box_outlines_px(calibration.image_P_velo, boxes)
        cut_px = np.clip(whole_px, 0, np.tile(np.subtract(size_px, 1), 2))
        shares = np.nan_to_num(area_px(cut_px) / area_px(whole_px))
        rows = np.flatnonzero(shares > best)
        cameras[rows], boxes_px[rows], best[rows] = number, cut_px[rows], shares[rows]
    return cameras, boxes_px
