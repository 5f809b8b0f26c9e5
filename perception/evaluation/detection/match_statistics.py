"""Matches of one class at one difficulty, from which the counts at any score threshold and for any frames follow.

The official tool matches all frames again at each of 41 thresholds. But a threshold changes the matches in a group
of overlapping boxes only when it passes one of their scores. So each group is matched once with its detection of
the highest score, once with its two highest, and so on, and the change of each step is assigned to the detection
that caused it. Counts at a threshold are then sums over the detections above it, and a bootstrap resample is a
weighting of the frames in these sums.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from perception.evaluation.detection.evaluation_boxes import (
    EvaluationBoxes,
    EvaluationMask,
    evaluation_mask,
)
from perception.evaluation.detection.protocol import DetectionClass, Difficulty
from perception.evaluation.grouping import connected_groups, pairs_in_groups, ranks_in_groups
from perception.types import ArrayTable, Bool, Float64, Int

MAX_BLOCK_PAIRS = 1_000_000  # pairs that are matched at once; bounds the memory at 100 MB


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
        increments: Changes of the counts, which add up to the counts at a threshold; down to the lowest score of a
            match, the lowest threshold.
    """

    truths_of_frames: Int
    matches: MatchedScores
    increments: CountIncrements


@dataclass(frozen=True)
class MatchablePairs(ArrayTable):
    """P pairs of a label and a detection that may be matched, and what their match counts for.

    Attributes:
        truths: (P,) row of the label.
        detections: (P,) row of the detection.
        scores: (P,) score of the detection.
        worth: (P,) preference of the label: the IoU, 0 of ignored detections, among which the first is taken.
        is_true_positive: (P,) whether both are valid.
        is_found: (P,) whether the label is valid and so no false negative.
        is_cleared: (P,) whether the detection would be a false positive if unmatched.
        similarity: (P,) similarity of the headings of a true positive, 0 to 1.
    """

    truths: Int
    detections: Int
    scores: Float64
    worth: Float64
    is_true_positive: Bool
    is_found: Bool
    is_cleared: Bool
    similarity: Float64


def match_statistics(
    boxes: EvaluationBoxes, detection_class: DetectionClass, difficulty: Difficulty
) -> MatchStatistics:
    """Match the boxes of all frames for all thresholds."""
    mask = evaluation_mask(boxes, detection_class, difficulty)
    pairs = _matchable_pairs(boxes, mask, detection_class.iou)
    valid_frames = boxes.truths.frames[mask.is_valid_truth]
    # Each label is matched with the detection of the highest score, not of the largest IoU.
    by_score = pairs[np.lexsort((pairs.detections, -pairs.scores, pairs.truths))]
    groups = connected_groups(by_score.truths, by_score.detections)
    rounds = _rounds_in_groups(by_score.truths, groups)
    matched = by_score[_assign_greedily(by_score.truths, by_score.detections, rounds)]
    right = matched[matched.is_true_positive]
    matches = MatchedScores(right.scores, boxes.detections.frames[right.detections])
    # Every detection counts as a false positive, until the matches correct it.
    gains = _gains_of_detections(pairs, len(boxes.detections))
    increments = CountIncrements(
        scores=boxes.detections.scores,
        frames=boxes.detections.frames,
        true_positives=gains.true_positives,
        false_positives=mask.is_false_positive_if_unmatched - gains.cleared,
        found_truths=gains.found_truths,
        similarity=gains.similarity,
    )[mask.is_matchable_detection & (boxes.detections.scores >= right.scores.min(initial=np.inf))]
    return MatchStatistics(
        truths_of_frames=np.bincount(valid_frames, minlength=boxes.frames),
        matches=matches[np.argsort(-matches.scores)],
        increments=increments[np.argsort(-increments.scores, kind="stable")],
    )


def _matchable_pairs(
    boxes: EvaluationBoxes, mask: EvaluationMask, min_iou: float
) -> MatchablePairs:
    overlaps = boxes.overlaps
    overlaps = overlaps[
        (overlaps.iou > min_iou)
        & mask.is_matchable_truth[overlaps.truths]
        & mask.is_matchable_detection[overlaps.detections]
    ]
    truths, detections = overlaps.truths, overlaps.detections
    is_found, is_valid = mask.is_valid_truth[truths], mask.is_valid_detection[detections]
    turns_rad = boxes.truths.alphas_rad[truths] - boxes.detections.alphas_rad[detections]
    return MatchablePairs(
        truths,
        detections,
        scores=boxes.detections.scores[detections],
        worth=np.where(is_valid, overlaps.iou, 0.0),
        is_true_positive=is_found & is_valid,
        is_found=is_found,
        is_cleared=mask.is_false_positive_if_unmatched[detections],
        similarity=np.where(is_found & is_valid, (1 + np.cos(turns_rad)) / 2, 0.0),
    )


@dataclass(frozen=True)
class StepCounts(ArrayTable):
    """Counts at S steps of the threshold.

    Attributes:
        true_positives: (S,) number of valid labels matched by valid detections.
        found_truths: (S,) number of valid labels matched by any detection, which are no false negatives.
        cleared: (S,) number of matched detections that would be false positives if unmatched.
        similarity: (S,) similarity of the headings, 0 to 1, summed over the true positives.
    """

    true_positives: Int
    found_truths: Int
    cleared: Int
    similarity: Float64

    def gains(self, groups: Int) -> Self:
        """Return the difference of each row to the row before it in the same group."""
        is_same_group = np.diff(groups) == 0
        columns = [getattr(self, field.name) for field in fields(self)]
        return type(self)(*(np.append(c[:1], c[1:] - c[:-1] * is_same_group) for c in columns))


