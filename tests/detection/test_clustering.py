import numpy as np
import pytest
from sklearn.cluster import DBSCAN

from benchmarks.reference.proposals import cluster_by_definition
from perception.detection.clustering import cluster
from perception.errors import UsageError


def uniform(generator, count):
    return generator.uniform(-5, 5, (count, 2))


def blobs(generator, count):
    centers = generator.uniform(-8, 8, (6, 2))
    return centers[generator.integers(6, size=count)] + generator.normal(0, 0.6, (count, 2))


def lattice(generator, count):
    # Distances of exactly the radius, 0.5, and rounded ones beside it.
    return generator.integers(0, 12, (count, 2)) * generator.choice([0.5, 0.25, 0.1, 0.3, 0.4])


def duplicates(generator, count):
    return uniform(generator, max(count // 4, 1))[
        generator.integers(max(count // 4, 1), size=count)
    ]


def lines(generator, count):
    along = generator.uniform(0, 12, count)
    across = generator.choice([0, 0.5, 0.51, 1.4], count)
    return np.column_stack([along, across] if generator.random() < 0.5 else [across, along])


SHAPES = (uniform, blobs, lattice, duplicates, lines)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("count", [1, 2, 3, 30, 250])
@pytest.mark.parametrize("min_points", [1, 2, 5, 12])
def test_labels_are_those_of_the_definition(shape, count, min_points):
    generator = np.random.default_rng(count)
    for _ in range(3):
        xy_m = shape(generator, count)
        expected = cluster_by_definition(xy_m, 0.5, min_points)
        assert cluster(xy_m, 0.5, min_points).tolist() == expected.tolist()


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("count", [40, 600])
@pytest.mark.parametrize("min_points", [2, 5, 20])
def test_labels_are_those_of_scikit_learn(shape, count, min_points):
    xy_m = shape(np.random.default_rng(count + min_points), count)
    expected = DBSCAN(eps=0.5, min_samples=min_points).fit_predict(xy_m)
    assert cluster(xy_m, 0.5, min_points).tolist() == expected.tolist()


def test_distant_places_are_separate_clusters():
    xy_m = np.array([[0.0, 0], [0.2, 0], [3e8, 3e8], [3e8 + 0.25, 3e8], [0, 3e8]])
    assert cluster(xy_m, 1.0, 2).tolist() == [0, 0, 1, 1, -1]


def test_a_border_point_goes_to_the_first_cluster_that_reaches_it():
    # Eight neighbours make a core: three points on each side of the one between do, with four beyond.
    x = np.repeat([0, 0.5, 0.9, -0.5, -0.9], [1, 3, 4, 3, 4])
    xy_m = np.column_stack([x, np.zeros(15)])
    assert cluster(xy_m, 0.5, 8).tolist() == [0] * 8 + [1] * 7
    assert cluster(xy_m[1:], 0.5, 8).tolist() == [-1] * 14
    assert cluster(xy_m[::-1], 0.5, 8).tolist() == [0] * 7 + [1] * 7 + [0]


def test_many_points_at_nearly_the_radius_are_settled():
    # Two walls just too far apart, then just near enough: each has thousands of points in few cells.
    generator = np.random.default_rng(0)
    left = np.column_stack([np.zeros(4000), generator.uniform(0, 0.3, 4000)])
    for gap_m, clusters in ((0.5 + 1e-12, 2), (0.5, 1), (0.4, 1)):
        ends = np.array([[0, 0], [gap_m, 0]])
        xy_m = np.concatenate([left, left * (1, -1) + (gap_m, -0.01), ends])
        assert cluster(xy_m, 0.5, 5).max() + 1 == clusters


def test_all_points_in_one_place_are_one_cluster():
    assert cluster(np.full((5, 2), 3.7), 0.5, 5).tolist() == [0] * 5
    assert cluster(np.full((4, 2), 3.7), 0.5, 5).tolist() == [-1] * 4


def test_no_points_are_no_clusters():
    assert cluster(np.zeros((0, 2)), 0.5, 5).shape == (0,)


@pytest.mark.parametrize(("radius_m", "min_points"), [(0, 5), (-1, 5), (np.nan, 5), (0.5, 0)])
def test_an_impossible_config_is_refused(radius_m, min_points):
    with pytest.raises(UsageError) as error:
        cluster(np.zeros((3, 2)), radius_m, min_points)
    assert error.value.expected == "radius and min_points above zero"
    assert error.value.found == f"{radius_m:g} m, {min_points}"


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e30])
def test_places_that_are_none_are_refused(bad):
    with pytest.raises(UsageError) as error:
        cluster(np.array([[0, 0], [0, bad]]), 0.5, 2)
    assert error.value.where == "points to cluster"
    assert error.value.found == f"an extent of {bad * 2 * np.sqrt(2):.3g} cells"
