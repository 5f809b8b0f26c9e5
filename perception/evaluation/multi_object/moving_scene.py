"""Labelled moving objects of one frame: which of them must be tracked, and where labels are complete."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from perception.evaluation.config import MovingObjectConfig
from perception.evaluation.objects import LabelledObjects, LabelledView, MotionState, raised_boxes
from perception.geometry.boxes import corners, points_inside
from perception.geometry.camera import project
from perception.types import SHARED, ArrayTable, Bool, Boxes3D, Float, Float64, Int

_DONT_CARE_SHARE = 0.5  # share of a box in the image at which it counts as in a DontCare region


@dataclass(frozen=True)
class MovingScene(ArrayTable):
    """Labelled objects of one frame with their motion.

    Attributes:
        objects: M labelled objects in the LiDAR frame, static ones too.
        velocities_m_s: (M, 2) Velocity over the ground along x and y of the LiDAR frame; NaN where unknown.
        moves_in_drive: (M,) Whether the object moves in any frame of the drive.
        points: (M,) Number of scan points that each box holds above its bottom.
        view: Image in which objects were labelled; None where everything around was labelled.
    """

    objects: LabelledObjects
    velocities_m_s: Annotated[Float64, 2]
    moves_in_drive: Bool
    points: Int
    view: Annotated[LabelledView | None, SHARED] = None


def points_above_bottom(boxes_velo: Boxes3D, points_velo: Float, clearance_m: float) -> Int:
    """Return (M,) number of points in each box, without those near its bottom."""
    raised = raised_boxes(boxes_velo, clearance_m)
    return np.asarray(np.count_nonzero(points_inside(raised, points_velo), axis=1), np.int64)


def is_target(scene: MovingScene, config: MovingObjectConfig) -> Bool:
    """Tell (M,) which objects of a scene must be tracked."""
    boxes = scene.objects.boxes_velo
    moves = (scene.objects.motions == MotionState.MOVING) & (scene.objects.track_ids >= 0)
    is_observed = scene.points >= config.min_points
    return np.asarray(moves & is_observed & _is_watched(boxes, scene, config))


def _is_watched(boxes: Boxes3D, scene: MovingScene, config: MovingObjectConfig) -> Bool:
    """Tell which boxes are in the area and in the labelled view."""
    is_near = config.area.contains_xy(boxes.bottom_m)
    if scene.view is None:
        return is_near
    middle = boxes.bottom_m + boxes.size_m * (0, 0, 0.5)
    return is_near & scene.view.contains(middle)


def is_labelled_region(boxes: Boxes3D, scene: MovingScene, config: MovingObjectConfig) -> Bool:
    """Tell at which boxes an object would have been labelled: in area and view, and in no DontCare region."""
    is_watched = _is_watched(boxes, scene, config)
    if scene.view is None or len(boxes) == 0:
        return is_watched
    return is_watched & ~_is_in_dont_care(boxes, scene.view)


def _is_in_dont_care(boxes: Boxes3D, view: LabelledView) -> Bool:
    """Tell which boxes have half of their outline in the image in one DontCare region."""
    pixels, _ = project(view.calibration.image_P_velo, corners(boxes).reshape(-1, 3))
    pixels = np.clip(pixels.reshape(-1, 8, 2), 0, view.image_size_px)
    # Corners behind the camera are NaN, which fmin and fmax leave out.
    low, high = np.fmin.reduce(pixels, axis=1), np.fmax.reduce(pixels, axis=1)
    regions = view.dont_care_px
    reach = np.minimum(high[:, None], regions[:, 2:]) - np.maximum(low[:, None], regions[:, :2])
    shared = np.maximum(reach, 0).prod(axis=2)
    needed = _DONT_CARE_SHARE * (high - low).prod(axis=1)
    with np.errstate(invalid="ignore"):
        return np.asarray((shared >= needed[:, None]).any(axis=1))
