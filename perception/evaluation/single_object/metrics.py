"""Metrics of trackers of one object: those of the thesis, and one-pass evaluation."""

from dataclasses import dataclass

import numpy as np

from perception.evaluation.config import SingleObjectMetricsConfig
from perception.evaluation.single_object.curves import (
    area_under_curve,
    correct_frames,
    precision_curve,
    success_curve,
)
from perception.evaluation.single_object.errors import SingleObjectErrors
from perception.tracking.single_object.tracker import TrackStatus
from perception.types import Bool, Float64

METRIC_WORDS = {
    "start": (
        "the tracker is initialised with the labelled box in the first frame; the first and the last frame are "
        "evaluated, and every labelled one between"
    ),
    "frame": "boxes, headings and velocities are compared in the LiDAR frame of the scan, truth as labelled",
    "E3D": "(7.3) mean distance of the box centres in metres, over the frames with a box",
    "E2D": (
        "(7.3) mean distance in pixels of the rectangles' centres, over the frames with both; that of a "
        "tracker in space is around its projected box, clipped to the image as the labels are; in_image: "
        "share of the frames with the object in the image that are counted"
    ),
    "E_phi": "(7.4) mean angle between the headings as axes, 0 to pi/2: an opposite heading has no error",
    "heading": "mean angle between the headings, 0 to pi; bias: mean signed error",
    "overlap": "(A.1) intersection over union of the upright boxes' volumes, sizes as they are",
    "overlap_success": "share of frames whose overlap exceeds `overlap`; it is 0 without a box",
    "heading_success": "(A.2) share of frames whose headings differ by less than heading_deg, 0 to 180",
    "location_success": (
        "share of the frames with the object in the image in which the centres of the rectangles are less "
        "than location_px apart"
    ),
    "success": (
        "one-pass evaluation: area under the share of frames whose overlap is at least a threshold, over "
        "steps thresholds from 0 to 1 (trapezoids); at 0 all frames count, as in the field: 1/40 of 21 steps"
    ),
    "precision": (
        "one-pass evaluation: area under the share of frames whose centres are within a threshold, over "
        "steps thresholds from 0 to max_center_error_m (trapezoids), by max_center_error_m"
    ),
    "velocity": "mean length of the velocity error over the ground, in the frames in which the truth is known",
    "states": "shares of frames that the tracker reports as seen, predicted and lost",
    "drifted": "share of frames whose prediction does not overlap the object",
    "lost_from_frame": "first frame from which on the prediction never overlaps the object again",
    "ms": "time of one tracker on one object, without the shared stages: reading, poses, ground",
    "together": "over all frames of all sequences, not a mean of the sequences",
}


@dataclass(frozen=True)
class SingleObjectMetrics:
    """Metrics of one object over its frames; NaN where no frame counts.

    Attributes:
        frames: Number of evaluated frames.
        center_m: E3D, mean distance of the box centres in m.
        center_px: E2D, mean distance of the rectangles' centres in px.
        in_image: Share of the frames with the object in the image in which the tracker's rectangle is in it too:
            E2D rests on these alone.
        folded_heading_rad: E_phi, mean heading error as axes in rad, 0 to pi/2.
        heading_rad: Mean absolute heading error in rad, 0 to pi.
        heading_bias_rad: Mean signed heading error in rad.
        velocity_m_s: Mean length of the velocity error in m/s.
        overlap_success: Share of frames with sufficient 3D overlap, 0 to 1.
        heading_success: Share of frames with a correct heading, 0 to 1.
        location_success: Share of frames with a correct location, of those with the object in the image, 0 to 1.
        success: Success of one-pass evaluation, 0 to 1.
        precision: Precision of one-pass evaluation, 0 to 1.
        seen: Share of frames that the tracker reports as seen.
        predicted: Share of frames that the tracker reports as predicted.
        lost: Share of frames that the tracker reports as lost.
        drifted: Share of frames in which the prediction does not overlap the object.
        lost_from_frame: First frame from which on the prediction never overlaps the object again, or None.
        ms_per_frame: Mean time per frame in ms.
        ms_p99: 99th percentile of the time per frame in ms.
    """

    frames: int
    center_m: float
    center_px: float
    in_image: float
    folded_heading_rad: float
    heading_rad: float
    heading_bias_rad: float
    velocity_m_s: float
    overlap_success: float
    heading_success: float
    location_success: float
    success: float
    precision: float
    seen: float
    predicted: float
    lost: float
    drifted: float
    lost_from_frame: int | None
    ms_per_frame: float
    ms_p99: float


def single_object_metrics(
    errors: SingleObjectErrors, config: SingleObjectMetricsConfig | None = None
) -> SingleObjectMetrics:
    """Return the metrics of one sequence, or of several together."""
    config = config or SingleObjectMetricsConfig()
    size_rad, correct = np.abs(errors.heading_rad), correct_frames(errors, config)
    shares = {state: _mean(errors.states == state) for state in TrackStatus}
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
        success=area_under_curve(success_curve(errors, config)),
        precision=area_under_curve(precision_curve(errors, config)),
        seen=shares[TrackStatus.SEEN],
        predicted=shares[TrackStatus.PREDICTED],
        lost=shares[TrackStatus.LOST],
        drifted=_mean(errors.is_drifted),
        lost_from_frame=_lost_from(errors),
        ms_per_frame=1000 * _mean(errors.seconds),
        ms_p99=1000 * float(np.quantile(errors.seconds, 0.99)) if len(errors) else np.nan,
    )


def _lost_from(errors: SingleObjectErrors) -> int | None:
    if len(errors) == 0 or not errors.is_drifted[-1]:
        return None
    on = np.flatnonzero(~errors.is_drifted)
    return int(errors.frames[on[-1] + 1 if len(on) else 0])


def _mean(values: Float64 | Bool) -> float:
    """Return the mean of the known values, or NaN without one."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else np.nan
