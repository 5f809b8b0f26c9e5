"""Compiled functions of scan matching, each beside its reference in NumPy."""

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from perception.geometry.se3 import cross_matrix, from_euler
from perception.kernels.scan_matching import align_surfaces, distances_to_surfaces
from perception.kernels.surface_normals import ALL_KNOWN, means_and_normals, unfitted_surfaces
from perception.kernels.voxel_table import voxel_moments
from tests.rays import unit_rays

EDGE_M = 0.5


def street(seed: int = 0) -> np.ndarray:
    """Return points of a road, two walls at the sides and one across, with 1 cm of noise."""
    random = np.random.default_rng(seed)
    along, across, up = (
        random.uniform(low, high, 4000) for low, high in ((-9, 20), (-6, 6), (0, 4))
    )
    zero = np.zeros(4000)
    parts = [(along, across, zero - 1.7), (along, zero + 6, up - 1.7), (along, zero - 6, up - 1.7)]
    parts.append((zero[:800] + 20, across[:800], up[:800] - 1.7))
    points = np.concatenate([np.column_stack(part) for part in parts])
    return (points + random.normal(0, 0.01, points.shape)).astype(np.float32)


def sparse_street(beams: int) -> np.ndarray:
    """Return the points of few beams on a road between two walls, as a turning LiDAR 1.7 m above it hits them."""
    elevation = np.radians(np.linspace(-18, -4, beams))
    rays = unit_rays(np.radians(np.arange(0, 360, 0.4)), elevation)
    range_m = np.minimum(-1.7 / rays[:, 2], 6 / np.maximum(np.abs(rays[:, 1]), 1e-9))
    noise_m = np.random.default_rng(0).normal(0, 0.01, range_m.shape)
    return (rays * (range_m + noise_m)[:, None]).astype(np.float32)


