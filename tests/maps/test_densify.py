"""Each way of filling on maps small enough to know the answer, and on bad ones."""

import numpy as np
import pytest

from benchmarks.maps import fill_by_morphology, fill_nearest_by_chamfer
from perception.maps.densify import (
    FILL_METHODS,
    ColumnFillingConfig,
    densify,
    fill_columns,
    fill_natural,
    fill_nearest,
)
from perception.maps.filling import region_of_interest
from perception.maps.projection import SparseMaps
from perception.maps.triangle_filling import fill_linear, fill_nearest_vertex
from tests.reference.maps import (
    fill_columns_by_loop,
    fill_natural_by_discs,
    fill_nearest_by_search,
)


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
    nearest, linear = fill_nearest_vertex(sparse), fill_linear(sparse)
    assert nearest.depth_m[1, 1] == 10
    assert nearest.depth_m[7, 7] == 18
    assert nearest.reflectance[7, 1] == np.float32(0.9)
    np.testing.assert_allclose(linear.depth_m, np.repeat(10 + np.arange(9.0)[:, None], 9, 1), 1e-5)
    np.testing.assert_allclose(linear.reflectance[4], 0.5, rtol=1e-5)


def test_nearest_vertex_is_not_always_the_nearest_return():
    # A long flat triangle covers pixels whose nearest return is not among its vertices.
    sparse = random_returns(5, (40, 24), 30)
    inside = fill_nearest_vertex(sparse).depth_m > 0
    assert (fill_nearest_vertex(sparse).depth_m != fill_nearest(sparse).depth_m)[inside].any()


def test_columns_lay_a_plane_through_a_road_and_keep_an_edge():
    # Inverse depths 0.1 and 0.104 four rows apart are one surface; 0.1 and 0.2 are not.
    road = fill_columns(sparse_of({(2, 0): (10, 0.2), (2, 4): (1 / 0.104, 0.6)}, (6, 5)))
    np.testing.assert_allclose(1 / road.depth_m[:, 2], [0.1, 0.101, 0.102, 0.103, 0.104], 1e-5)
    np.testing.assert_allclose(road.reflectance[:, 3], [0.2, 0.3, 0.4, 0.5, 0.6], 1e-5)
    edge = fill_columns(sparse_of({(2, 0): (10, 0.2), (2, 4): (5, 0.6)}, (6, 5)))
    assert edge.depth_m[:, 2].tolist() == [10, 10, 5, 5, 5]
    assert edge.reflectance[:, 2].tolist() == pytest.approx([0.2, 0.2, 0.6, 0.6, 0.6])


def test_gap_in_a_row_is_a_surface_or_an_edge():
    # Inverse depths 0.1 and 0.104 on both sides of four columns, two pixels each, are one surface.
    wall = fill_columns(sparse_of({(0, 3): (10, 0.2), (8, 3): (1 / 0.104, 0.6)}, (10, 5)))
    np.testing.assert_allclose(
        1 / wall.depth_m[3, 1::2], [0.1, 0.101, 0.102, 0.103, 0.104], rtol=1e-5
    )
    np.testing.assert_allclose(wall.reflectance[3, 1::2], [0.2, 0.3, 0.4, 0.5, 0.6], rtol=1e-5)
    edge = fill_columns(sparse_of({(0, 3): (10, 0), (8, 3): (30, 0), (4, 4): (5, 0)}, (10, 5)))
    assert edge.depth_m[4, 4] == 5
    # The beam goes by the return that is one row lower; half way between two, the later one counts.
    assert edge.depth_m[3].tolist() == pytest.approx([10] * 2 + [5] * 4 + [30] * 4)


def test_row_goes_on_a_little_past_its_end():
    # Two rows of a pole before a wall, five rows apart: one column of two pixels on either side.
    pole = {(20, row): (8, 0.5) for row in (4, 9, 14)}
    wall = {
        (column, row): (40, 0.1)
        for column in (*range(0, 14, 2), *range(28, 42, 2))
        for row in (6, 11)
    }
    depth_m = fill_columns(sparse_of(pole | wall, (42, 16))).depth_m
    assert (depth_m[4:15, 18:24] == 8).all()
    assert depth_m[11, 14:16].tolist() == pytest.approx([40, 40])


