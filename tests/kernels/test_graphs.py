"""Connected parts beside those of SciPy."""

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from perception.kernels.graphs import connected_parts


@pytest.mark.parametrize("edges", [0, 5, 40, 300])
def test_parts_are_those_of_scipy(edges):
    random = np.random.default_rng(edges)
    first, second = random.integers(0, 90, (2, edges))
    graph = coo_matrix((np.ones(edges), (first, second)), (90, 90))
    expected = connected_components(graph, directed=False)[1]
    assert connected_parts(90, first, second).tolist() == expected.tolist()


def test_a_chain_from_its_end_is_one_part():
    nodes = np.arange(1000)
    assert not connected_parts(1000, nodes[:0:-1].copy(), nodes[-2::-1].copy()).any()
    assert connected_parts(0, nodes[:0], nodes[:0]).shape == (0,)
