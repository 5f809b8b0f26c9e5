"""The bias of elevations beside its reference in NumPy."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from perception.geometry.se3 import from_euler, from_motion_vector, inverse, transform_points
from perception.kernels.elevation_bias import elevation_bias
from perception.kernels.surface_normals import ALL_KNOWN, means_and_normals
from perception.kernels.voxel_table import voxel_moments
from perception.localization.elevation_bias import raised
from tests.kernels.test_scan_matching import EDGE_M, street

MOTION = from_euler(0, 0, 0.02, np.array([3.0, 0.1, 0.0]))


def surfaces(points: np.ndarray) -> tuple[np.ndarray, tuple]:
    moments, table = voxel_moments(np.ascontiguousarray(points), EDGE_M)
    return means_and_normals(moments, table, EDGE_M), table


def raising(points: np.ndarray) -> np.ndarray:
    """Return the (N, 3) ways of points as their elevations grow."""
    across = np.hypot(points[:, 0], points[:, 1])
    return np.column_stack([-points[:, :2] * points[:, 2:3] / across[:, None], across])


def reference_bias(
    target: np.ndarray, source: np.ndarray, pose: np.ndarray, reach_m: float
) -> tuple[float, float]:
    tree, bias_rad = cKDTree(target[:, :3]), 0.0
    for _ in range(10):
        moved = source[:, :3] @ pose[:3, :3].T + pose[:3, 3]
        away_m, near = tree.query(moved, distance_upper_bound=reach_m)
        is_matched = np.isfinite(away_m)
        is_matched[is_matched] &= (target[near[is_matched], 3:] != 0).any(axis=1)
        moved, of_target = moved[is_matched], target[near[is_matched]]
        normals = of_target[:, 3:]
        apart = raising(of_target[:, :3]) - raising(source[is_matched, :3]) @ pose[:3, :3].T
        growing = (normals * apart).sum(axis=1)
        errors = (normals * (of_target[:, :3] - moved)).sum(axis=1) + bias_rad * growing
        slopes = np.column_stack([np.cross(moved, normals), normals, -growing])
        weights = 1 / (1 + (errors / 0.03) ** 2) ** 2
        hessian = (slopes * weights[:, None]).T @ slopes
        step = np.linalg.solve(hessian, (slopes * weights[:, None]).T @ errors)
        pose, bias_rad = from_motion_vector(step[:6]) @ pose, bias_rad + step[6]
    variance = np.linalg.inv(hessian)[6, 6] * (weights * errors**2).sum() / weights.sum()
    return float(bias_rad), float(variance)


@pytest.mark.parametrize("too_high_rad", [0.0, 0.004])
def test_the_bias_equals_the_reference(too_high_rad: float) -> None:
    target, table = surfaces(raised(street(0), too_high_rad))
    source, _ = surfaces(raised(transform_points(inverse(MOTION), street(1)), too_high_rad))
    off = MOTION @ from_euler(0.002, -0.003, 0.001, np.array([0.02, -0.01, 0.03]))
    found_rad, variance = elevation_bias(target, table, EDGE_M, ALL_KNOWN, source, off, EDGE_M)
    expected_rad, expected = reference_bias(target, source, off, EDGE_M)
    assert abs(found_rad - expected_rad) < 0.1 * np.sqrt(expected)
    assert np.isclose(variance, expected, rtol=0.02)
    assert abs(found_rad + too_high_rad) < 4 * np.sqrt(variance)


def test_scans_that_do_not_meet_tell_nothing() -> None:
    target, table = surfaces(street(0))
    far = from_euler(0, 0, 0, np.array([0.0, 90.0, 0.0]))
    found_rad, variance = elevation_bias(target, table, EDGE_M, ALL_KNOWN, target, far, EDGE_M)
    assert found_rad == 0
    assert np.isnan(variance)
