"""Greedy assignment of detections to labels in the order of the official tool, for all frames at once."""

import numpy as np

from perception.evaluation.grouping import ranks_in_groups
from perception.types import Bool, Int


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
