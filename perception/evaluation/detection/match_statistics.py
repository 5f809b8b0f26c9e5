"""What one class at one difficulty comes to at any threshold of score, on any choice of frames.

The official tool matches all frames again at each of 41 thresholds. But a threshold changes nothing in a
group of rival boxes as long as it passes none of their scores. So each group is matched once with its
surest detection, once with its two surest, and so on; what each step changes is booked on the detection
that made it. Counts at a threshold are then sums over the detections above it, and to take a frame twice,
or not at all, is to weigh what is booked on it.
"""

from dataclasses import dataclass

import numpy as np

from perception.evaluation.detection.evaluation_boxes import (
    EvaluationBoxes,
    EvaluationMask,
    OverlapPairs,
    evaluation_mask,
)
from perception.evaluation.detection.greedy_assignment import (
    assign_greedily,
    connected_groups,
    rounds_in_groups,
)
from perception.evaluation.detection.protocol import DetectionClass, Difficulty
from perception.evaluation.detection.threshold_sweep import count_at_steps, plan_sweep
from perception.evaluation.rows import Rows
from perception.types import Float64, Int


@dataclass(frozen=True)
class MatchedScores(Rows):
    """Valid truths that a normal detection is found for when all detections count.

    Attributes:
        scores: of the detections, falling.
        frames: of both.
    """

    scores: Float64
    frames: Int


@dataclass(frozen=True)
class CountIncrements(Rows):
    """By how much each detection changes the counts when the threshold falls to its score.

    Attributes:
        scores: falling.
        frames: of the detections.
        true_positives: valid truths matched by normal detections.
        false_positives: normal detections that are left over, outside of DontCare.
        found_truths: valid truths matched by any detection, so that they are not missed.
        similarity: of the headings, 0 to 1, summed over the true positives.
    """

    scores: Float64
    frames: Int
    true_positives: Int
    false_positives: Int
    found_truths: Int
    similarity: Float64


@dataclass(frozen=True)
class MatchStatistics:
    """One class at one difficulty.

    Attributes:
        truths_of_frames: (F,) valid truths of each frame.
        matches: from which the thresholds are chosen.
        increments: which add up to the counts at a threshold.
    """

    truths_of_frames: Int
    matches: MatchedScores
    increments: CountIncrements


def match_statistics(
    evaluation_boxes: EvaluationBoxes, of_class: DetectionClass, difficulty: Difficulty
) -> MatchStatistics:
    """Match the boxes of all frames, so that any threshold and any choice of frames can be counted."""
    mask = evaluation_mask(evaluation_boxes, of_class, difficulty)
    overlaps = evaluation_boxes.overlaps
    pairs_to_match = overlaps[
        (overlaps.iou > of_class.iou)
        & mask.is_matchable_truth[overlaps.truths]
        & mask.is_matchable_detection[overlaps.detections]
    ]
    valid_frames = evaluation_boxes.truths.frames[mask.is_valid_truth]
    return MatchStatistics(
        truths_of_frames=np.bincount(valid_frames, minlength=evaluation_boxes.frames),
        matches=_match_by_score(evaluation_boxes, mask, pairs_to_match),
        increments=_count_increments(evaluation_boxes, mask, pairs_to_match),
    )


def _match_by_score(
    evaluation_boxes: EvaluationBoxes, mask: EvaluationMask, pairs_to_match: OverlapPairs
) -> MatchedScores:
    """Let each truth take the surest of all detections, not the one that fits best."""
    scores = evaluation_boxes.detections.scores[pairs_to_match.detections]
    pairs = pairs_to_match[np.lexsort((pairs_to_match.detections, -scores, pairs_to_match.truths))]
    rounds = rounds_in_groups(pairs.truths, connected_groups(pairs.truths, pairs.detections))
    matched = pairs[assign_greedily(pairs.truths, pairs.detections, rounds)]
    both = mask.is_valid_truth[matched.truths] & mask.is_valid_detection[matched.detections]
    detections = matched.detections[both]
    matches = MatchedScores(
        evaluation_boxes.detections.scores[detections],
        evaluation_boxes.detections.frames[detections],
    )
    return matches[np.argsort(-matches.scores)]


def _count_increments(
    evaluation_boxes: EvaluationBoxes, mask: EvaluationMask, pairs_to_match: OverlapPairs
) -> CountIncrements:
    """Let every detection be wrong for itself, then correct this by what the matching gains."""
    sweep = plan_sweep(evaluation_boxes, mask, pairs_to_match)
    gains = count_at_steps(evaluation_boxes, mask, sweep).gains(sweep.step_groups)
    detections, count = evaluation_boxes.detections, len(evaluation_boxes.detections)
    cleared = np.zeros(count, np.int64)
    true_positives, found_truths = np.zeros(count, np.int64), np.zeros(count, np.int64)
    similarity = np.zeros(count)
    true_positives[sweep.steps] = gains.true_positives
    found_truths[sweep.steps] = gains.found_truths
    cleared[sweep.steps] = gains.cleared
    similarity[sweep.steps] = gains.similarity
    increments = CountIncrements(
        scores=detections.scores,
        frames=detections.frames,
        true_positives=true_positives,
        false_positives=mask.is_false_positive_if_unmatched - cleared,
        found_truths=found_truths,
        similarity=similarity,
    )[mask.is_matchable_detection]
    return increments[np.argsort(-increments.scores, kind="stable")]
