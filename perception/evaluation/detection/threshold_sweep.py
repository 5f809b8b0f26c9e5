"""Counts of matches at every score threshold, in each group of overlapping boxes by itself.

Labels choose in the order of the official tool, for all frames at once: those of one round share no detection.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from perception.evaluation.detection.evaluation_boxes import (
    EvaluationBoxes,
    EvaluationMask,
    OverlapPairs,
)
from perception.evaluation.grouping import connected_groups, pairs_in_groups, ranks_in_groups
from perception.types import ArrayTable, Bool, Float64, Int

MAX_BLOCK_PAIRS = 1_000_000  # pairs that are matched at once; bounds the memory at 100 MB


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
    evaluation_boxes: EvaluationBoxes, mask: EvaluationMask, pairs_to_match: OverlapPairs
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
    fall = np.lexsort((-evaluation_boxes.detections.scores[detections], detection_groups))
    places = np.zeros(len(evaluation_boxes.detections), np.int64)
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
    evaluation_boxes: EvaluationBoxes, mask: EvaluationMask, sweep: ThresholdSweep
) -> StepCounts:
    """Match each group at each of its steps, with the detections above the threshold."""
    blocks = (_count_block(evaluation_boxes, mask, sweep, block) for block in _blocks(sweep))
    return StepCounts.concatenate(blocks)


def _blocks(sweep: ThresholdSweep) -> Iterator[slice]:
    """Yield runs of steps with a bounded number of pairs."""
    pairs_of_steps = np.bincount(sweep.groups)[sweep.step_groups]
    blocks = np.cumsum(pairs_of_steps) // MAX_BLOCK_PAIRS
    ends = [*(np.flatnonzero(np.diff(blocks)) + 1).tolist(), len(blocks)]
    return (slice(start, end) for start, end in zip([0, *ends], ends, strict=False))


def _count_block(
    evaluation_boxes: EvaluationBoxes, mask: EvaluationMask, sweep: ThresholdSweep, block: slice
) -> StepCounts:
    scores = evaluation_boxes.detections.scores
    steps, groups = sweep.steps[block], sweep.step_groups[block]
    # Each step has its own copy of its group's pairs, without those below the threshold.
    of_steps, of_pairs = pairs_in_groups(groups, sweep.groups)
    is_reached = scores[sweep.pairs.detections[of_pairs]] >= scores[steps][of_steps]
    of_steps, of_pairs = of_steps[is_reached], of_pairs[is_reached]
    pairs = sweep.pairs[of_pairs]
    sizes = np.bincount(sweep.step_groups)[groups]
    is_matched = assign_greedily(
        truths=of_steps * len(evaluation_boxes.truths) + pairs.truths,
        detections=(np.cumsum(sizes) - sizes)[of_steps] + sweep.places[pairs.detections],
        rounds=sweep.rounds[of_pairs],
    )
    return _count(evaluation_boxes, mask, pairs[is_matched], of_steps[is_matched], len(steps))


def _count(
    evaluation_boxes: EvaluationBoxes,
    mask: EvaluationMask,
    matched: OverlapPairs,
    of_steps: Int,
    steps: int,
) -> StepCounts:
    is_found = mask.is_valid_truth[matched.truths]
    is_correct = is_found & mask.is_valid_detection[matched.detections]
    is_cleared = mask.is_false_positive_if_unmatched[matched.detections]
    heading_errors_rad = (
        evaluation_boxes.truths.alphas_rad[matched.truths]
        - evaluation_boxes.detections.alphas_rad[matched.detections]
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
