"""Errors of trackers of one object, and their metrics: those of the thesis, and one-pass evaluation."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from perception.evaluation.config import MAX_CENTER_M, MAX_HEADING_DEG, MAX_LOCATION_PX, MIN_OVERLAP
from perception.evaluation.report import Metric, Metrics
from perception.evaluation.single_object.track import PredictedTrack, TrueTrack
from perception.geometry.box_overlap import paired_iou_3d
from perception.geometry.box_overlap_px import paired_iou_px
from perception.geometry.camera import box_outlines_px
from perception.geometry.se3 import wrap
from perception.tracking.single_object.tracker import TrackStatus
from perception.types import ArrayTable, Bool, Boxes3D, Calibration, Float64, Int

_STEPS = 21  # thresholds of success and precision


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
        center_m=_norm(boxes.centers_m - truth.boxes_velo.centers_m),
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


def _centers_px(boxes_px: Float64) -> Float64:
    return (boxes_px[:, :2] + boxes_px[:, 2:]) / 2


def _norm(vectors: Float64) -> Float64:
    return np.asarray(np.linalg.norm(vectors, axis=1))


@dataclass(frozen=True)
class SingleObjectMetrics(Metrics):
    """Metrics over frames of one object, or of several together; NaN where no frame counts.

    The tracker is initialised with the labelled box in the first frame; the first and the last frame are evaluated,
    and every labelled one between. Boxes, headings and velocities are compared in the LiDAR frame of the scan.

    Attributes:
        frames: Number of evaluated frames.
        center_m: E3D (7.3), mean distance of the box centres in m, over the frames with a box.
        center_px: E2D (7.3), mean distance of the rectangles' centres in px, over the frames with both; that of a
            tracker in space is around its projected box, clipped to the image as the labels are.
        in_image: Share of the frames with the object in the image in which the tracker's rectangle is in it too.
        folded_heading_rad: E_phi (7.4), mean angle between the headings as axes in rad, 0 to pi/2: an opposite
            heading has no error.
        heading_rad: Mean angle between the headings in rad, 0 to pi.
        heading_bias_rad: Mean signed heading error in rad.
        velocity_m_s: Mean length of the velocity error over the ground in m/s, where the truth is known.
        overlap_success: Share of frames whose 3D IoU (A.1) exceeds 0.25; 0 without a box.
        heading_success: Share of frames whose headings differ by less than 10 degrees (A.2), 0 to 180.
        location_success: Share of the frames with the object in the image in which the centres of the rectangles are
            less than 20 px apart.
        success: One-pass evaluation: area under the share of frames whose overlap is at least a threshold, over
            21 thresholds from 0 to 1 (trapezoids); at 0 all frames count, as in the field.
        precision: One-pass evaluation: area under the share of frames whose centres are within a threshold, over
            21 thresholds from 0 to 2 m (trapezoids), as a share.
        seen: Share of frames that the tracker reports as seen.
        predicted: Share of frames that the tracker reports as predicted.
        lost: Share of frames that the tracker reports as lost.
        drifted: Share of frames in which the prediction does not overlap the object.
        lost_from_frame: First frame from which on the prediction never overlaps the object again, or None.
        ms_per_frame: Mean time of one tracker on one object per frame in ms, without reading, poses and ground.
        ms_p99: 99th percentile of the same time in ms.
    """

    frames: Annotated[int, Metric("frames")]
    center_m: Annotated[float, Metric("E3D [m]", ".3f")]
    center_px: Annotated[float, Metric("E2D [px]", ".1f")]
    in_image: Annotated[float, Metric("in image [%]", ".1%")]
    folded_heading_rad: Annotated[float, Metric("E_phi [rad]", ".3f")]
    heading_rad: float
    heading_bias_rad: Annotated[float, Metric("bias [rad]", ".3f")]
    velocity_m_s: Annotated[float, Metric("velocity [m/s]", ".3f")]
    overlap_success: Annotated[float, Metric("overlap [%]", ".1%")]
    heading_success: float
    location_success: float
    success: Annotated[float, Metric("Success [%]", ".1%")]
    precision: Annotated[float, Metric("Precision [%]", ".1%")]
    seen: Annotated[float, Metric("seen [%]", ".1%")]
    predicted: Annotated[float, Metric("predicted [%]", ".1%")]
    lost: Annotated[float, Metric("lost [%]", ".1%")]
    drifted: Annotated[float, Metric("drifted [%]", ".1%")]
    lost_from_frame: Annotated[int | None, Metric("lost from frame")]
    ms_per_frame: Annotated[float, Metric("mean [ms]", ".2f")]
    ms_p99: Annotated[float, Metric("p99 [ms]", ".2f")]


def single_object_metrics(errors: SingleObjectErrors) -> SingleObjectMetrics:
    """Return the metrics of one sequence, or of several together."""
    size_rad, correct = np.abs(errors.heading_rad), correct_frames(errors)
    shares = {str(state): _mean(errors.states == state) for state in TrackStatus}
    return SingleObjectMetrics(
        frames=len(errors),
        center_m=_mean(errors.center_m),
        center_px=_mean(errors.center_px),
        in_image=_mean(np.isfinite(errors.center_px[np.isfinite(errors.overlap_px)])),
        folded_heading_rad=_mean(np.minimum(size_rad, np.pi - size_rad)),  # (7.4)
        heading_rad=_mean(size_rad),
        heading_bias_rad=_mean(errors.heading_rad),
        velocity_m_s=_mean(errors.velocity_m_s),
        overlap_success=_mean(correct.overlap),
        heading_success=_mean(correct.heading),
        location_success=_mean(correct.location),
        success=area_under_curve(success_curve(errors)),
        precision=area_under_curve(precision_curve(errors)),
        **shares,
        drifted=_mean(errors.is_drifted),
        lost_from_frame=_lost_from(errors),
        ms_per_frame=1000 * _mean(errors.seconds),
        ms_p99=1000 * float(np.quantile(errors.seconds, 0.99)) if len(errors) else np.nan,
    )


class CorrectFrames(NamedTuple):
    """Correct frames by each of three criteria; overlap and heading are (0,) for a tracker in the image alone."""

    overlap: Bool  # (K,)
    heading: Bool  # (K,)
    location: Bool  # (L,) in the frames with the object in the image


def correct_frames(errors: SingleObjectErrors) -> CorrectFrames:
    """Return which frames are correct; missing values are NaN, which is never correct."""
    in_space = slice(None) if errors.has_3d_boxes else slice(0)
    return CorrectFrames(
        overlap=errors.overlap[in_space] > MIN_OVERLAP,
        heading=np.abs(errors.heading_rad[in_space]) < np.radians(MAX_HEADING_DEG),
        location=errors.center_px[np.isfinite(errors.overlap_px)] < MAX_LOCATION_PX,
    )


def success_curve(errors: SingleObjectErrors) -> Float64:
    """Return (steps,) shares of frames whose overlap is at least a threshold, from 0 to 1."""
    return _shares(errors.overlap[:, None] >= np.linspace(0, 1, _STEPS), errors)


def precision_curve(errors: SingleObjectErrors) -> Float64:
    """Return (steps,) shares of frames whose centres are within a threshold, from 0 to the reach."""
    thresholds_m = np.linspace(0, MAX_CENTER_M, _STEPS)
    return _shares(errors.center_m[:, None] <= thresholds_m, errors)


def location_curve(errors: SingleObjectErrors, thresholds_px: Float64) -> Float64:
    """Return (T,) shares of frames whose centres in the image are less than a threshold apart."""
    in_image = np.isfinite(errors.overlap_px)
    if not in_image.any():
        return np.full(len(thresholds_px), np.nan)
    return np.asarray((errors.center_px[in_image, None] < thresholds_px).mean(axis=0))


def cumulative_success(is_correct: Bool) -> Float64:
    """Return (K + 1,) correct frames up to each frame, as a share of all frames (Figs A.1, A.2)."""
    return np.concatenate([[0.0], np.cumsum(is_correct) / max(len(is_correct), 1)])


def area_under_curve(curve: Float64) -> float:
    """Return the mean height of a curve over evenly spaced thresholds, by trapezoids."""
    return float(((curve[:-1] + curve[1:]) / 2).mean())


def _shares(is_correct: Bool, errors: SingleObjectErrors) -> Float64:
    if len(errors) == 0 or not errors.has_3d_boxes:
        return np.full(is_correct.shape[1], np.nan)
    return np.asarray(is_correct.mean(axis=0))


def _lost_from(errors: SingleObjectErrors) -> int | None:
    if len(errors) == 0 or not errors.is_drifted[-1]:
        return None
    on = np.flatnonzero(~errors.is_drifted)
    return int(errors.frames[on[-1] + 1 if len(on) else 0])


def _mean(values: Float64 | Bool) -> float:
    """Return the mean of the known values, or NaN without one."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else np.nan