@dataclass(frozen=True)
class ThresholdSweep:
    """Groups of overlapping boxes, and the steps in which the threshold falls through each of them.

    Attributes:
        pairs: (P) pairs by group, then by label, the preferred detection of each label first.
        groups: (P,) group of each pair.
        rounds: (P,) round of the greedy assignment in which the label of each pair is assigned.
        steps: (S,) detection to whose score the threshold falls, by group, then by falling score.
        step_groups: (S,) group of each step.
        step_scores: (S,) score of each step.
        places: (P,) place of each pair's detection within its group, from 0.
    """

    pairs: MatchablePairs
    groups: Int
    rounds: Int
    steps: Int
    step_groups: Int
    step_scores: Float64
    places: Int


def _gains_of_detections(pairs: MatchablePairs, detections: int) -> StepCounts:
    """Return (D) the change of the counts when the threshold falls to the score of each detection."""
    groups = connected_groups(pairs.truths, pairs.detections)
    order = np.lexsort((pairs.detections, -pairs.worth, pairs.truths, groups))
    pairs, groups = pairs[order], groups[order]
    steps, firsts, of_pairs = np.unique(pairs.detections, return_index=True, return_inverse=True)
    fall = np.lexsort((-pairs.scores[firsts], groups[firsts]))
    sweep = ThresholdSweep(
        pairs=pairs,
        groups=groups,
        rounds=_rounds_in_groups(pairs.truths, groups),
        steps=np.asarray(steps[fall], np.int64),
        step_groups=groups[firsts][fall],
        step_scores=pairs.scores[firsts][fall],
        places=ranks_in_groups(groups[firsts])[of_pairs],
    )
    counts = StepCounts.concatenate(_count_block(sweep, block) for block in _blocks(sweep))
    zeros = np.zeros(detections, np.int64)
    nothing = StepCounts(zeros, zeros, zeros, np.zeros(detections))
    return nothing.replaced(sweep.steps, counts.gains(sweep.step_groups))


def _blocks(sweep: ThresholdSweep) -> Iterator[slice]:
    """Yield runs of steps with a bounded number of pairs."""
    pairs_of_steps = np.bincount(sweep.groups)[sweep.step_groups]
    blocks = np.cumsum(pairs_of_steps) // MAX_BLOCK_PAIRS
    ends = [*(np.flatnonzero(np.diff(blocks)) + 1).tolist(), len(blocks)]
    return (slice(start, end) for start, end in zip([0, *ends], ends, strict=False))


def _count_block(sweep: ThresholdSweep, block: slice) -> StepCounts:
    """Match each group at each of its steps, with the detections above the threshold."""
    steps, groups = sweep.steps[block], sweep.step_groups[block]
    # Each step has its own copy of its group's pairs, without those below the threshold.
    of_steps, of_pairs = pairs_in_groups(groups, sweep.groups)
    is_reached = sweep.pairs.scores[of_pairs] >= sweep.step_scores[block][of_steps]
    of_steps, of_pairs = of_steps[is_reached], of_pairs[is_reached]
    pairs = sweep.pairs[of_pairs]
    sizes = np.bincount(sweep.step_groups)[groups]
    is_matched = _assign_greedily(
        of_steps * (int(pairs.truths.max(initial=0)) + 1) + pairs.truths,
        (np.cumsum(sizes) - sizes)[of_steps] + sweep.places[of_pairs],
        sweep.rounds[of_pairs],
    )
    matched, of_steps = pairs[is_matched], of_steps[is_matched]

    def count(is_counted: Bool) -> Int:
        return np.bincount(of_steps[is_counted], minlength=len(steps))

    similarity = np.bincount(of_steps, matched.similarity, minlength=len(steps))
    return StepCounts(
        true_positives=count(matched.is_true_positive),
        found_truths=count(matched.is_found),
        cleared=count(matched.is_cleared),
        similarity=np.asarray(similarity, np.float64),
    )


def _rounds_in_groups(truths: Int, groups: Int) -> Int:
    """Return (P,) the number of labels of a pair's group that are assigned before that pair's own."""
    _, firsts, of_pairs = np.unique(truths, return_index=True, return_inverse=True)
    return ranks_in_groups(groups[firsts])[of_pairs]


def _assign_greedily(truths: Int, detections: Int, rounds: Int) -> Bool:
    """Assign to one label after the other its preferred detection among those that are still free.

    Pairs of one label are adjacent, the preferred one first. Labels of the same round must not share a detection,
    since they are assigned together. Returns the mask of the matched pairs.
    """
    is_taken = np.zeros(detections.max(initial=-1) + 1, bool)
    is_matched = np.zeros(len(truths), bool)
    for round_number in range(rounds.max(initial=-1) + 1):
        pairs = np.flatnonzero(rounds == round_number)
        pairs = pairs[~is_taken[detections[pairs]]]
        chosen = pairs[np.diff(truths[pairs], prepend=-1) != 0]
        is_matched[chosen] = True
        is_taken[detections[chosen]] = True
    return is_matched
