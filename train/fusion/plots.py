"""Plots of a trained fusion: Figs. 7.12, 7.13 and 7.14, and the reliability of the scores."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from data.detections.detected_frames import DetectedFrames
from data.detections.fused_frames import (
    FusedFrames,
    boxes_by_detector,
    class_correctness,
    precision_curves,
)
from perception.detection.config import TRI_BOX_CONFIGS
from perception.detection.fusion.features import tri_box_features
from perception.detection.fusion.rescoring import Fusion
from perception.detection.fusion.tri_boxes import tri_boxes
from perception.evaluation.detection.protocol import DIFFICULTIES
from perception.evaluation.detection.reliability import Reliability, measure_reliability
from perception.render.curve_plots import plot_curves, precision_panel
from perception.render.fusion_plots import plot_reliability, plot_rescoring, plot_sizes
from perception.types import Float64
from train.fusion.sweep import SweptSize

_LEVELS = np.linspace(0, 1, 11)


def plot_fusion_rescoring(path: Path, frames: DetectedFrames, fusion: Fusion) -> None:
    """Plot the expected IoUs over the three scores, at the mean of the other features of full tri-boxes."""
    mean = _mean_features(frames, fusion)
    scores = np.stack(np.meshgrid(*[_LEVELS] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    features = np.tile(mean, (len(scores), 1))
    features[:, :3] = scores
    overlaps = fusion.expected_ious(features).reshape(*[len(_LEVELS)] * 3, 3)
    plot_rescoring(path, f"Joint rescoring, {fusion.variant}", _LEVELS, overlaps)


def plot_fusion_steps(path: Path, frames: DetectedFrames, fused: FusedFrames) -> None:
    """Plot precision over recall of merged, rescored and fused boxes."""
    steps = {
        name: precision_curves(frames.truth, boxes, len(frames))
        for name, boxes in fused.steps.items()
    }
    panels = [
        precision_panel(
            one.name,
            {
                f"{name}: AP {curves[one.name].ap():.1f}": curves[one.name].precision
                for name, curves in steps.items()
                if one.name in curves
            },
        )
        for one in DIFFICULTIES
    ]
    plot_curves(path, f"Fusion step by step, {len(frames)} test frames", panels)


def plot_fusion_sizes(path: Path, swept: Sequence[SweptSize]) -> None:
    """Plot the errors of networks over their sizes."""
    one = {s.hidden[0]: (s.training, s.validation) for s in swept if len(s.hidden) == 1}
    two = {(s.hidden[0], s.hidden[1]): s.validation for s in swept if len(s.hidden) == 2}
    plot_sizes(path, "Neurons of the fusion's network", one, two)


def plot_fusion_reliability(
    path: Path, frames: DetectedFrames, fused: FusedFrames, class_names: Sequence[str]
) -> dict[str, Reliability]:
    """Plot and return the reliability of the scores of each detector and of the fusion."""
    found = {
        name: measure_reliability(class_correctness(frames, boxes, class_names))
        for name, boxes in boxes_by_detector(frames, fused).items()
    }
    plot_reliability(path, f"Scores of {len(frames)} test frames", found)
    return found


def _mean_features(frames: DetectedFrames, fusion: Fusion) -> Float64:
    """Return the (F,) means over combinations with a box of each modality; of all, where there is none."""
    means = []
    for min_boxes in (3, 1):
        for scene in frames.scenes:
            rows = tri_boxes(scene, TRI_BOX_CONFIGS[fusion.variant])
            rows = rows[(rows >= 0).sum(axis=1) >= min_boxes]
            means.append(tri_box_features(scene, rows, fusion.variant))
        if any(map(len, means)):
            break
    return np.asarray(np.concatenate(means).mean(axis=0))
