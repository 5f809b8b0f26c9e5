"""Groups of rows: pairs within a group, places in it, and the groups that pairs connect."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from perception.types import Int


def pairs_in_groups(first: Int, second: Int) -> tuple[Int, Int]:
    """Return the row numbers of all pairs of a first and a second row that are of the same group.

    Args:
        first: (A,) group of each first row.
        second: (B,) group of each second row, in ascending order.

    Returns:
        (P,) rows of the first in ascending order, and (P,) rows of the second, ascending for each of these.
    """
    starts = np.searchsorted(second, first, side="left")
    counts = np.searchsorted(second, first, side="right") - starts
    rows = np.repeat(np.arange(len(first)), counts)
    skipped = np.cumsum(counts) - counts
    return rows, np.arange(len(rows)) + np.repeat(starts - skipped, counts)


def ranks_in_groups(groups: Int) -> Int:
    """Return (A,) the number of rows of the same group before each row."""
    order = np.argsort(groups, kind="stable")
    ordered = groups[order]
    ranks = np.empty(len(groups), np.int64)
    ranks[order] = np.arange(len(groups)) - np.searchsorted(ordered, ordered)
    return ranks


def connected_groups(rows: Int, columns: Int) -> Int:
    """Return (P,) the connected component of each pair in the graph whose edges are the pairs."""
    if len(rows) == 0:
        return np.zeros(0, np.int64)
    height = int(rows.max()) + 1
    nodes = height + int(columns.max()) + 1
    edges = coo_matrix((np.ones(len(rows), bool), (rows, height + columns)), (nodes, nodes))
    return np.asarray(connected_components(edges, directed=False)[1][rows], np.int64)