def test_what_shows_through_a_nearer_surface_is_left_out():
    near = {(column, row): (8, 0.5) for column in range(10, 30, 2) for row in (4, 9, 14)}
    behind = {(14, 6): (40, 0.1), (20, 11): (40, 0.1)}
    dense = densify(sparse_of(near | behind, (40, 16)))
    assert (dense.depth_m[4:15, 10:30] == 8).all()
    assert dense.is_filled[6, 14]
    assert not dense.is_measured[6, 14]
    # With nothing below it, it may be seen above the surface's edge.
    above = densify(sparse_of(near | {(14, 2): (40, 0.1)}, (40, 16)))
    assert above.depth_m[2, 14] == 40


@pytest.mark.parametrize("seed", range(4))
def test_columns_equal_a_loop(seed):
    sparse = random_returns(seed, (23, 14), 4 + 12 * seed)
    for config in (ColumnFillingConfig(), ColumnFillingConfig(1, 5, 1.5, 0.02, 1.0)):
        fast, reference = fill_columns(sparse, config), fill_columns_by_loop(sparse, config)
        np.testing.assert_allclose(fast.reflectance, reference.reflectance, atol=2e-6)
        np.testing.assert_allclose(fast.depth_m, reference.depth_m, rtol=2e-5)


def test_nearest_equals_a_search_but_for_ties():
    sparse = random_returns(1, (30, 20), 25)
    fast, reference = fill_nearest(sparse), fill_nearest_by_search(sparse)
    rows, columns = np.nonzero(fast.depth_m != reference.depth_m)
    for row, column in zip(rows, columns, strict=True):
        squared = np.sort(((sparse.pixels - (column, row)) ** 2).sum(axis=1))
        assert squared[0] == squared[1]
    assert len(rows) < 30


def test_natural_equals_counting_what_a_pixel_takes():
    sparse = random_returns(2, (21, 15), 12)
    # Ties would let the two choose different returns: compare where both agree on the nearest.
    if not (fill_nearest(sparse).depth_m == fill_nearest_by_search(sparse).depth_m).all():
        sparse = sparse_of({(3, 3): (10, 0.2), (4, 10): (30, 0.7), (17, 6): (20, 0.4)}, (21, 15))
    fast, reference = fill_natural(sparse), fill_natural_by_discs(sparse)
    differs = ~np.isclose(fast.depth_m, reference.depth_m, rtol=1e-5)
    ties = fill_nearest(sparse).depth_m != fill_nearest_by_search(sparse).depth_m
    assert differs.sum() == 0 or ties.any()


def test_natural_lies_between_its_neighbours():
    filling = fill_natural(sparse_of({(0, 5): (10, 0.0), (10, 5): (20, 1.0)}, (11, 11)))
    middle = filling.depth_m[5]
    assert middle[0] == 10
    assert middle[10] == 20
    assert (np.diff(middle) >= 0).all()
    assert 13 < middle[5] < 17


@pytest.mark.parametrize("method", FILL_METHODS)
def test_both_maps_come_from_the_same_returns(method):
    # Reflectance a linear function of inverse depth (of depth for the others): so are the maps.
    sparse = random_returns(7, (40, 30), 120)
    value = np.reciprocal(sparse.depth_m) if method == "default" else sparse.depth_m / 100
    dense = densify(SparseMaps(sparse.pixels, sparse.depth_m, value, sparse.size_px), method)
    valid = dense.is_valid
    expected = 1 / dense.depth_m[valid] if method == "default" else dense.depth_m[valid] / 100
    np.testing.assert_allclose(dense.reflectance[valid], expected, rtol=1e-4)


