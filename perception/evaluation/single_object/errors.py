"""Errors of a tracker of one object, frame by frame."""

from dataclasses import dataclass

import numpy as np

from perception.evaluation.single_object.track import PredictedTrack, TrueTrack
from perception.geometry.box_overlap import paired_iou_3d
from perception.geometry.box_overlap_px import paired_iou_px
from perception.geometry.camera import box_outlines_px
from perception.geometry.se3 import wrap
from perception.types import ArrayTable, Bool, Boxes3D, Calibration, Float64, Int


@dataclass(frozen=True)
class SingleObjectErrors(ArrayTable):
    """Errors in the K frames in which the object is labelled and the tracker has a prediction.

    Attributes:
        frames: (K,) Numbers of the frames.
        states: (K,) `TrackStatus` that the tracker reports.
        center_m: (K,) Distance of the box centres; NaN without a predicted box.
        heading_rad: (K,) Heading of the predicted box less that of the object, -pi to pi; NaN without a box.
        overlap: (K,) 3D intersection over union (A.1), 0 without a predicted box; NaN of a tracker that never
            predicts one.
        velocity_m_s: (K,) Length of the velocity error; NaN without a box, or where the truth is unknown.
        center_px: (K,) Distance of the centres of the rectangles in the image; NaN where one is missing.
        overlap_px: (K,) Intersection over union of the rectangles, 0 without a predicted one; NaN where the
            object is not in the image.
        seconds: (K,) Time of each prediction in s.
    """

    frames: Int
    states: np.ndarray
    center_m: Float64
    heading_rad: Float64
    overlap: Float64
    velocity_m_s: Float64
    center_px: Float64
    overlap_px: Float64
    seconds: Float64

    @property
    def has_3d_boxes(self) -> bool:
        """Whether the tracker predicts 3D boxes, not rectangles in the image alone."""
        return not bool(np.isnan(self.overlap).all())

    @property
    def is_drifted(self) -> Bool:
        """(K,) Whether the prediction does not overlap the object, in space or else in the image."""
        in_space = np.isfinite(self.overlap)
        return np.asarray(np.where(in_space, self.overlap == 0, self.overlap_px == 0))


def single_object_errors(
    truth: TrueTrack, predicted_track: PredictedTrack, camera: Calibration | None = None
) -> SingleObjectErrors:
    """Compare a predicted track with the true one.

    Args:
        truth: Labelled or exact track of the object.
        predicted_track: Track that a tracker predicts, over the same frames or more.
        camera: Calibration of the camera, or None without one.
    """
    _, truth_rows, track_rows = np.intersect1d(
        truth.frames, predicted_track.frames, return_indices=True
    )
    truth, boxes = truth[truth_rows], predicted_track.boxes_velo[track_rows]
    outlines = _outlines(boxes, predicted_track.boxes_px[track_rows], camera)
    has_box = np.isfinite(boxes.bottom_m).all(axis=1)
    overlap = np.where(has_box, paired_iou_3d(boxes, truth.boxes_velo), 0.0)
    velocity_error = predicted_track.velocities_m_s[track_rows] - truth.velocities_m_s
    overlap_px = np.nan_to_num(paired_iou_px(outlines, truth.boxes_px))
    return SingleObjectErrors(
        frames=truth.frames,
        states=predicted_track.states[track_rows],
        center_m=_norm(_centers_m(boxes) - _centers_m(truth.boxes_velo)),
        heading_rad=wrap(boxes.yaw_rad - truth.boxes_velo.yaw_rad),
        overlap=overlap if has_box.any() else np.full(len(truth), np.nan),
        velocity_m_s=np.where(has_box, _norm(velocity_error), np.nan),
        center_px=_norm(_centers_px(outlines) - _centers_px(truth.boxes_px)),
        overlap_px=np.where(np.isfinite(truth.boxes_px).all(axis=1), overlap_px, np.nan),
        seconds=predicted_track.seconds[track_rows],
    )


def _outlines(boxes: Boxes3D, boxes_px: Float64, camera: Calibration | None) -> Float64:
    """Return rectangles in the image: projected boxes where there are any, else those of the tracker."""
    if camera is None:
        return boxes_px
    projected = box_outlines_px(camera.image_P_velo, boxes, camera.image_size_px)
    has_box = np.isfinite(boxes.bottom_m).all(axis=1, keepdims=True)
    return np.where(has_box, projected, boxes_px)


def _centers_m(boxes: Boxes3D) -> Float64:
    return boxes.bottom_m + boxes.size_m * (0.0, 0.0, 0.5)


def _centers_px(boxes_px: Float64) -> Float64:
    return (boxes_px[:, :2] + boxes_px[:, 2:]) / 2


def _norm(vectors: Float64) -> Float64:
    return np.asarray(np.linalg.norm(vectors, axis=1))
