"""What the errors of a tracker of one object come to: the thesis' figures, and those of the field."""

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
        "the tracker is told the labelled box in the first frame and nothing after; the first and the last "
        "frame are judged, and every labelled one between"
    ),
    "frame": "boxes, headings and velocities are compared in the LiDAR frame of the scan, truth as labelled",
    "E3D": "(7.3) mean distance of the box centres in metres, over the frames with a box",
    "E2D": (
        "(7.3) mean distance in pixels of the rectangles' centres, over the frames with both; that of a "
        "tracker in space is around its projected box, clipped to the image as the labels are; in_image: "
        "share of the frames with the object in the image that are counted"
    ),
    "E_phi": "(7.4) mean angle between the headings as axes, 0 to pi/2: whoever is turned about has no error",
    "heading": "mean angle between the headings, 0 to pi; bias: mean signed error",
    "overlap": "(A.1) intersection over union of the upright boxes' volumes, sizes as they are",
    "overlap_success": "share of frames whose overlap exceeds overlap; without a box there is none",
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
    "velocity": "mean length of the velocity's error over the ground, in the frames in which truth is known",
    "states": "shares of frames that the tracker itself calls seen, predicted and lost",
    "off": "share of frames whose answer shares nothing with the object",
    "lost_from_frame": "first frame from which on the answer never shares anything with the object again",
    "ms": "of one tracker on one object, without what it shares with others: reading, poses, ground",
    "together": "over all frames of all sequences, not a mean of the sequences",
}


@dataclass(frozen=True)
class SingleObjectMetrics:
    """What the errors of some frames come to; NaN is what nothing was measured of.

    Attributes:
        frames: judged.
        center_m: E3D.
        center_px: E2D.
        in_image: share of the frames with the object in the image in which the tracker's rectangle is there
            too: E2D rests on these alone.
        folded_heading_rad: E_phi.
        heading_rad: mean size of the unfolded error.
        heading_bias_rad: its mean.
        velocity_m_s: mean size of the velocity's error.
        overlap_success: share of frames, 0 to 1.
        heading_success: the same.
        location_success: the same of frames with the object in the image.
        success: of one-pass evaluation, 0 to 1.
        precision: the same.
        seen: share of frames that the tracker calls so.
        predicted: the same.
        lost: the same.
        drifted: share of frames that share nothing with the object.
        lost_from_frame: frame from which on nothing is shared, or None where the last is not off.
        ms_per_frame: mean.
        ms_p99: 99th percentile.
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
    """Sum up the errors of one sequence, or of several together."""
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
    """Return the mean of what is known, or NaN of nothing."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else np.nan