@pytest.mark.parametrize("method", FILL_METHODS)
def test_masks_tell_measured_filled_and_unknown_apart(method):
    sparse = random_returns(8, (40, 30), 100)
    dense = densify(sparse, method)
    # What is hidden by nearer returns is filled over.
    assert dense.is_measured.sum() == 100 or method == "default"
    assert not (dense.is_measured & dense.is_filled).any()
    assert (dense.depth_m[dense.is_valid] > 0).all()
    assert (dense.depth_m[~dense.is_valid] == 0).all()
    assert (dense.reflectance[~dense.is_valid] == 0).all()
    kept = sparse[dense.is_measured[sparse.pixels[:, 1], sparse.pixels[:, 0]]]
    rows, columns = kept.pixels[:, 1], kept.pixels[:, 0]
    assert len(kept) == dense.is_measured.sum() > 70
    assert (dense.depth_m[rows, columns] == kept.depth_m).all()
    assert (dense.reflectance[rows, columns] == kept.reflectance).all()


@pytest.mark.parametrize("method", FILL_METHODS)
def test_no_return_gives_maps_without_a_valid_pixel(method):
    dense = densify(sparse_of({}, (12, 7)), method)
    assert dense.depth_m.shape == dense.reflectance.shape == dense.is_valid.shape == (7, 12)
    assert not dense.is_valid.any()
    assert not dense.depth_m.any()


@pytest.mark.parametrize("method", FILL_METHODS)
def test_one_return_fills_what_lies_below_it_or_itself_alone(method):
    dense = densify(sparse_of({(5, 3): (12, 0.4)}, (12, 7)), method)
    # Nothing can be triangulated; all other methods know the one return.
    below = np.arange(7)[:, None] >= (3 if method == "default" else 1)
    expected = dense.is_measured if method in ("thesis", "linear") else below.repeat(12, axis=1)
    assert (dense.is_valid == expected).all()
    assert (dense.depth_m[dense.is_valid] == 12).all()
    assert dense.is_measured.sum() == 1


@pytest.mark.parametrize("method", FILL_METHODS)
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


@pytest.mark.parametrize("method", FILL_METHODS)
@pytest.mark.parametrize(
    "returns",
    [
        {(5, 3): (12, 0.4), (9, 6): (30, 0.1)},
        {(0, 0): (12, 0.0)},
        {(11, 6): (80, 1.0)},
        {(row, row): (10 + row, 0.5) for row in range(7)},
        {(6, row): (10 + row, 0.5) for row in range(7)},
    ],
)
def test_few_returns_give_finite_maps(method, returns):
    dense = densify(sparse_of(returns, (13, 7)), method)
    for values in (dense.depth_m, dense.reflectance):
        assert values.shape == (7, 13)
        assert np.isfinite(values).all()
        assert not values[~dense.is_valid].any()
    assert (dense.depth_m[dense.is_valid] >= 10).all()
    assert dense.is_measured.sum() == len(returns)


@pytest.mark.parametrize("size_px", [(1, 1), (2, 3), (7, 5), (640, 192)])
def test_images_of_other_sizes(size_px):
    sparse = random_returns(3, size_px, min(size_px[0] * size_px[1], 200))
    dense = densify(sparse)
    assert dense.depth_m.shape == dense.is_filled.shape == size_px[::-1]
    # The row of the lowest return is below all that begins the region.
    assert (dense.depth_m[sparse.pixels[:, 1].max()] > 0).all()


def test_beams_far_apart_reach_farther():
    # A fourth of the way to the next beam: of 24 rows three columns of two pixels, of 5 rows one.
    for spacing, columns in ((24, 3), (5, 1)):
        pole = {(40, row): (20, 0.5) for row in range(0, 72, spacing)}
        wall = {
            (column, row): (60, 0.5)
            for column in (*range(0, 40, 2), *range(42, 80, 2))
            for row in range(spacing // 2, 72, spacing)
        }
        row = fill_columns(sparse_of(pole | wall, (80, 72))).depth_m[spacing]
        assert row[38 - 2 * columns : 44 + 2 * columns].tolist() == pytest.approx(
            [60, 60, *[20] * (2 + 4 * columns), 60, 60]
        )
