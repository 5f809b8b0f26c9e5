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
    OverlapPairs,
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
        increments: Changes of the counts, which add up to the counts at a threshold.
    """

    truths_of_frames: Int
    matches: MatchedScores
    increments: CountIncrements


def match_statistics(
    boxes: EvaluationBoxes, detection_class: DetectionClass, difficulty: Difficulty
) -> MatchStatistics:
    """Match the boxes of all frames for all thresholds."""
    mask = evaluation_mask(boxes, detection_class, difficulty)
    overlaps = boxes.overlaps
    pairs_to_match = overlaps[
        (overlaps.iou > detection_class.iou)
        & mask.is_matchable_truth[overlaps.truths]
        & mask.is_matchable_detection[overlaps.detections]
    ]
    valid_frames = boxes.truths.frames[mask.is_valid_truth]
    return MatchStatistics(
        truths_of_frames=np.bincount(valid_frames, minlength=boxes.frames),
        matches=_match_by_score(boxes, mask, pairs_to_match),
        increments=_count_increments(boxes, mask, pairs_to_match),
    )


def _match_by_score(
    boxes: EvaluationBoxes, mask: EvaluationMask, pairs_to_match: OverlapPairs
) -> MatchedScores:
    """Match each label with the detection of the highest score, not of the largest IoU."""
    scores = boxes.detections.scores[pairs_to_match.detections]
    pairs = pairs_to_match[np.lexsort((pairs_to_match.detections, -scores, pairs_to_match.truths))]
    rounds = rounds_in_groups(pairs.truths, connected_groups(pairs.truths, pairs.detections))
    matched = pairs[assign_greedily(pairs.truths, pairs.detections, rounds)]
    both = mask.is_valid_truth[matched.truths] & mask.is_valid_detection[matched.detections]
    detections = matched.detections[both]
    matches = MatchedScores(
        boxes.detections.scores[detections],
        boxes.detections.frames[detections],
    )
    return matches[np.argsort(-matches.scores)]


def _count_increments(
    boxes: EvaluationBoxes, mask: EvaluationMask, pairs_to_match: OverlapPairs
) -> CountIncrements:
    """Count every detection as a false positive, then correct the counts by the matches."""
    sweep = plan_sweep(boxes, mask, pairs_to_match)
    gains = count_at_steps(boxes, mask, sweep).gains(sweep.step_groups)
    detections, count = boxes.detections, len(boxes.detections)
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
        places: (D,) place of each detection within its group, from 0.
    """

    pairs: OverlapPairs
    groups: Int
    rounds: Int
    steps: Int
    step_groups: Int
    places: Int


def plan_sweep(
    boxes: EvaluationBoxes, mask: EvaluationMask, pairs_to_match: OverlapPairs
) -> ThresholdSweep:
    """Order the pairs by preference: largest IoU first, ignored detections last."""
    groups = connected_groups(pairs_to_match.truths, pairs_to_match.detections)
    is_valid_detection = mask.is_valid_detection[pairs_to_match.detections]
    # Among ignored detections the order does not matter to the official tool: it takes the first.
    worth = np.where(is_valid_detection, pairs_to_match.iou, 0.0)
    order = np.lexsort((pairs_to_match.detections, -worth, pairs_to_match.truths, groups))
    pairs, groups = pairs_to_match[order], groups[order]
    detections, firsts = np.unique(pairs.detections, return_index=True)
    detection_groups = groups[firsts]
    fall = np.lexsort((-boxes.detections.scores[detections], detection_groups))
    places = np.zeros(len(boxes.detections), np.int64)
    places[detections] = ranks_in_groups(detection_groups)
    return ThresholdSweep(
        pairs=pairs,
        groups=groups,
        rounds=rounds_in_groups(pairs.truths, groups),
        steps=np.asarray(detections[fall], np.int64),
        step_groups=detection_groups[fall],
        places=places,
    )


def count_at_steps(
    boxes: EvaluationBoxes, mask: EvaluationMask, sweep: ThresholdSweep
) -> StepCounts:
    """Match each group at each of its steps, with the detections above the threshold."""
    blocks = (_count_block(boxes, mask, sweep, block) for block in _blocks(sweep))
    return StepCounts.concatenate(blocks)


def _blocks(sweep: ThresholdSweep) -> Iterator[slice]:
    """Yield runs of steps with a bounded number of pairs."""
    pairs_of_steps = np.bincount(sweep.groups)[sweep.step_groups]
    blocks = np.cumsum(pairs_of_steps) // MAX_BLOCK_PAIRS
    ends = [*(np.flatnonzero(np.diff(blocks)) + 1).tolist(), len(blocks)]
    return (slice(start, end) for start, end in zip([0, *ends], ends, strict=False))


def _count_block(
    boxes: EvaluationBoxes, mask: EvaluationMask, sweep: ThresholdSweep, block: slice
) -> StepCounts:
    scores = boxes.detections.scores
    steps, groups = sweep.steps[block], sweep.step_groups[block]
    # Each step has its own copy of its group's pairs, without those below the threshold.
    of_steps, of_pairs = pairs_in_groups(groups, sweep.groups)
    is_reached = scores[sweep.pairs.detections[of_pairs]] >= scores[steps][of_steps]
    of_steps, of_pairs = of_steps[is_reached], of_pairs[is_reached]
    pairs = sweep.pairs[of_pairs]
    sizes = np.bincount(sweep.step_groups)[groups]
    is_matched = assign_greedily(
        truths=of_steps * len(boxes.truths) + pairs.truths,
        detections=(np.cumsum(sizes) - sizes)[of_steps] + sweep.places[pairs.detections],
        rounds=sweep.rounds[of_pairs],
    )
    return _count(boxes, mask, pairs[is_matched], of_steps[is_matched], len(steps))


def _count(
    boxes: EvaluationBoxes,
    mask: EvaluationMask,
    matched: OverlapPairs,
    of_steps: Int,
    steps: int,
) -> StepCounts:
    is_found = mask.is_valid_truth[matched.truths]
    is_correct = is_found & mask.is_valid_detection[matched.detections]
    is_cleared = mask.is_false_positive_if_unmatched[matched.detections]
    heading_errors_rad = (
        boxes.truths.alphas_rad[matched.truths] - boxes.detections.alphas_rad[matched.detections]
    )
    similarity = np.where(is_correct, (1 + np.cos(heading_errors_rad)) / 2, 0.0)
    return StepCounts(
        true_positives=np.bincount(of_steps[is_correct], minlength=steps),
        found_truths=np.bincount(of_steps[is_found], minlength=steps),
        cleared=np.bincount(of_steps[is_cleared], minlength=steps),
        similarity=np.asarray(np.bincount(of_steps, similarity, minlength=steps), np.float64),
    )


def rounds_in_groups(truths: Int, groups: Int) -> Int:
    """Return (P,) the number of labels of a pair's group that are assigned before that pair's own."""
    _, firsts, of_pairs = np.unique(truths, return_index=True, return_inverse=True)
    return ranks_in_groups(groups[firsts])[of_pairs]


def assign_greedily(truths: Int, detections: Int, rounds: Int) -> Bool:
    """Assign to one label after the other its preferred detection among those that are still free.

    Labels of the same round must not share a detection, since they are assigned together.

    Args:
        truths: (P,) label of each pair; the pairs of one label are adjacent, the preferred one first.
        detections: (P,) detection of each pair, numbered from 0.
        rounds: (P,) round in which the label is assigned, from 0.

    Returns:
        (P,) mask of the matched pairs.
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
