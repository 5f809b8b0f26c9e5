"""One-to-one matchings of the greatest weight, over pairs of which most have no rival."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from perception.types import Bool, Float64, Int


def max_weight_matching(rows: Int, columns: Int, weights: Float64) -> Bool:
    """Return (C,) which of C different pairs are in the one-to-one matching of the greatest sum of weights.

    Args:
        rows: (C,) the one side of each pair, numbered from 0.
        columns: (C,) the other side.
        weights: (C,) above 0.
    """
    is_chosen = np.ones(len(rows), bool)
    for group in matching_components(rows, columns):
        is_chosen[group.pairs] = group.max_weight(weights[group.pairs])
    return is_chosen


@dataclass(frozen=True)
class MatchingComponent:
    """P pairs that compete, directly or through others, and with no pair outside.

    Attributes:
        pairs: (P,) indices, rising.
        rows: (P,) the one side, numbered from 0 within the group.
        columns: (P,) the other side, in the same way.
    """

    pairs: Int
    rows: Int
    columns: Int

    def max_weight(self, weights: Float64) -> Bool:
        """Return (P,) which pairs are in the one-to-one matching of the greatest sum of (P,) weights."""
        table = np.zeros((int(self.rows.max()) + 1, int(self.columns.max()) + 1))
        table[self.rows, self.columns] = weights
        is_taken = np.zeros(table.shape, bool)
        # What is assigned without being a pair weighs nothing and is dropped here.
        is_taken[linear_sum_assignment(table, maximize=True)] = True
        return np.asarray(is_taken[self.rows, self.columns])


def matching_components(rows: Int, columns: Int) -> list[MatchingComponent]:
    """Return the groups of two and more rivals, in the order of their first pair.

    The matching of all pairs is the matchings of these groups, and every pair that is in none.
    """
    labels = _components(rows, columns)
    members = np.flatnonzero(np.bincount(labels)[labels] > 1)
    if len(members) == 0:
        return []
    members = members[np.argsort(labels[members], kind="stable")]
    starts = np.flatnonzero(np.diff(labels[members], prepend=-1))
    group_rows = _numbered_within(labels[members], rows[members], starts)
    group_columns = _numbered_within(labels[members], columns[members], starts)
    groups = [
        MatchingComponent(members[start:end], group_rows[start:end], group_columns[start:end])
        for start, end in pairwise([*starts.tolist(), len(members)])
    ]
    return sorted(groups, key=lambda group: int(group.pairs[0]))


def _components(rows: Int, columns: Int) -> Int:
    """Return (C,) the number of the connected component that each pair lies in."""
    if len(rows) == 0:
        return np.zeros(0, np.int64)
    height, nodes = int(rows.max()) + 1, int(rows.max() + columns.max()) + 2
    edges = coo_matrix((np.ones(len(rows), bool), (rows, height + columns)), (nodes, nodes))
    labels = connected_components(edges, directed=False)[1]
    return np.asarray(labels[rows], np.int64)


def _numbered_within(labels: Int, values: Int, starts: Int) -> Int:
    """Number values from 0 within each run of equal labels."""
    keys = labels * (values.max() + 1) + values
    ranks = np.unique(keys, return_inverse=True)[1]
    first = np.minimum.reduceat(ranks, starts)
    return np.asarray(ranks - np.repeat(first, np.diff(starts, append=len(labels))))
