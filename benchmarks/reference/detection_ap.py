"""Reference implementation of KITTI's average precision: frame by frame, box by box.

It gives what the fast function must give, as the protocol describes it: every frame is matched once to find the
thresholds and once again at each of them.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.reference.overlap import (
    Prism,
    area,
    shared_area,
    shared_volume,
    turned_rectangle,
    volume,
)
from perception.evaluation.detection.average_precision import PrecisionCurve
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.overlap_metric import IMAGE, SPACE, OverlapMetric
from perception.evaluation.detection.protocol import DetectionClass, Difficulty

Shape = list[float] | Prism

_OUT, _IGNORED, _COUNTED = range(3)


@dataclass(frozen=True)
class _Box:
    status: int
    shape: Shape
    alpha_rad: float
    score: float = 0.0


@dataclass(frozen=True)
class _Frame:
    truths: list[_Box]
    detections: list[_Box]
    dont_care: list[Shape]


def reference_curve(
    truths: TrueBoxes,
    detections: DetectedBoxes,
    frames: int,
    of_class: DetectionClass,
    difficulty: Difficulty,
    metric: OverlapMetric[Any] = IMAGE,
) -> PrecisionCurve:
    """Draw the precision curve of one class at one difficulty."""
    scene = []
    for number in range(frames):
        labelled, found = truths[truths.frames == number], detections[detections.frames == number]
        shapes = _shapes(labelled, metric)
        scene.append(
            _Frame(
                _classify_truths(labelled, of_class, difficulty, metric),
                _classify_detections(found, of_class, difficulty, metric),
                [s for s, k in zip(shapes, labelled.types, strict=True) if k.lower() == "dontcare"],
            )
        )
    valid = sum(truth.status == _COUNTED for frame in scene for truth in frame.truths)
    scores = [score for frame in scene for score in _found_scores(frame, of_class.iou)]
    thresholds = reference_thresholds(scores, valid)
    counts = np.zeros((len(thresholds), 4))
    for row, threshold in enumerate(thresholds):
        for frame in scene:
            counts[row] += _count(frame, of_class.iou, threshold)
    right, wrong, missed, similarity = counts.T.tolist() if thresholds else ([], [], [], [])
    return PrecisionCurve(
        truths=valid,
        matches=len(scores),
        thresholds=np.array(thresholds),
        true_positives=np.array(right),
        false_positives=np.array(wrong),
        false_negatives=np.array(missed),
        precision=np.array(_envelope(right, right, wrong)),
        orientation_similarity=np.array(_envelope(similarity, right, wrong)),
    )


def reference_thresholds(scores: list[float], truths: int) -> list[float]:
    """Walk down the scores; keep one wherever the recall comes nearest to the next of 41 steps."""
    falling = sorted(scores, reverse=True)
    thresholds, recall = [], 0.0
    for number, score in enumerate(falling, start=1):
        is_last = number == len(falling)
        here = number / truths
        after = here if is_last else (number + 1) / truths
        if not is_last and after - recall < recall - here:
            continue
        thresholds.append(score)
        recall += 1 / 40.0
    return thresholds


def _shapes(rows: TrueBoxes | DetectedBoxes, metric: OverlapMetric[Any]) -> list[Shape]:
    """Return what the metric compares; from above, all prisms have the same height."""
    if metric is IMAGE:
        return list(rows.boxes_px.tolist())
    shapes: list[Shape] = []
    for bottom, size, yaw in zip(*vars(rows.boxes_3d).values(), strict=True):
        length, width, height = size.tolist()
        corners = turned_rectangle((bottom[0], bottom[1]), length, width, yaw)
        heights = (bottom[2], bottom[2] + height) if metric is SPACE else (0.0, 1.0)
        shapes.append(Prism(corners, *heights))
    return shapes


def _size(shape: Shape) -> float:
    return volume(shape) if isinstance(shape, Prism) else area(shape)


def _shared(a: Shape, b: Shape) -> float:
    if isinstance(a, Prism) and isinstance(b, Prism):
        return shared_volume(a, b)
    assert not isinstance(a, Prism)
    assert not isinstance(b, Prism)
    return shared_area(a, b)


def _iou(a: Shape, b: Shape) -> float:
    shared = _shared(a, b)
    return shared / (_size(a) + _size(b) - shared) if shared else 0.0


def _classify_truths(
    truths: TrueBoxes, of_class: DetectionClass, difficulty: Difficulty, metric: OverlapMetric[Any]
) -> list[_Box]:
    boxes, shapes = [], _shapes(truths, metric)
    for row, kind in enumerate(truths.types.tolist()):
        edges = truths.boxes_px[row].tolist()
        status = _OUT
        if kind.lower() == of_class.name.lower():
            is_hidden = (
                truths.occlusion[row] > difficulty.max_occlusion
                or truths.truncation[row] > difficulty.max_truncation
                or edges[3] - edges[1] <= difficulty.min_height_px
            )
            status = _IGNORED if is_hidden else _COUNTED
        elif kind.lower() in [name.lower() for name in of_class.neighbours]:
            status = _IGNORED
        boxes.append(_Box(status, shapes[row], float(truths.alphas_rad[row])))
    return boxes


def _classify_detections(
    detections: DetectedBoxes,
    of_class: DetectionClass,
    difficulty: Difficulty,
    metric: OverlapMetric[Any],
) -> list[_Box]:
    boxes, shapes = [], _shapes(detections, metric)
    for row, kind in enumerate(detections.types.tolist()):
        edges = detections.boxes_px[row].tolist()
        status = _OUT
        if abs(edges[1] - edges[3]) < difficulty.min_height_px:
            status = _IGNORED
        elif kind.lower() == of_class.name.lower():
            status = _COUNTED
        alpha_rad, score = float(detections.alphas_rad[row]), float(detections.scores[row])
        boxes.append(_Box(status, shapes[row], alpha_rad, score))
    return boxes


def _found_scores(frame: _Frame, limit: float) -> list[float]:
    """Let each truth take the surest detection of all."""
    taken: set[int] = set()
    scores = []
    for truth in frame.truths:
        best = None
        for number, detection in enumerate(frame.detections):
            if not _may_match(truth, detection, limit) or number in taken:
                continue
            if best is None or detection.score > frame.detections[best].score:
                best = number
        if best is not None:
            taken.add(best)
            if truth.status == frame.detections[best].status == _COUNTED:
                scores.append(frame.detections[best].score)
    return scores


def _count(frame: _Frame, limit: float, threshold: float) -> tuple[int, int, int, float]:
    """Return right, wrong and missed, and the similarity of headings, at a threshold."""
    right, missed, similarity = 0, 0, 0.0
    taken: set[int] = set()
    for truth in frame.truths:
        best = _best_fit(frame, truth, limit, threshold, taken)
        if best is None:
            missed += truth.status == _COUNTED
            continue
        taken.add(best)
        detection = frame.detections[best]
        if truth.status == detection.status == _COUNTED:
            right += 1
            similarity += (1 + math.cos(truth.alpha_rad - detection.alpha_rad)) / 2
    wrong = 0
    for number, detection in enumerate(frame.detections):
        is_left = detection.status == _COUNTED and number not in taken
        if is_left and detection.score >= threshold:
            covered = [_shared(detection.shape, region) for region in frame.dont_care]
            wrong += not any(c > 0 and c > limit * _size(detection.shape) for c in covered)
    return right, wrong, missed, similarity


def _best_fit(
    frame: _Frame, truth: _Box, limit: float, threshold: float, taken: set[int]
) -> int | None:
    """Return the counted detection of the greatest overlap, else the first ignored one."""
    best, first_ignored, best_iou = None, None, 0.0
    for number, detection in enumerate(frame.detections):
        if number in taken or detection.score < threshold:
            continue
        if not _may_match(truth, detection, limit):
            continue
        if detection.status == _IGNORED:
            first_ignored = number if first_ignored is None else first_ignored
        elif _iou(truth.shape, detection.shape) > best_iou:
            best, best_iou = number, _iou(truth.shape, detection.shape)
    return first_ignored if best is None else best


def _may_match(truth: _Box, detection: _Box, limit: float) -> bool:
    if _OUT in (truth.status, detection.status):
        return False
    return _iou(truth.shape, detection.shape) > limit


def _envelope(part: list[float], right: list[float], wrong: list[float]) -> list[float]:
    ratios = [p / (r + w) if r + w else 0.0 for p, r, w in zip(part, right, wrong, strict=True)]
    ratios += [0.0] * (41 - len(ratios))
    return [max(ratios[place:]) for place in range(41)]
