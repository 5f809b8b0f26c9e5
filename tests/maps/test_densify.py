"""Each way of filling on maps small enough to know the answer, and on bad ones."""

import numpy as np
import pytest

from benchmarks.map_peers import fill_by_morphology, fill_nearest_by_chamfer
from benchmarks.naive_maps import (
    fill_columns_by_loop,
    fill_natural_by_discs,
    fill_nearest_by_search,
)
from perception.maps.column_filling import ColumnRules, fill_columns
from perception.maps.densify import FILLINGS, densify, region_of_interest
from perception.maps.distance_filling import fill_natural, fill_nearest
from perception.maps.projection import SparseMaps
from perception.maps.triangle_filling import fill_linear, fill_triangles


def sparse_of(returns, size_px):
    """Make maps of {(column, row): (depth, reflectance)}."""
    rows = sorted(returns.items(), key=lambda item: -item[1][0])
    pixels = np.array([pixel for pixel, _ in rows], np.int32).reshape(-1, 2)
    values = np.array([value for _, value in rows], np.float32).reshape(-1, 2)
    return SparseMaps(pixels, values[:, 0], values[:, 1], size_px)


def random_returns(seed, size_px, count):
    generator = np.random.default_rng(seed)
    cells = generator.choice(size_px[0] * size_px[1], count, replace=False)
    return sparse_of(
        {
            (int(c % size_px[0]), int(c // size_px[0])): generator.uniform((3, 0), (60, 1))
            for c in cells
        },
        size_px,
    )


CORNERS = {(0, 0): (10, 0.1), (8, 0): (10, 0.1), (0, 8): (18, 0.9), (8, 8): (18, 0.9)}


def test_triangle_takes_its_nearest_vertex_and_linear_lies_between():
    sparse = sparse_of(CORNERS, (9, 9))
    nearest, linear = fill_triangles(sparse), fill_linear(sparse)
    assert nearest.depth_m[1, 1] == 10
    assert nearest.depth_m[7, 7] == 18
    assert nearest.reflectance[7, 1] == np.float32(0.9)
    np.testing.assert_allclose(linear.depth_m, np.repeat(10 + np.arange(9.0)[:, None], 9, 1), 1e-5)
    np.testing.assert_allclose(linear.reflectance[4], 0.5, rtol=1e-5)


def test_nearest_vertex_is_not_always_the_nearest_return():
    # A long flat triangle covers pixels whose nearest return is not among its vertices.
    sparse = random_returns(5, (40, 24), 30)
    inside = fill_triangles(sparse).depth_m > 0
    assert (fill_triangles(sparse).depth_m != fill_nearest(sparse).depth_m)[inside].any()


def test_columns_lay_a_plane_through_a_road_and_keep_an_edge():
    # Inverse depths 0.1 and 0.104 four rows apart are one surface; 0.1 and 0.2 are not.
    road = fill_columns(sparse_of({(2, 0): (10, 0.2), (2, 4): (1 / 0.104, 0.6)}, (6, 5)))
    np.testing.assert_allclose(1 / road.depth_m[:, 2], [0.1, 0.101, 0.102, 0.103, 0.104], 1e-5)
    np.testing.assert_allclose(road.reflectance[:, 3], [0.2, 0.3, 0.4, 0.5, 0.6], 1e-5)
    edge = fill_columns(sparse_of({(2, 0): (10, 0.2), (2, 4): (5, 0.6)}, (6, 5)))
    assert edge.depth_m[:, 2].tolist() == [10, 10, 5, 5, 5]
    assert edge.reflectance[:, 2].tolist() == pytest.approx([0.2, 0.2, 0.6, 0.6, 0.6])


def test_columns_reach_sideways_before_they_look_up_or_down():
    filling = fill_columns(sparse_of({(0, 3): (20, 0), (8, 3): (30, 0), (4, 4): (5, 0)}, (9, 5)))
    assert filling.depth_m[3].tolist() == pytest.approx([20, 20, 20, 20, 30, 30, 30, 30, 30])


@pytest.mark.parametrize("seed", range(4))
def test_columns_equal_a_loop(seed):
    sparse = random_returns(seed, (23, 14), 4 + 12 * seed)
    for rules in (ColumnRules(), ColumnRules(squeeze_px=1, reach=1, steepest_per_m_px=0.02)):
        fast, plain = fill_columns(sparse, rules), fill_columns_by_loop(sparse, rules)
        np.testing.assert_allclose(fast.reflectance, plain.reflectance, atol=2e-6)
        np.testing.assert_allclose(fast.depth_m, plain.depth_m, rtol=2e-5)


def test_nearest_equals_a_search_but_for_ties():
    sparse = random_returns(1, (30, 20), 25)
    fast, plain = fill_nearest(sparse), fill_nearest_by_search(sparse)
    rows, columns = np.nonzero(fast.depth_m != plain.depth_m)
    for row, column in zip(rows, columns, strict=True):
        squared = np.sort(((sparse.pixels - (column, row)) ** 2).sum(axis=1))
        assert squared[0] == squared[1]
    assert len(rows) < 30


def test_natural_equals_counting_what_a_pixel_takes():
    sparse = random_returns(2, (21, 15), 12)
    # Ties would let the two choose different returns: compare where both agree on the nearest.
    if not (fill_nearest(sparse).depth_m == fill_nearest_by_search(sparse).depth_m).all():
        sparse = sparse_of({(3, 3): (10, 0.2), (4, 10): (30, 0.7), (17, 6): (20, 0.4)}, (21, 15))
    fast, plain = fill_natural(sparse), fill_natural_by_discs(sparse)
    differs = ~np.isclose(fast.depth_m, plain.depth_m, rtol=1e-5)
    ties = fill_nearest(sparse).depth_m != fill_nearest_by_search(sparse).depth_m
    assert differs.sum() == 0 or ties.any()


def test_natural_lies_between_its_neighbours():
    filling = fill_natural(sparse_of({(0, 5): (10, 0.0), (10, 5): (20, 1.0)}, (11, 11)))
    middle = filling.depth_m[5]
    assert middle[0] == 10
    assert middle[10] == 20
    assert (np.diff(middle) >= 0).all()
    assert 13 < middle[5] < 17


@pytest.mark.parametrize("method", FILLINGS)
def test_both_maps_come_from_the_same_returns(method):
    # Reflectance a linear function of inverse depth (of depth for the others): so are the maps.
    sparse = random_returns(7, (40, 30), 120)
    value = np.reciprocal(sparse.depth_m) if method == "default" else sparse.depth_m / 100
    dense = densify(SparseMaps(sparse.pixels, sparse.depth_m, value, sparse.size_px), method)
    valid = dense.is_valid
    expected = 1 / dense.depth_m[valid] if method == "default" else dense.depth_m[valid] / 100
    np.testing.assert_allclose(dense.reflectance[valid], expected, rtol=1e-4)


@pytest.mark.parametrize("method", FILLINGS)
def test_masks_tell_measured_filled_and_unknown_apart(method):
    sparse = random_returns(8, (40, 30), 100)
    dense = densify(sparse, method)
    assert dense.is_measured.sum() == 100
    assert not (dense.is_measured & dense.is_filled).any()
    assert (dense.depth_m[dense.is_valid] > 0).all()
    assert (dense.depth_m[~dense.is_valid] == 0).all()
    assert (dense.reflectance[~dense.is_valid] == 0).all()
    rows, columns = sparse.pixels[:, 1], sparse.pixels[:, 0]
    assert (dense.depth_m[rows, columns] == sparse.depth_m).all()
    assert (dense.reflectance[rows, columns] == sparse.reflectance).all()


@pytest.mark.parametrize("method", FILLINGS)
def test_no_return_gives_maps_without_a_valid_pixel(method):
    dense = densify(sparse_of({}, (12, 7)), method)
    assert dense.depth_m.shape == dense.reflectance.shape == dense.is_valid.shape == (7, 12)
    assert not dense.is_valid.any()
    assert not dense.depth_m.any()


@pytest.mark.parametrize("method", FILLINGS)
def test_one_return_fills_what_lies_below_it_or_itself_alone(method):
    dense = densify(sparse_of({(5, 3): (12, 0.4)}, (12, 7)), method)
    # Nothing can be triangulated; all other methods know the one return.
    below = np.arange(7)[:, None] >= (3 if method == "default" else 1)
    expected = dense.is_measured if method in ("thesis", "linear") else below.repeat(12, axis=1)
    assert (dense.is_valid == expected).all()
    assert (dense.depth_m[dense.is_valid] == 12).all()
    assert dense.is_measured.sum() == 1


@pytest.mark.parametrize("method", FILLINGS)
def test_returns_on_one_line_have_no_triangles(method):
    line = {(column, 4): (10 + column, 0.5) for column in range(0, 12, 3)}
    dense = densify(sparse_of(line, (12, 7)), method)
    assert dense.is_measured.sum() == 4
    if method in ("thesis", "linear"):
        assert not dense.is_filled.any()
    else:
        assert dense.is_valid[4:].all()
        assert 10 <= dense.depth_m[6, 0] < 13


def test_region_begins_at_the_highest_return_of_the_columns_around():
    region = region_of_interest(sparse_of({(0, 5): (9, 0), (40, 8): (9, 0)}, (60, 12)))
    first = region.argmax(axis=0)
    # Half way to the other return, and ten columns more, which the higher one reaches.
    assert first[:31].tolist() == [3] * 31
    assert first[31:].tolist() == [6] * 29
    assert region[-1].all()


def test_peers_fill_the_image_and_keep_what_is_measured():
    sparse = random_returns(9, (60, 40), 300)
    for fill in (fill_by_morphology, fill_nearest_by_chamfer):
        filling = fill(sparse)
        assert (filling.depth_m > 0).all()
        rows, columns = sparse.pixels[:, 1], sparse.pixels[:, 0]
        assert (filling.depth_m[rows, columns] == sparse.depth_m).all()
        assert filling.reflectance.max() <= 1
