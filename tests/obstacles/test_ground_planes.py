import numpy as np
import pytest

from perception.errors import UsageError
from perception.geometry.grids import LocalArea
from perception.obstacles.config import PiecewisePlanesConfig
from perception.obstacles.ground_planes import (
    PiecewisePlanes,
    PiecewisePlanesEstimator,
    best_supported_plane,
    fit_plane,
    plane_step,
    quartile_gate_m,
    ransac_plane,
    slice_edges_m,
    slice_starts_m,
    validate,
)
from perception.sensor import HDL_64E, VLP_16

CONFIG = PiecewisePlanesConfig()
LEVEL = np.array([0.0, 0.0, 1.0, 1.73])


def plane(slope_x: float, slope_y: float, z_m: float) -> np.ndarray:
    """Return the plane z = slope_x x + slope_y y + z_m."""
    normal = np.array([-slope_x, -slope_y, 1.0]) / np.hypot(np.hypot(slope_x, slope_y), 1)
    return np.append(normal, -normal[2] * z_m)


def points_on(slope_x: float, slope_y: float, z_m: float, count: int = 4000) -> np.ndarray:
    random = np.random.default_rng(1)
    x, y = random.uniform(-5, 25, count), random.uniform(-10, 10, count)
    return np.column_stack([x, y, slope_x * x + slope_y * y + z_m])


def test_slice_edges_of_the_thesis() -> None:
    edges_m = slice_edges_m(1.73, np.radians(0.4), 25.0, CONFIG)
    np.testing.assert_allclose(edges_m, [5.00, 5.77, 6.79, 8.22, 10.35, 13.92, 21.11], atol=0.006)


def test_two_steps_a_slice_make_eighteen_slices() -> None:
    config = PiecewisePlanesConfig(steps_per_slice=2)
    assert len(slice_edges_m(1.73, np.radians(0.4), 25.0, config)) == 1 + 18


def test_the_last_metres_belong_to_a_slice() -> None:
    edges_m = slice_edges_m(1.73, np.radians(0.4), 25.0, CONFIG)
    starts_m = slice_starts_m(edges_m, 25.0)
    np.testing.assert_allclose(starts_m, edges_m[:-1])  # 21.11 to 25 joins 13.92 to 21.11
    # Sixteen beams: one slice to 14 m, and 11 m left over, which are more than it.
    sparse_m = slice_edges_m(1.73, VLP_16.elevation_step_rad, 25.0, CONFIG)
    np.testing.assert_allclose(sparse_m, [5.0, 13.92], atol=0.005)
    np.testing.assert_allclose(slice_starts_m(sparse_m, 25.0), sparse_m)


def test_gate_limits_of_a_small_array() -> None:
    # Q25 = 1, Q75 = 3, IQR = 2.
    assert quartile_gate_m(np.array([0.0, 1.0, 2.0, 3.0, 4.0])) == (0.0, 3.0)


def test_vectorised_ransac_equals_the_loop_with_the_same_samples() -> None:
    random = np.random.default_rng(7)
    points = points_on(0.02, -0.03, -1.7, 300)
    points[:120, 2] += random.uniform(0, 2, 120)
    samples = random.integers(300, size=(50, 3))

    best, most = None, -1
    for triple in samples:
        p, q, r = points[triple]
        normal = np.cross(q - p, r - p)
        length = np.linalg.norm(normal)
        if length < 1e-9:
            continue
        normal = normal / length * (-1 if normal[2] < 0 else 1)
        count = sum(abs(normal @ point - normal @ p) < 0.05 for point in points)
        if count > most:
            best, most = np.append(normal, -normal @ p), count
    np.testing.assert_allclose(best_supported_plane(points, samples, 0.05), best)


def test_ransac_finds_the_exact_plane_among_outliers() -> None:
    points = points_on(0.05, -0.02, -1.6, 3000)
    points[::3, 2] += np.random.default_rng(2).uniform(0.3, 2, 1000)
    found = ransac_plane(points, CONFIG, np.random.default_rng(0))
    np.testing.assert_allclose(found, plane(0.05, -0.02, -1.6), atol=1e-9)


