"""One-to-one matchings of maximum weight over sparse pairs, of which most compete with no other."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from perception.types import Bool, Float64, Int


def max_weight_matching(rows: Int, columns: Int, weights: Float64) -> Bool:
    """Return (C,) whether each of C different pairs is in the one-to-one matching of maximum weight.

    Args:
        rows: (C,) First side of each pair, numbered from 0.
        columns: (C,) Second side of each pair, numbered from 0.
        weights: (C,) Weight above 0 of each pair.
    """
    is_chosen = np.ones(len(rows), bool)
    for group in matching_components(rows, columns):
        is_chosen[group.pairs] = group.max_weight(weights[group.pairs])
    return is_chosen


@dataclass(frozen=True)
class MatchingComponent:
    """Connected component of P pairs that compete with each other and with no pair outside.

    Attributes:
        pairs: (P,) Indices of the pairs in ascending order.
        rows: (P,) First side, numbered from 0 within the component.
        columns: (P,) Second side, numbered from 0 within the component.
    """

    pairs: Int
    rows: Int
    columns: Int

    def max_weight(self, weights: Float64) -> Bool:
        """Return (P,) whether each pair is in the one-to-one matching of maximum (P,) weight."""
        table = np.zeros((int(self.rows.max()) + 1, int(self.columns.max()) + 1))
        table[self.rows, self.columns] = weights
        is_taken = np.zeros(table.shape, bool)
        # Assignments that are no pair have no weight and are dropped here.
        is_taken[linear_sum_assignment(table, maximize=True)] = True
        return np.asarray(is_taken[self.rows, self.columns])


def matching_components(rows: Int, columns: Int) -> list[MatchingComponent]:
    """Return the components of two and more pairs, in the order of their first pair.

    The matching of all pairs is the union of the matchings of these components and of all other pairs.
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
