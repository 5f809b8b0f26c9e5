"""Protocol for tracks of moving objects on the ground plane: assignment of tracks to objects that must be tracked.

- An object must be tracked in every frame in which the labels state that it moves, the bottom centre of
  its box is in the area, the middle of its box is in the camera's view, and its box holds `min_points`
  points of the scan from `clearance_m` above its bottom. It must be tracked from the first such frame, so
  frames before a tracker confirms a track are misses.
- The similarity of a track and an object is 1 at no distance of the centres and 0 at `max_distance_m`, or
  the overlap (IoU) of their outlines, whichever is greater. From `min_similarity` on, a track may match an
  object. Objects that must be tracked and tracks are assigned for the greatest sum of similarity.
- A track is ignored where it matches an object that may but need not be tracked, and is more similar to it
  than to its own object: one that moves but does not count in this frame, one that has stopped or not yet
  started, one of unknown motion. It also matches such an object where half of its outline lies on it.
  Tracks on parked objects, which move in no frame, are not ignored.
- A track without an object is left out where nothing was labelled: outside the area, outside the view, or
  with half of its box in the image in one DontCare region.
- The remaining tracks are evaluated twice: by distance and by overlap.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.optimize import linear_sum_assignment

from perception.evaluation.config import MovingObjectConfig
from perception.evaluation.multi_object.sequence import TrackedFrame
from perception.evaluation.objects import LabelledObjects, LabelledView, MotionState, raised_boxes
from perception.geometry.box_overlap import (
    center_distances_m,
    distance_similarity,
    intersection_areas_m2,
    iou_bev,
)
from perception.geometry.boxes import corners, points_inside
from perception.geometry.camera import project
from perception.types import SHARED, ArrayTable, Bool, Boxes3D, Float, Float64, Int, Tracks

# Returns (M, T) similarity of M objects and T tracks.
Similarity = Callable[[Boxes3D, Boxes3D], Float64]

_DONT_CARE_SHARE = 0.5  # share of a box in the image at which it counts as in a DontCare region
_COVERED_SHARE = 0.5  # share of a track's outline at which it lies on an object


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
    return is_near & scene.view.contains(boxes.centers_m)


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


@dataclass(frozen=True)
class FrameAssignment:
    """Evaluated objects and tracks of one frame, and their assignment.

    Attributes:
        targets: (G,) Rows of the objects that must be tracked.
        evaluated: (T,) Rows of the tracks that are right or wrong.
        matched_objects: (P,) Rows of the objects that a track matches.
        matched_tracks: (P,) Rows of the tracks that match them.
        ignored: (E,) Rows of tracks that match an object which need not be tracked.
        on_parked: (K,) Rows of evaluated tracks that match no object and lie on a parked one.
    """

    targets: Int
    evaluated: Int
    matched_objects: Int
    matched_tracks: Int
    ignored: Int
    on_parked: Int


def assign_tracks(
    scene: MovingScene, tracks: Tracks, config: MovingObjectConfig
) -> FrameAssignment:
    """Assign the tracks of one frame to its objects by the protocol of this module."""
    boxes, targets = scene.objects.boxes_velo, is_target(scene, config)
    by_distance = similarity_by_distance(config)(boxes, tracks.boxes)
    similarity = np.maximum(by_distance, iou_bev(boxes, tracks.boxes))
    target_rows = np.flatnonzero(targets)
    pairs = _best_pairs(similarity[target_rows], config.min_similarity)
    own_similarity = np.zeros(len(tracks))
    own_similarity[pairs[1]] = similarity[target_rows][pairs]

    is_parked = (scene.objects.motions == MotionState.STATIC) & ~scene.moves_in_drive
    ignorable = ~targets & ~is_parked
    lies_on = covered_shares(boxes, tracks.boxes) >= _COVERED_SHARE
    may_match = (similarity >= config.min_similarity) | lies_on
    ignorable_similarity = np.where(may_match[ignorable], similarity[ignorable], 0.0).max(
        axis=0, initial=0.0
    )
    ignored = ignorable_similarity > own_similarity
    is_unlabelled = (own_similarity == 0) & ~is_labelled_region(tracks.boxes, scene, config)
    evaluated = ~ignored & ~is_unlabelled
    kept = ~ignored[pairs[1]]
    return FrameAssignment(
        targets=target_rows,
        evaluated=np.flatnonzero(evaluated),
        matched_objects=target_rows[pairs[0][kept]],
        matched_tracks=pairs[1][kept],
        ignored=np.flatnonzero(ignored),
        on_parked=np.flatnonzero(
            evaluated & (own_similarity == 0) & may_match[is_parked].any(axis=0)
        ),
    )


def tracked_frame(
    scene: MovingScene, tracks: Tracks, assignment: FrameAssignment, similarity: Similarity
) -> TrackedFrame:
    """Return the evaluated objects and tracks of one frame, as the tracking metrics take them."""
    truth, predicted = scene.objects[assignment.targets], tracks[assignment.evaluated]
    return TrackedFrame(
        truth.track_ids, predicted.ids, similarity(truth.boxes_velo, predicted.boxes)
    )


def similarity_by_distance(config: MovingObjectConfig) -> Similarity:
    """Return the similarity that falls with the distance of the centres."""
    return lambda boxes, tracks: distance_similarity(
        center_distances_m(boxes, tracks), config.max_distance_m
    )


def _best_pairs(similarity: Float64, min_similarity: float) -> tuple[Int, Int]:
    """Return rows and columns of the pairs of sufficient similarity with the greatest sum."""
    enough = np.where(similarity >= min_similarity, similarity, 0.0)
    rows, columns = linear_sum_assignment(enough, maximize=True)
    kept = enough[rows, columns] > 0
    return rows[kept], columns[kept]


def covered_shares(boxes: Boxes3D, tracks: Boxes3D) -> Float64:
    """Return (M, T) share of each track's outline that lies on each object."""
    shared_m2 = intersection_areas_m2(boxes, tracks)
    areas_m2 = tracks.size_m[:, 0] * tracks.size_m[:, 1]
    return np.divide(shared_m2, areas_m2, out=np.zeros_like(shared_m2), where=areas_m2 > 0)
