"""Figures of a trained fusion: Figs. 7.12, 7.13 and 7.14, precision over recall, and reliability of the scores."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from data.detections.detected_frames import DetectedFrames
from data.detections.fused_frames import FusedFrames, boxes_by_detector, precision_curves
from perception.detection.fusion.features import tri_box_features
from perception.detection.fusion.rescoring import Fusion
from perception.evaluation.detection.box_rows import DetectedBoxes
from perception.evaluation.detection.protocol import LEVELS
from perception.evaluation.detection.reliability import Reliability
from perception.render.curve_plots import curve_figure, precision_panel
from perception.render.fusion_plots import reliability_figure, rescoring_figure, sizes_figure
from perception.types import Float64
from train.fusion.sweep import SweptSize

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SCORES = np.linspace(0, 1, 11)


def fusion_figures(
    frames: DetectedFrames,
    fusion: Fusion,
    fused: FusedFrames,
    reliability: Mapping[str, Reliability],
    swept: Sequence[SweptSize] = (),
) -> "dict[str, Figure]":
    """Return all figures by name.

    Args:
        frames: Test frames.
        fusion: Network.
        fused: Frames fused by the network.
        reliability: Reliability of the scores of each detector and of the fusion.
        swept: Errors of the sizes that were tried.
    """
    count = f"{len(frames)} test frames"
    figures = {
        "rescoring": _rescoring(frames, fusion),
        # As in Fig. 7.14, the last step is the solid line.
        "steps": _precision(
            f"Fusion step by step, {count}", frames, dict(reversed(fused.steps.items()))
        ),
        "precision": _precision(
            f"Detectors and fusion, {count}", frames, boxes_by_detector(frames, fused)
        ),
        "reliability": reliability_figure(f"Scores of {count}", reliability),
    }
    return figures | ({"sizes": _sizes(swept)} if swept else {})


def _rescoring(frames: DetectedFrames, fusion: Fusion) -> "Figure":
    """Return the new scores over the three scores, at the mean of the other features of full tri-boxes."""
    scores = np.stack(np.meshgrid(*[_SCORES] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    features = np.tile(_mean_features(frames, fusion), (len(scores), 1))
    features[:, :3] = scores
    rescored = fusion.predict(features).reshape(*[len(_SCORES)] * 3, 3)
    return rescoring_figure(f"Joint rescoring, {fusion.variant}", _SCORES, rescored)


def _precision(
    title: str, frames: DetectedFrames, detections: Mapping[str, DetectedBoxes]
) -> "Figure":
    """Return precision over recall of each of several sets of boxes, a panel for each difficulty."""
    curves = {
        name: precision_curves(frames.truth, boxes, len(frames))
        for name, boxes in detections.items()
    }
    panels = [
        precision_panel(
            level,
            {
                f"{name}: AP {found[level].ap():.1f}": found[level].precision
                for name, found in curves.items()
                if level in found
            },
        )
        for level in LEVELS
    ]
    return curve_figure(title, panels)


def _sizes(swept: Sequence[SweptSize]) -> "Figure":
    """Return the errors of networks over their sizes."""
    one = {s.hidden[0]: (s.training, s.validation) for s in swept if len(s.hidden) == 1}
    two = {(s.hidden[0], s.hidden[1]): s.validation for s in swept if len(s.hidden) == 2}
    return sizes_figure("Neurons of the fusion's network", one, two)


def _mean_features(frames: DetectedFrames, fusion: Fusion) -> Float64:
    """Return the (F,) means over combinations with a box of each modality; of all, where there is none."""
    means = []
    for min_boxes in (3, 1):
        for scene in frames.scenes:
            rows = fusion.combinations(scene)
            rows = rows[(rows >= 0).sum(axis=1) >= min_boxes]
            means.append(tri_box_features(scene, rows, fusion.variant))
        if any(map(len, means)):
            break
    return np.asarray(np.concatenate(means).mean(axis=0))
