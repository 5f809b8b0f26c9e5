"""Correct frames of one tracked object, and their shares over thresholds."""

from dataclasses import dataclass

import numpy as np

from perception.evaluation.config import SingleObjectMetricsConfig
from perception.evaluation.single_object.errors import SingleObjectErrors
from perception.types import Bool, Float64


@dataclass(frozen=True)
class CorrectFrames:
    """Correct frames by each of three criteria.

    Attributes:
        overlap: (K,) Whether the 3D overlap is correct; (0,) for a tracker in the image alone.
        heading: (K,) Whether the heading is correct; (0,) for a tracker in the image alone.
        location: (L,) Whether the location is correct, in the frames with the object in the image.
    """

    overlap: Bool
    heading: Bool
    location: Bool


def correct_frames(errors: SingleObjectErrors, config: SingleObjectMetricsConfig) -> CorrectFrames:
    """Tell which frames are correct."""
    in_space = slice(None) if errors.has_3d_boxes else slice(0)
    in_image = np.isfinite(errors.overlap_px)
    # Missing values are NaN, and NaN is never correct.
    return CorrectFrames(
        overlap=errors.overlap[in_space] > config.overlap,
        heading=np.abs(errors.heading_rad[in_space]) < np.radians(config.heading_deg),
        location=errors.center_px[in_image] < config.location_px,
    )


def success_curve(errors: SingleObjectErrors, config: SingleObjectMetricsConfig) -> Float64:
    """Return (steps,) shares of frames whose overlap is at least a threshold, from 0 to 1."""
    thresholds = np.linspace(0, 1, config.steps)
    return _shares(errors.overlap[:, None] >= thresholds, errors)


def precision_curve(errors: SingleObjectErrors, config: SingleObjectMetricsConfig) -> Float64:
    """Return (steps,) shares of frames whose centres are within a threshold, from 0 to the reach."""
    thresholds = np.linspace(0, config.max_center_error_m, config.steps)
    return _shares(errors.center_m[:, None] <= thresholds, errors)


def location_curve(errors: SingleObjectErrors, thresholds_px: Float64) -> Float64:
    """Return (T,) shares of frames whose centres in the image are less than a threshold apart."""
    in_image = np.isfinite(errors.overlap_px)
    if not in_image.any():
        return np.full(len(thresholds_px), np.nan)
    return np.asarray((errors.center_px[in_image, None] < thresholds_px).mean(axis=0))


def cumulative_success(is_correct: Bool) -> Float64:
    """Return (K + 1,) correct frames up to each frame, as a share of all frames (Figs A.1, A.2)."""
    count = max(len(is_correct), 1)
    return np.concatenate([[0.0], np.cumsum(is_correct) / count])


def area_under_curve(curve: Float64) -> float:
    """Return the mean height of a curve over evenly spaced thresholds, by trapezoids."""
    return float(((curve[:-1] + curve[1:]) / 2).mean())


def _shares(is_correct: Bool, errors: SingleObjectErrors) -> Float64:
    if len(errors) == 0 or not errors.has_3d_boxes:
        return np.full(is_correct.shape[1], np.nan)
    return np.asarray(is_correct.mean(axis=0))
