"""Compiled search of neighbours, beside SciPy's tree and components."""

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import cdist

from perception.kernels.neighbours import are_near, extents_of_clusters, linked_clusters


def places(count: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-8, 8, (count, 2))


@pytest.mark.parametrize("reach_m", [0.05, 0.4, 3.0])
@pytest.mark.parametrize("others", [0, 1, 200])
def test_near_places_equal_all_distances(reach_m: float, others: int) -> None:
    here, there = places(300, 0), places(others, 1)
    there = there[np.argsort(there[:, 0])]
    expected = (cdist(here, there) < reach_m).any(axis=1)
    np.testing.assert_array_equal(are_near(here, there, reach_m), expected)


@pytest.mark.parametrize("seed", range(4))
def test_clusters_equal_the_components_of_all_links(seed: int) -> None:
    here = places(150, seed)
    depth_m = np.random.default_rng(seed).uniform(0.3, 1.5, 150)
    apart, sight = here[None] - here[:, None], here[None] + here[:, None]
    sight /= np.linalg.norm(sight, axis=2, keepdims=True)
    along = (apart * sight).sum(axis=2)
    across = apart[..., 0] * sight[..., 1] - apart[..., 1] * sight[..., 0]
    is_linked = (2 * along / (depth_m + depth_m[:, None])) ** 2 + (across / 0.4) ** 2 <= 1
    _, expected = connected_components(is_linked)
    found = linked_clusters(here, depth_m, 0.4, np.argsort(here[:, 0]))
    assert found[0] == 0
    assert 1 < found.max() < 149
    np.testing.assert_array_equal(found, expected)


def test_extents_equal_those_of_each_cluster() -> None:
    random = np.random.default_rng(0)
    points, cluster_of = (
        random.normal(0, 5, (300, 3)).astype(np.float32),
        random.integers(0, 7, 300),
    )
    low_m, high_m, nearest_m = extents_of_clusters(points, cluster_of, 7)
    for number in range(7):
        part = points[cluster_of == number]
        assert (low_m[number], high_m[number]) == (part[:, 2].min(), part[:, 2].max())
        np.testing.assert_allclose(nearest_m[number], np.hypot(*part.T[:2]).min(), rtol=1e-6)
