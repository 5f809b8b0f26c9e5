"""One-to-one matchings of maximum weight over sparse pairs, of which most compete with no other."""

import numpy as np
from scipy.optimize import linear_sum_assignment

from perception.evaluation.grouping import connected_groups
from perception.types import Bool, Float64, Int


def max_weight_matching(rows: Int, columns: Int, weights: Float64) -> Bool:
    """Return (C,) whether each of C different pairs is in the one-to-one matching of maximum weight.

    Args:
        rows: (C,) First side of each pair, numbered from 0.
        columns: (C,) Second side of each pair, numbered from 0.
        weights: (C,) Weight above 0 of each pair.
    """
    is_chosen = np.ones(len(rows), bool)
    for group in competing_pairs(rows, columns):
        is_chosen[group] = best_matching(rows[group], columns[group], weights[group])
    return is_chosen


def competing_pairs(rows: Int, columns: Int) -> list[Int]:
    """Return the connected components of two and more pairs, in the order of their first pair.

    The matching of all pairs is the union of the matchings of these components and of all other pairs.
    """
    groups = connected_groups(rows, columns)
    members = np.flatnonzero(np.bincount(groups)[groups] > 1)
    members = members[np.argsort(groups[members], kind="stable")]
    components = np.split(members, np.flatnonzero(np.diff(groups[members])) + 1)
    return sorted((one for one in components if len(one)), key=lambda pairs: int(pairs[0]))


def best_matching(rows: Int, columns: Int, weights: Float64) -> Bool:
    """Return (P,) whether each pair of one component is in its matching of maximum weight."""
    row_of, column_of = (np.unique(side, return_inverse=True)[1] for side in (rows, columns))
    table = np.zeros((row_of.max() + 1, column_of.max() + 1))
    table[row_of, column_of] = weights
    is_taken = np.zeros(table.shape, bool)
    # Assignments that are no pair have no weight and are dropped here.
    is_taken[linear_sum_assignment(table, maximize=True)] = True
    return np.asarray(is_taken[row_of, column_of])
