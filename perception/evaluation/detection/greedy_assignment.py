"""Who takes whom: labelled boxes are served in turn, as the official tool does, but all frames at once."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from perception.evaluation.detection.grouping import ranks_in_groups
from perception.types import Bool, Int


def connected_groups(truths: Int, detections: Int) -> Int:
    """Return (P,) the group of each pair; pairs of one group compete, directly or through others."""
    if len(truths) == 0:
        return np.zeros(0, np.int64)
    height = int(truths.max()) + 1
    nodes = height + int(detections.max()) + 1
    edges = coo_matrix((np.ones(len(truths), bool), (truths, height + detections)), (nodes, nodes))
    return np.asarray(connected_components(edges, directed=False)[1][truths], np.int64)


def rounds_in_groups(truths: Int, groups: Int) -> Int:
    """Return (P,) how many truths of a pair's group are served before that pair's own."""
    _, firsts, of_pairs = np.unique(truths, return_index=True, return_inverse=True)
    return ranks_in_groups(groups[firsts])[of_pairs]


def assign_greedily(truths: Int, detections: Int, rounds: Int) -> Bool:
    """Let one truth after the other take the first detection of its choice that is still free.

    Truths of the same turn must not want the same detection, so that they can be served together.

    Args:
        truths: (P,) who chooses; the pairs of one truth lie together, its first choice first.
        detections: (P,) who is chosen, numbered from 0.
        rounds: (P,) when the truth chooses, from 0.

    Returns:
        (P,) which pairs are matched.
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
