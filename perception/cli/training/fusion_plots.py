"""What `trifuse train fusion` draws: Figs. 7.12, 7.13, 7.14, and how far scores are to be believed."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from data.detections.detected_frames import DetectedFrames
from data.detections.fused_frames import (
    FusedFrames,
    boxes_beside,
    judged,
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

if TYPE_CHECKING:
    from train.fusion.sweep import SweptSize

_LEVELS = np.linspace(0, 1, 11)


def draw_rescoring(path: Path, frames: DetectedFrames, fusion: Fusion) -> None:
    """Draw the expected overlaps over the three scores, all else as it is in the mean of full tri-boxes."""
    usual = _usual_features(frames, fusion)
    scores = np.stack(np.meshgrid(*[_LEVELS] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    features = np.tile(usual, (len(scores), 1))
    features[:, :3] = scores
    overlaps = fusion.expected_ious(features).reshape(*[len(_LEVELS)] * 3, 3)
    plot_rescoring(path, f"Joint rescoring, {fusion.variant}", _LEVELS, overlaps)


def draw_steps(path: Path, frames: DetectedFrames, fused: FusedFrames) -> None:
    """Draw precision and recall of merged boxes, of rescored ones, and of what is left."""
    steps = {
        name: precision_curves(frames.truth, boxes, len(frames))
        for name, boxes in fused.steps.items()
    }
    panels = [
        precision_panel(
            one.name,
            {
                f"{name}, AP {curves[one.name].ap():.1f}": curves[one.name].precision
                for name, curves in steps.items()
                if one.name in curves
            },
        )
        for one in DIFFICULTIES
    ]
    plot_curves(path, f"Fusion step by step, {len(frames)} frames kept apart", panels)


def draw_sizes(path: Path, swept: Sequence["SweptSize"]) -> None:
    """Draw the errors of networks over their sizes."""
    one = {s.hidden[0]: (s.training, s.validation) for s in swept if len(s.hidden) == 1}
    two = {(s.hidden[0], s.hidden[1]): s.validation for s in swept if len(s.hidden) == 2}
    plot_sizes(path, "Neurons of the fusion's network", one, two)


def draw_reliability(
    path: Path, frames: DetectedFrames, fused: FusedFrames, class_names: Sequence[str]
) -> dict[str, Reliability]:
    """Draw and return how often boxes are right over each detector's scores and over those of the fusion."""
    found = {
        name: measure_reliability(judged(frames, boxes, class_names))
        for name, boxes in boxes_beside(frames, fused).items()
    }
    plot_reliability(path, f"Scores of {len(frames)} frames kept apart", found)
    return found


def _usual_features(frames: DetectedFrames, fusion: Fusion) -> Float64:
    """Return (F,) means over combinations with a box of every modality; of all, where there is none."""
    means = []
    for min_boxes in (3, 1):
        for scene in frames.scenes:
            rows = tri_boxes(scene, TRI_BOX_CONFIGS[fusion.variant])
            rows = rows[(rows >= 0).sum(axis=1) >= min_boxes]
            means.append(tri_box_features(scene, rows, fusion.variant))
        if any(map(len, means)):
            break
    return np.asarray(np.concatenate(means).mean(axis=0))
