"""Connected parts of graphs, as forests in which each node knows its parent."""

import numpy as np

from perception.kernels.compiled import WHOLE, array_of, compiled, written
from perception.types import Bool, Int


@compiled((written(WHOLE), WHOLE))
def root_of(parents: Int, node: int) -> int:
    """Return the root of a node in a forest, whose paths are shortened."""
    while parents[node] != node:
        parents[node] = parents[parents[node]]
        node = parents[node]
    return node


@compiled((written(WHOLE),))
def tree_numbers(parents: Int) -> Int:
    """Return the (N,) number of each node's tree, numbered by root; the root of a tree is its first node."""
    numbers, found = np.empty(len(parents), np.int64), 0
    for node in range(len(parents)):
        root = root_of(parents, node)
        if root == node:
            numbers[node] = found
            found += 1
        else:
            numbers[node] = numbers[root]
    return numbers


@compiled((WHOLE, array_of(WHOLE), array_of(WHOLE)))
def connected_parts(count: int, first: Int, second: Int) -> Int:
    """Return the (count,) connected component of each node of a graph, numbered by first node.

    Args:
        count: Number of nodes.
        first: (E,) one node of each edge.
        second: (E,) the other node.
    """
    parents = np.arange(count)
    for edge in range(len(first)):
        one, other = root_of(parents, first[edge]), root_of(parents, second[edge])
        # The first node of a part is its root.
        parents[max(one, other)] = min(one, other)
    return tree_numbers(parents)


@compiled((array_of(np.bool_, 2), array_of(WHOLE)))
def leaders_of(is_same: Bool, order: Int) -> Int:
    """Return the (N,) leader of each node: the first in an order that leads and is the same, or the node itself, which leads.

    Args:
        is_same: (N, N) whether a node is the same as another one.
        order: (N,) nodes, best first.
    """
    leader_of, leading, count = np.arange(len(order)), np.empty(len(order), np.int64), 0
    for node in order:
        for leader in leading[:count]:
            if is_same[node, leader]:
                leader_of[node] = leader
                break
        if leader_of[node] == node:
            leading[count] = node
            count += 1
    return leader_of
