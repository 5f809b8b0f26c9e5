"""One-to-one matchings of the greatest weight, over pairs of which most have no rival."""

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from perception.types import Bool, Float64, Int


def heaviest_matching(rows: Int, columns: Int, weights: Float64) -> Bool:
    """Return (C,) which of C different pairs are in the one-to-one matching of the greatest sum of weights.

    Args:
        rows: (C,) the one side of each pair, numbered from 0.
        columns: (C,) the other side.
        weights: (C,) above 0.
    """
    is_chosen = np.ones(len(rows), bool)
    for group in rival_groups(rows, columns):
        is_chosen[group] = heaviest_of_rivals(rows[group], columns[group], weights[group])
    return is_chosen


def rival_groups(rows: Int, columns: Int) -> list[Int]:
    """Return the indices of pairs that compete, directly or through others, in groups of two and more.

    The matching of all pairs is the matchings of these groups, and every pair that is in none. Groups
    come in the order of their first pair.
    """
    if len(rows) == 0:
        return []
    height, nodes = int(rows.max()) + 1, int(rows.max() + columns.max()) + 2
    edges = coo_matrix((np.ones(len(rows), bool), (rows, height + columns)), (nodes, nodes))
    labels = connected_components(edges, directed=False)[1][rows]
    in_rivalry = np.flatnonzero(np.bincount(labels)[labels] > 1)
    by_group = in_rivalry[np.argsort(labels[in_rivalry], kind="stable")]
    ends = np.flatnonzero(np.diff(labels[by_group])) + 1
    groups = np.split(by_group, ends) if len(by_group) else []
    return sorted(groups, key=lambda group: int(group[0]))


def heaviest_of_rivals(rows: Int, columns: Int, weights: Float64) -> Bool:
    """Return the same as `heaviest_matching`, by one dense assignment of all rows and columns."""
    row = np.unique(rows, return_inverse=True)[1]
    column = np.unique(columns, return_inverse=True)[1]
    dense = np.zeros((row.max() + 1, column.max() + 1))
    dense[row, column] = weights
    is_taken = np.zeros(dense.shape, bool)
    # What is assigned without being a pair weighs nothing and is dropped here.
    is_taken[linear_sum_assignment(dense, maximize=True)] = True
    return np.asarray(is_taken[row, column])