def reference_voxels(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the cell, the number of points and the mean of each occupied voxel."""
    cells = np.floor(points.astype(np.float64) / EDGE_M).astype(int)
    cells, group, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    sums = [np.bincount(group.ravel(), axis) for axis in points.T.astype(np.float64)]
    return cells, counts, np.transpose(sums) / counts[:, None]


def in_order(rows: np.ndarray) -> np.ndarray:
    return rows[np.lexsort(rows[:, :3].round(6).T)]


@pytest.mark.parametrize("stride", [1, 3])
def test_voxels_and_means_equal_the_reference(stride: int) -> None:
    points = street()
    moments, (bar_of_cell, bars) = voxel_moments(np.ascontiguousarray(points[::stride]), EDGE_M)
    _, counts, means = reference_voxels(points[::stride])
    found = in_order(np.column_stack([moments[:, 1:4] / moments[:, :1], moments[:, 0]]))
    np.testing.assert_allclose(found, in_order(np.column_stack([means, counts])), atol=1e-9)
    assert bar_of_cell.max() == len(bars) - 1 < len(moments)


def reference_normal(points: np.ndarray, mean: np.ndarray) -> np.ndarray | None:
    """Return the normal of the nearest surface around a mean point; None where it is hardly determined."""
    for edges, rings in ((1, 1), (1, 2), (2, 2), (3, 2)):
        cells = np.floor(points.astype(np.float64) / (edges * EDGE_M)).astype(int)
        around = (np.abs(cells - np.floor(mean / (edges * EDGE_M))) <= rings).all(axis=1)
        if len(np.unique(cells[around], axis=0)) < 5:
            continue
        found = np.linalg.eigh(np.cov(points[around].T.astype(np.float64), bias=True))
        through, across, along = found.eigenvalues
        normal = found.eigenvectors[:, 0]
        is_faced = abs(normal @ mean) > 0.02 * np.linalg.norm(mean)
        if across >= 0.35 * along and (edges == 1 or through <= 0.05 * across) and is_faced:
            # A corner has two directions that are about as flat.
            return normal if across > 2 * through else None
    return np.zeros(3)


@pytest.mark.parametrize("beams", [None, 8])
def test_normals_equal_the_reference(beams: int | None) -> None:
    points = street() if beams is None else sparse_street(beams)
    moments, table = voxel_moments(points, EDGE_M)
    surfaces = means_and_normals(moments, table, EDGE_M)
    compared = 0
    for mean, normal in zip(surfaces[::20, :3], surfaces[::20, 3:], strict=True):
        expected = reference_normal(points, mean)
        if expected is not None:
            assert abs(normal @ expected) > 1 - 1e-6 or not (normal.any() or expected.any())
            compared += expected.any()
    assert compared > 10


def test_normals_are_found_where_points_are_matched_as_if_all_were() -> None:
    points = sparse_street(16)
    moments, table = voxel_moments(points, EDGE_M)
    surfaces = means_and_normals(moments, table, EDGE_M)
    source = surfaces[surfaces[:, 0] > 5]
    arguments = (source, np.eye(4), EDGE_M, (1e-3, 1e-3), 15, 0.0, 0.0)
    target, normals = unfitted_surfaces(moments, EDGE_M)
    found = align_surfaces(target, table, EDGE_M, normals, *arguments)
    expected = align_surfaces(surfaces, table, EDGE_M, ALL_KNOWN, *arguments)
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, other)
    is_known = ~np.isnan(target[:, 3])
    assert 0.1 < is_known.mean() < 0.6
    np.testing.assert_array_equal(target[is_known], surfaces[is_known])


def test_a_beam_on_the_road_gives_no_normal_of_its_own() -> None:
    points = sparse_street(8)
    moments, table = voxel_moments(points, EDGE_M)
    surfaces = means_and_normals(moments, table, EDGE_M)
    of_road = surfaces[(np.abs(surfaces[:, 1]) < 3) & (surfaces[:, 2] < -1.5)]
    known = of_road[of_road[:, 3:].any(axis=1)]
    assert len(known) > 0.3 * len(of_road)
    assert np.quantile(np.abs(known[:, 5]), 0.05) > 0.99


@pytest.mark.parametrize(("elevation", "share"), [(0.1, 0.0), (-0.1, 0.0), (None, 1.0)])
def test_what_a_beam_hits_in_leaves_is_no_surface(elevation: float | None, share: float) -> None:
    random = np.random.default_rng(0)
    azimuth, range_m = random.uniform(-0.3, 0.3, 3000), random.uniform(15, 25, 3000)
    height_m = np.full(3000, -1.7) if elevation is None else range_m * np.tan(elevation)
    points = np.column_stack([range_m * np.cos(azimuth), range_m * np.sin(azimuth), height_m])
    moments, table = voxel_moments(points.astype(np.float32), EDGE_M)
    normals = means_and_normals(moments, table, EDGE_M)[:, 3:]
    assert normals.any(axis=1).mean() == pytest.approx(share, abs=0.06)


def normal_equations(
    target: np.ndarray, source: np.ndarray, pose: np.ndarray, robust_m: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the moved points, and the information and gradient of the match of each with the nearest of the target."""
    moved = source[:, :3] @ pose[:3, :3].T + pose[:3, 3]
    away_m, nearest = cKDTree(target[:, :3]).query(moved)
    is_matched = away_m < EDGE_M
    moved, matched = moved[is_matched], target[nearest[is_matched]]
    turned = source[is_matched, 3:] @ pose[:3, :3].T
    noise = 2 * np.eye(3) - 0.999 * sum(
        normals[:, :, None] * normals[:, None] for normals in (turned, matched[:, 3:])
    )
    jacobians = np.concatenate(
        [[-cross_matrix(point) for point in moved], np.tile(np.eye(3), (len(moved), 1, 1))], axis=2
    )
    weighted = np.linalg.solve(noise, jacobians)
    residuals_m = matched[:, :3] - moved
    if robust_m > 0:
        squared = np.einsum("ni,nij,nj->n", residuals_m, np.linalg.inv(noise), residuals_m)
        weighted *= (1 + squared * 2e-3 / robust_m**2)[:, None, None] ** -2
    information = np.einsum("nij,nik->njk", jacobians, weighted)
    return moved, information, np.einsum("nij,ni->nj", weighted, residuals_m)


@pytest.mark.parametrize("robust_m", [0.0, 0.1])
def test_covariance_is_that_of_leaving_out_eighths_drawn_to_the_information(
    robust_m: float,
) -> None:
    clouds = []
    for seed in (0, 1):
        moments, table = voxel_moments(street(seed), EDGE_M)
        clouds.append((means_and_normals(moments, table, EDGE_M), table))
    (target, table), (source, _) = clouds
    # Steps so small that the matches are those of the pose.
    pose, *_, covariance = align_surfaces(
        target, table, EDGE_M, ALL_KNOWN, source, np.eye(4), EDGE_M, (1e-5, 1e-5), 30, 0.0, robust_m
    )
    moved, information, gradients = normal_equations(target, source, pose, robust_m)
    eighths = np.floor(np.arctan2(moved[:, 1], moved[:, 0]) % (2 * np.pi) / (np.pi / 4))
    expected = np.zeros((6, 6))
    for eighth in range(8):
        rows = eighths == eighth
        motion = np.linalg.solve(information[~rows].sum(axis=0), gradients[rows].sum(axis=0))
        expected += 7 / 8 * np.outer(motion, motion)
    whole = information.sum(axis=0)
    size = np.trace(expected @ whole) / 6
    expected += 0.2 * (size * np.linalg.inv(whole) - expected)
    np.testing.assert_allclose(covariance, expected, atol=1e-3 * np.abs(expected).max())


def test_points_beyond_the_map_are_left_out() -> None:
    outside = [[1e9, 0, 0], [np.nan, 0, 0], [0, -120.1, 0], [0, 0, 19.1], [0, 0, -12.1]]
    inside = [[1, 2, 3], [119.9, -119.9, 18.9], [0, 0, -11.9]]
    moments, _ = voxel_moments(np.array(outside + inside, np.float32), EDGE_M)
    np.testing.assert_allclose(moments[:, 0], 1)
    np.testing.assert_allclose(moments[:, 1:4], inside, rtol=1e-6)


def test_positions_beyond_the_map_have_no_match() -> None:
    points = np.array([[119.9, 119.9, 18.9], [-119.9, -119.9, -11.9]], np.float32)
    moments, table = voxel_moments(points, EDGE_M)
    surfaces = np.hstack([moments[:, 1:4], np.tile([0.0, 0.0, 1.0], (2, 1))])
    for lift_m, expected_m in ((0.3, [0.3, 0.3]), (2.5, [np.inf, np.inf])):
        lift = np.eye(4)
        lift[2, 3] = lift_m
        away_m = distances_to_surfaces(surfaces, table, EDGE_M, surfaces, lift, 2.0)
        np.testing.assert_allclose(away_m, expected_m)


@pytest.mark.parametrize("reach_m", [0.2, 0.5, 1.4])
def test_matches_are_the_nearest_within_reach(reach_m: float) -> None:
    target, source = street(0), street(1)[::5] + np.float32(0.3)
    _, _, places = reference_voxels(target)
    _, _, moved = reference_voxels(source)
    moments, table = voxel_moments(target, EDGE_M)
    surfaces = np.hstack([moments[:, 1:4] / moments[:, :1], np.zeros((len(moments), 3))])
    points = np.hstack([moved, np.zeros((len(moved), 3))])
    _, matches, error, *_ = align_surfaces(
        surfaces, table, EDGE_M, ALL_KNOWN, points, np.eye(4), reach_m, (1e-3, 1e-3), 0, 0.0, 0.0
    )
    away_m, _ = cKDTree(places).query(moved, distance_upper_bound=reach_m)
    away_m = away_m[np.isfinite(away_m)]
    assert matches == len(away_m)
    # Without normals the covariances are the identity each, and the error is half a quarter of the squared distance.
    np.testing.assert_allclose(error, (away_m**2).sum() / 4)


def test_alignment_recovers_a_motion_and_repeats_itself() -> None:
    truth = from_euler(0.004, -0.006, 0.02, np.array([0.3, -0.1, 0.05]))
    points = street(1)
    moved = (points @ truth[:3, :3].T + truth[:3, 3]).astype(np.float32)
    clouds = []
    for part in (moved, street(2)):
        moments, table = voxel_moments(part, EDGE_M)
        clouds.append((means_and_normals(moments, table, EDGE_M), table))
    arguments = (
        *clouds[0],
        EDGE_M,
        ALL_KNOWN,
        clouds[1][0],
        np.eye(4),
        0.5,
        (1e-4, 3e-4),
        20,
        0.0,
        0.0,
    )
    pose, matches, _, is_converged, _ = align_surfaces(*arguments)
    assert is_converged
    assert matches > 0.8 * len(clouds[1][0])
    np.testing.assert_allclose(pose, truth, atol=6e-3)
    np.testing.assert_array_equal(align_surfaces(*arguments)[0], pose)


def test_robust_matches_are_hardly_pulled_by_what_moved() -> None:
    """A fifth of the street came 0.3 m along: equal weights follow it a third of the way, robust ones a tenth."""
    moments, table = voxel_moments(street(0), EDGE_M)
    target = means_and_normals(moments, table, EDGE_M)
    source = target.copy()
    source[(source[:, 1] > 0) & (source[:, 0] > 0), :2] += [0.1, 0.3]
    ways_m = []
    for robust_m in (0.0, 0.1):
        arguments = (target, table, EDGE_M, ALL_KNOWN, source, np.eye(4), 0.5, (1e-5, 1e-5), 40)
        pose, *_ = align_surfaces(*arguments, 0.0, robust_m)
        ways_m.append(np.linalg.norm(pose[:3, 3]))
    assert ways_m[0] > 0.05
    assert ways_m[1] < ways_m[0] / 3


def test_distances_are_those_from_the_surfaces() -> None:
    moments, table = voxel_moments(street(0), EDGE_M)
    surfaces = means_and_normals(moments, table, EDGE_M)
    raised = surfaces[(np.abs(surfaces[:, 1]) < 4) & (surfaces[:, 0] < 18)]
    lift = np.eye(4)
    lift[2, 3] = 0.2
    away_m = distances_to_surfaces(surfaces, table, EDGE_M, raised, lift, 1.0)
    has_surface = raised[:, 3:].any(axis=1)
    assert has_surface.mean() > 0.98
    np.testing.assert_allclose(away_m[has_surface], 0.2, atol=0.02)
    np.testing.assert_allclose(away_m[~has_surface], 0, atol=0.22)
    lift[2, 3] = 50
    assert np.isinf(distances_to_surfaces(surfaces, table, EDGE_M, raised, lift, 1.0)).all()


def test_prior_and_matches_balance_as_in_the_reference() -> None:
    """At the end of an alignment, the step of the plain normal equations with the prior S H^-1 S is zero."""
    clouds = []
    for part in (street(0), np.ascontiguousarray(street(1)[::3])):
        moments, table = voxel_moments(part, EDGE_M)
        # Without normals a match tells half of the identity.
        places = moments[:, 1:4] / moments[:, :1]
        clouds.append((np.hstack([places, np.zeros_like(places)]), table))
    (target, table), (source, _) = clouds
    guess = from_euler(0.01, -0.01, 0.02, np.array([0.15, -0.1, 0.05]))
    pose, matches, _, is_converged, _ = align_surfaces(
        target, table, EDGE_M, ALL_KNOWN, source, guess, 0.5, (1e-7, 1e-7), 60, 2e-3, 0.0
    )
    assert is_converged
    moved = source[:, :3] @ pose[:3, :3].T + pose[:3, 3]
    away_m, near = cKDTree(target[:, :3]).query(moved, distance_upper_bound=0.5)
    moved, near = moved[np.isfinite(away_m)], near[np.isfinite(away_m)]
    assert matches == len(moved)
    hessian, gradient = np.zeros((6, 6)), np.zeros(6)
    for point, match in zip(moved, target[near, :3], strict=True):
        jacobian = np.hstack([np.cross(np.eye(3), point).T, np.eye(3)])
        hessian += jacobian.T @ jacobian / 2
        gradient += jacobian.T @ (match - point) / 2
    even = np.diag([100.0] * 3 + [1.0] * 3) * matches * 2e-3 / (2 * 1e-3)
    prior = even @ np.linalg.inv(hessian) @ even
    turn = guess[:3, :3] @ pose[:3, :3].T
    between = np.concatenate(
        [Rotation.from_matrix(turn).as_rotvec(), guess[:3, 3] - turn @ pose[:3, 3]]
    )
    step = np.linalg.solve(hessian + prior, gradient + prior @ between)
    np.testing.assert_allclose(step, 0, atol=2e-5)
    assert np.linalg.norm(between) > 0.01