def test_fit_plane_is_least_squares() -> None:
    points = np.array([[0, 0, 0], [2, 0, 2], [0, 2, 0], [2, 2, 2], [1, 1, 1.5]], float)
    np.testing.assert_allclose(fit_plane(points), plane(1.0, 0.0, 0.1), atol=1e-12)


def test_plane_step_measures_angle_and_height_at_the_edge() -> None:
    step = plane_step(plane(0, 0, -1.73), plane(0.1, 0, -1.73), edge_m=5.0)
    assert step.angle_rad == pytest.approx(np.arctan(0.1))
    assert step.step_m == pytest.approx(0.5)


def test_validation_copies_the_plane_before() -> None:
    good, raised, tilted = plane(0, 0, -1.7), plane(0, 0, -1.55), plane(0, 0.2, -1.7)
    proposed = np.stack([good, raised, tilted, plane(0, 0, -1.72), np.full(4, np.nan)])
    planes, is_valid = validate(proposed, np.array([5.0, 6.0, 7.0, 8.0]), LEVEL, CONFIG)
    np.testing.assert_array_equal(is_valid, [True, False, False, True, False])
    np.testing.assert_allclose(planes[:3], [good] * 3)
    np.testing.assert_allclose(planes[3:], [proposed[3]] * 2)


def test_a_first_plane_on_its_side_gives_way_to_level_ground() -> None:
    wall = np.array([0.0, -1.0, 0.0, 2.0])
    planes, is_valid = validate(wall[None], np.array([]), LEVEL, CONFIG)
    assert not is_valid[0]
    np.testing.assert_array_equal(planes[0], LEVEL)


def test_height_and_distance_follow_the_slice() -> None:
    model = PiecewisePlanes(
        edges_m=np.array([5.0]),
        planes=np.stack([plane(0, 0, -1.7), plane(0.75, 0, -5.0)]),
        proposed=np.zeros((2, 4)),
        gates_m=np.zeros((2, 2)),
        is_valid=np.ones(2, bool),
    )
    np.testing.assert_allclose(model.height_m(np.array([[0.0, 3], [9, 3]])), [-1.7, 1.75])
    points = np.array([[0.0, 3, -1.2], [9, 3, 2.75]], np.float32)
    np.testing.assert_allclose(model.distance_m(points), [0.5, 0.8], atol=1e-6)


def test_a_bent_road_gets_a_plane_for_each_slice() -> None:
    """Level to 8 m, then climbing at 6 % with a camber of 2 %, boxes on top of a third of it."""
    points = points_on(0, 0.02, -1.73, 30_000)
    points[:, 2] += np.maximum(points[:, 0] - 8.0, 0) * 0.06
    truth = points.copy()
    on_box = (np.abs(points[:, 1] - 6) < 2) & (points[:, 0] > 3)
    points[on_box, 2] += np.random.default_rng(4).uniform(0.2, 1.5, on_box.sum())
    model = PiecewisePlanesEstimator(HDL_64E).estimate(points, np.random.default_rng(0))
    errors_m = model.height_m(truth[:, :2]) - truth[:, 2]
    assert model.is_valid.all()
    assert np.abs(errors_m).mean() < 0.01
    assert model.gates_m.shape == (len(model.planes), 2)


def test_same_seed_gives_the_same_planes() -> None:
    points = points_on(0.01, 0.0, -1.7) + np.random.default_rng(5).normal(0, 0.02, (4000, 3))
    ground = PiecewisePlanesEstimator(HDL_64E)
    first, again = (ground.estimate(points, np.random.default_rng(9)) for _ in range(2))
    np.testing.assert_array_equal(first.planes, again.planes)


def test_an_empty_area_is_level_ground_and_says_that_no_plane_was_found() -> None:
    far = np.array([[100.0, 0, 0, 0]], np.float32)
    model = PiecewisePlanesEstimator(HDL_64E, LocalArea()).estimate(far, np.random.default_rng(0))
    assert not model.is_valid.any()
    np.testing.assert_allclose(model.height_m(np.zeros((1, 2))), [-1.73])


def test_values_that_leave_no_sample_are_refused() -> None:
    with pytest.raises(UsageError) as error:
        PiecewisePlanesConfig(subsample=2)
    assert error.value.where == "ground planes"
    assert "subsample=2" in error.value.found
