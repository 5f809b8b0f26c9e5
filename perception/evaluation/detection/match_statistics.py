"""Matches of one class at one difficulty, from which the counts at any score threshold and for any frames follow.

The official tool matches all frames again at each of 41 thresholds. But a threshold changes the matches in a group
of overlapping boxes only when it passes one of their scores. So each group is matched once with its detection of
the highest score, once with its two highest, and so on, and the change of each step is assigned to the detection
that caused it. Counts at a threshold are then sums over the detections above it, and a bootstrap resample is a
weighting of the frames in these sums.
"""

from dataclasses import dataclass

import numpy as np

from perception.evaluation.detection.evaluation_boxes import (
    EvaluationBoxes,
    EvaluationMask,
    OverlapPairs,
    evaluation_mask,
)
from perception.evaluation.detection.protocol import DetectionClass, Difficulty
from perception.evaluation.detection.threshold_sweep import (
    StepCounts,
    assign_greedily,
    count_at_steps,
    plan_sweep,
    rounds_in_groups,
)
from perception.evaluation.grouping import connected_groups
from perception.types import ArrayTable, Float64, Int


@dataclass(frozen=True)
class MatchedScores(ArrayTable):
    """M valid labels that are matched by a valid detection when all detections count.

    Attributes:
        scores: (M,) scores of the detections, falling.
        frames: (M,) frames.
    """

    scores: Float64
    frames: Int


@dataclass(frozen=True)
class CountIncrements(ArrayTable):
    """Changes of the counts when the threshold falls to the score of each of D detections.

    Attributes:
        scores: (D,) scores, falling.
        frames: (D,) frames.
        true_positives: (D,) valid labels matched by valid detections.
        false_positives: (D,) unmatched valid detections outside of DontCare.
        found_truths: (D,) valid labels matched by any detection, which are no false negatives.
        similarity: (D,) similarity of the headings, 0 to 1, summed over the true positives.
    """

    scores: Float64
    frames: Int
    true_positives: Int
    false_positives: Int
    found_truths: Int
    similarity: Float64


@dataclass(frozen=True)
class MatchStatistics:
    """Matches of one class at one difficulty.

    Attributes:
        truths_of_frames: (F,) number of valid labels of each frame.
        matches: Matches from whose scores the thresholds are chosen.
        increments: Changes of the counts, which add up to the counts at a threshold.
    """

    truths_of_frames: Int
    matches: MatchedScores
    increments: CountIncrements


def match_statistics(
    evaluation_boxes: EvaluationBoxes, detection_class: DetectionClass, difficulty: Difficulty
) -> MatchStatistics:
    """Match the boxes of all frames for all thresholds."""
    mask = evaluation_mask(evaluation_boxes, detection_class, difficulty)
    overlaps = evaluation_boxes.overlaps
    pairs_to_match = overlaps[
        (overlaps.iou > detection_class.iou)
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
    """Match each label with the detection of the highest score, not of the largest IoU."""
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
    """Count every detection as a false positive, then correct the counts by the matches."""
    sweep = plan_sweep(evaluation_boxes, mask, pairs_to_match)
    gains = count_at_steps(evaluation_boxes, mask, sweep).gains(sweep.step_groups)
    detections, count = evaluation_boxes.detections, len(evaluation_boxes.detections)
    zeros = np.zeros(count, np.int64)
    gained = StepCounts(zeros, zeros, zeros, np.zeros(count)).replaced(sweep.steps, gains)
    increments = CountIncrements(
        scores=detections.scores,
        frames=detections.frames,
        true_positives=gained.true_positives,
        false_positives=mask.is_false_positive_if_unmatched - gained.cleared,
        found_truths=gained.found_truths,
        similarity=gained.similarity,
    )[mask.is_matchable_detection]
    return increments[np.argsort(-increments.scores, kind="stable")]
