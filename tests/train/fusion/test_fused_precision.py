"""What the fusion is worth on simulated detectors, whole and with modalities lost."""

from itertools import combinations

import pytest

from data.detections.fused_frames import curves_by_detector, fuse_frames, precision_curves
from perception.evaluation.detection.box_rows import DetectedBoxes
from perception.types import MODALITIES
from tests.simulated_detectors import simulated_frames


@pytest.fixture(scope="module")
def frames():
    return simulated_frames(80, 3)


def moderate(frames, detections: DetectedBoxes) -> float:
    return precision_curves(frames.truth, detections, len(frames))["moderate"].ap()


def test_the_fusion_beats_the_best_modality_at_every_difficulty(frames, fitted):
    curves = curves_by_detector(frames, fuse_frames(frames.scenes, fitted))
    assert list(curves) == [*MODALITIES, "fusion"]
    for difficulty in ("easy", "moderate", "hard"):
        best = max(curves[name][difficulty].ap() for name in MODALITIES)
        assert curves["fusion"][difficulty].ap() > best + 1.05


DROPPED_MODALITIES = [lost for count in (1, 2) for lost in combinations(MODALITIES, count)]


@pytest.mark.parametrize("lost", DROPPED_MODALITIES)
def test_a_loss_is_graceful(frames, fitted, lost):
    left = frames.without(*lost)
    found = fuse_frames(left.scenes, fitted)
    best = max(moderate(left, left.of_modality(name)) for name in MODALITIES if name not in lost)
    is_alone = len(lost) == 2
    assert moderate(left, found.boxes) >= best - (1e-9 if is_alone else 2)


def test_boxes_are_one_of_each_object_in_the_last_step(frames, fitted):
    steps = fuse_frames(frames.scenes, fitted).steps
    merged, rescored, fused = (moderate(frames, boxes) for boxes in steps.values())
    assert list(steps) == ["merged", "rescored", "fused"]
    # All boxes of an object have the same score until they are blended.
    assert len(steps["merged"]) == len(steps["rescored"]) > len(steps["fused"])
    assert fused > max(merged, rescored) + 5
