"""How many are found while the threshold of score falls, in each group of rival boxes for itself."""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from perception.evaluation.detection.evaluation_boxes import (
    EvaluationBoxes,
    EvaluationMask,
    OverlapPairs,
)
from perception.evaluation.detection.greedy_assignment import (
    assign_greedily,
    connected_groups,
    rounds_in_groups,
)
from perception.evaluation.detection.grouping import pairs_in_groups, ranks_in_groups
from perception.evaluation.rows import Rows
from perception.types import Float64, Int

_BLOCK_PAIRS = 1_000_000  # that are matched at once, which bounds the memory at 100 MB


@dataclass(frozen=True)
class StepCounts(Rows):
    """What is found, one row a step of the threshold.

    Attributes:
        true_positives: valid truths matched by normal detections.
        found_truths: valid truths matched by any, so that they are not missed.
        cleared: matched detections that would be wrong if they were not.
        similarity: of the headings, 0 to 1, summed over the true positives.
    """

    true_positives: Int
    found_truths: Int
    cleared: Int
    similarity: Float64

    def gains(self, groups: Int) -> Self:
        """Return what each row adds to the one before it of the same group."""
        follows = np.diff(groups) == 0
        columns = [getattr(self, field.name) for field in fields(self)]
        return type(self)(*(np.append(c[:1], c[1:] - c[:-1] * follows) for c in columns))


@dataclass(frozen=True)
class ThresholdSweep:
    """Groups of rivals, and the steps in which the threshold falls through each of them.

    Attributes:
        pairs: (P) by group; then in the order of the truths, the first choice of each first.
        groups: (P,) of the pairs.
        rounds: (P,) when the truth of each pair is served.
        steps: (S,) the detection whose score the threshold falls to: by group, then by falling score.
        step_groups: (S,) its group.
        places: (D,) of each detection within its group, from 0.
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
    """Order the pairs by choice: the greatest overlap, but who is ignored only in need."""
    groups = connected_groups(pairs_to_match.truths, pairs_to_match.detections)
    is_valid_detection = mask.is_valid_detection[pairs_to_match.detections]
    worth = np.where(
        is_valid_detection, pairs_to_match.iou, 0.0
    )  # of the ignored ones, the first will do
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
    """Match each group anew at each of its steps, with the detections that the threshold has passed."""
    blocks = (_count_block(evaluation_boxes, mask, sweep, block) for block in _blocks(sweep))
    return StepCounts.concatenate(blocks)


def _blocks(sweep: ThresholdSweep) -> Iterator[slice]:
    """Cut the steps into runs that do not take too many pairs together."""
    pairs_of_steps = np.bincount(sweep.groups)[sweep.step_groups]
    blocks = np.cumsum(pairs_of_steps) // _BLOCK_PAIRS
    ends = [*(np.flatnonzero(np.diff(blocks)) + 1).tolist(), len(blocks)]
    return (slice(start, end) for start, end in zip([0, *ends], ends, strict=False))


def _count_block(
    evaluation_boxes: EvaluationBoxes, mask: EvaluationMask, sweep: ThresholdSweep, block: slice
) -> StepCounts:
    scores = evaluation_boxes.detections.scores
    steps, groups = sweep.steps[block], sweep.step_groups[block]
    # Each step has its own copy of its group's pairs, less those that the threshold has not reached.
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
    is_right = is_found & mask.is_valid_detection[matched.detections]
    is_cleared = mask.is_false_positive_if_unmatched[matched.detections]
    turned_rad = (
        evaluation_boxes.truths.alphas_rad[matched.truths]
        - evaluation_boxes.detections.alphas_rad[matched.detections]
    )
    alike = np.where(is_right, (1 + np.cos(turned_rad)) / 2, 0.0)
    return StepCounts(
        true_positives=np.bincount(of_steps[is_right], minlength=steps),
        found_truths=np.bincount(of_steps[is_found], minlength=steps),
        cleared=np.bincount(of_steps[is_cleared], minlength=steps),
        similarity=np.asarray(np.bincount(of_steps, alike, minlength=steps), np.float64),
    )
