"""How far a tracker of one object is from it, frame by frame."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from perception.evaluation.single_object.track import PredictedTrack, TrueTrack
from perception.geometry.angles import wrap
from perception.geometry.box_outline_px import box_outlines_px
from perception.geometry.box_overlap_3d import paired_iou_3d
from perception.geometry.box_overlap_px import paired_iou_px
from perception.types import Bool, Boxes3D, Calibration, Float64, Int


@dataclass(frozen=True)
class SingleObjectErrors:
    """The K frames that are judged: those with an answer in which the object is labelled.

    Attributes:
        frames: (K,) numbers of the frames.
        states: (K,) what the tracker said of its answer.
        center_m: (K,) between the centres of the boxes; NaN where the tracker gave none.
        heading_rad: (K,) of the box less that of the object, from -pi to pi; NaN without a box.
        overlap: (K,) 3D intersection over union (A.1), 0 where the tracker gave no box; NaN of a tracker
            that never gives one.
        velocity_m_s: (K,) length of the error; NaN without a box, or where the truth is unknown.
        center_px: (K,) between the centres of the rectangles in the image; NaN where one is missing.
        overlap_px: (K,) their intersection over union, 0 where the tracker gave none; NaN where the
            object is not in the image.
        seconds: (K,) that each answer took.
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

    def __len__(self) -> int:
        """Return K."""
        return len(self.frames)

    @property
    def has_3d_boxes(self) -> bool:
        """Whether the tracker answers in space, not in the image alone."""
        return not bool(np.isnan(self.overlap).all())

    @property
    def is_drifted(self) -> Bool:
        """(K,) whether the answer shares nothing with the object, in space or else in the image."""
        in_space = np.isfinite(self.overlap)
        return np.asarray(np.where(in_space, self.overlap == 0, self.overlap_px == 0))

    @classmethod
    def concatenate(cls, parts: Sequence["SingleObjectErrors"]) -> "SingleObjectErrors":
        """Return the frames of several tracks as one."""
        names = [field.name for field in fields(cls)]
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def single_object_errors(
    truth: TrueTrack, predicted_track: PredictedTrack, camera: Calibration | None = None
) -> SingleObjectErrors:
    """Compare what a tracker answered with the object as it was.

    Args:
        truth: the object.
        predicted_track: by a tracker, over the same frames or more.
        camera: that sees both; None where there is none.
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
    """Return rectangles in the image: of the box where there is one, else as the tracker gave them."""
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
