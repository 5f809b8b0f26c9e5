"""Reference implementation of KITTI's average precision: frame by frame, box by box.

It gives what the fast function must give, as the protocol describes it: every frame is matched once to find the
thresholds and once again at each of them.
"""

import math
from dataclasses import dataclass

import numpy as np

from benchmarks.reference.overlap import area, iou, shared_area
from perception.evaluation.detection.average_precision import PrecisionCurve
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.protocol import DetectionClass, Difficulty

_OUT, _IGNORED, _COUNTED = range(3)


@dataclass(frozen=True)
class _Box:
    status: int
    edges: list[float]
    alpha_rad: float
    score: float = 0.0


@dataclass(frozen=True)
class _Frame:
    truths: list[_Box]
    detections: list[_Box]
    dont_care: list[list[float]]


def reference_curve(
    truths: TrueBoxes,
    detections: DetectedBoxes,
    frames: int,
    of_class: DetectionClass,
    difficulty: Difficulty,
) -> PrecisionCurve:
    """Draw the precision curve of one class at one difficulty."""
    scene = [
        _Frame(
            _classify_truths(truths[truths.frames == frame], of_class, difficulty),
            _classify_detections(detections[detections.frames == frame], of_class, difficulty),
            [
                box
                for box, kind in zip(
                    truths.boxes_px[truths.frames == frame].tolist(),
                    truths.types[truths.frames == frame].tolist(),
                    strict=True,
                )
                if kind.lower() == "dontcare"
            ],
        )
        for frame in range(frames)
    ]
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


def _classify_truths(
    truths: TrueBoxes, of_class: DetectionClass, difficulty: Difficulty
) -> list[_Box]:
    boxes = []
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
        boxes.append(_Box(status, edges, float(truths.alphas_rad[row])))
    return boxes


def _classify_detections(
    detections: DetectedBoxes, of_class: DetectionClass, difficulty: Difficulty
) -> list[_Box]:
    boxes = []
    for row, kind in enumerate(detections.types.tolist()):
        edges = detections.boxes_px[row].tolist()
        status = _OUT
        if abs(edges[1] - edges[3]) < difficulty.min_height_px:
            status = _IGNORED
        elif kind.lower() == of_class.name.lower():
            status = _COUNTED
        alpha_rad, score = float(detections.alphas_rad[row]), float(detections.scores[row])
        boxes.append(_Box(status, edges, alpha_rad, score))
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
            covered = max((shared_area(detection.edges, box) for box in frame.dont_care), default=0)
            wrong += covered <= limit * area(detection.edges)
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
        elif iou(truth.edges, detection.edges) > best_iou:
            best, best_iou = number, iou(truth.edges, detection.edges)
    return first_ignored if best is None else best


def _may_match(truth: _Box, detection: _Box, limit: float) -> bool:
    if _OUT in (truth.status, detection.status):
        return False
    return iou(truth.edges, detection.edges) > limit


def _envelope(part: list[float], right: list[float], wrong: list[float]) -> list[float]:
    ratios = [p / (r + w) if r + w else 0.0 for p, r, w in zip(part, right, wrong, strict=True)]
    ratios += [0.0] * (41 - len(ratios))
    return [max(ratios[place:]) for place in range(41)]
