"""The change of the calibration with which corners come to be where the motion brings them."""

from dataclasses import replace

import numpy as np
import pytest

from perception.calibration.motion_alignment import align_motion, refine_by_motion
from perception.calibration.offset import UNKNOWN, OffsetEstimate
from perception.calibration.surface_corners import (
    CornerTracks,
    ScanView,
    SurfaceCorners,
    SweepVelocity,
)
from perception.geometry.camera import project
from perception.geometry.se3 import from_euler, from_motion_vector, inverse, motion_vector
from perception.kernels.corner_sums import SHARED, UNKNOWNS, add_corner_sums
from tests.reference.corner_misfits import corner_misfits
from tests.textured_scenes import CAM_SE3_VELO, IMAGE_P_CAM, PLANES, SIZE_PX

NOTHING = OffsetEstimate(np.zeros(6), UNKNOWN)
ERROR = np.array([0.01, -0.015, 0.02, 0.05, -0.04, 0.06])
VIEW = ScanView(SIZE_PX, IMAGE_P_CAM, np.empty((0, 4), np.float32), CAM_SE3_VELO)


def tracks(seed, error=None, motion_m=0.6, noise_px=0.0):
    """Return corners on the walls and the ground of a street, and where a camera with a calibration error expects them.

    The corners are exact, and so are their planes; the frame comes with the wrong calibration.
    """
    rng = np.random.default_rng(seed)
    pixels = rng.uniform([5, 80], [615, 180], (150, 2))
    planes = PLANES[rng.integers(0, 3, 150)]
    stated = inverse(from_motion_vector(np.zeros(6) if error is None else error)) @ CAM_SE3_VELO
    later = inverse(from_euler(0.01, -0.005, 0.02, np.array([motion_m, 0.02, 0.01])))
    sweep = SweepVelocity(np.array([0, 0, 0.2]), np.array([6.0, 0, 0]), 0.1)
    true = SurfaceCorners(VIEW, pixels, planes, np.eye(4))
    points = true.surfaces_cam(np.eye(4)).points_m()
    is_ahead = points[:, 2] > 2
    moved = CAM_SE3_VELO @ later @ inverse(CAM_SE3_VELO)
    later_px = project(IMAGE_P_CAM @ moved, points)[0] + noise_px * rng.normal(size=pixels.shape)
    view = replace(true.view, cam_SE3_velo=stated)
    return CornerTracks(replace(true, view=view)[is_ahead], later_px[is_ahead], later, sweep)


def test_an_error_of_any_kind_is_found():
    found = align_motion([tracks(seed, ERROR) for seed in range(4)], np.zeros(6), NOTHING).estimate
    np.testing.assert_allclose(found.offset[:3], ERROR[:3], atol=1e-3)
    np.testing.assert_allclose(found.offset[3:5], ERROR[3:5], atol=6e-3)
    # How far ahead the LiDAR is only shows where surfaces end, and there are none.
    assert abs(found.offset[5] - ERROR[5]) < found.deviations[5]
    assert found.deviations[5] > 5 * found.deviations[4]


def test_slopes_are_those_of_the_misfits():
    one, offset = tracks(0, ERROR), from_motion_vector(0.3 * ERROR)
    left_px, slopes_px = corner_misfits(one, offset, 0.2, np.zeros(6))
    for axis in range(UNKNOWNS):
        step = 1e-6 * np.eye(UNKNOWNS)[axis]
        ahead_px, _ = corner_misfits(
            one, from_motion_vector(step[:6]) @ offset, 0.2 + step[6], step[7:]
        )
        expected = (ahead_px - left_px) / 1e-6
        np.testing.assert_allclose(expected, slopes_px[:, :, axis], rtol=1e-3, atol=0.05)


def test_sums_are_those_of_the_misfits():
    one, offset = tracks(0, ERROR, noise_px=1.0), from_motion_vector(0.3 * ERROR)
    one.corners.planes_velo[3] = np.nan
    motion_error = np.array([1e-3, -2e-3, 1e-3, 0.01, 0.02, -0.01])
    left_px, slopes_px = corner_misfits(one, offset, 0.2, motion_error)
    deviations_px = np.linspace(0.2, 0.6, len(one))
    misfits = np.linalg.norm(left_px, axis=1) / deviations_px
    known = np.isfinite(misfits)
    squares = np.square(misfits[known] / 3.0)
    weights = 1 / np.square((1 + squares) * deviations_px[known])
    rows = slopes_px[known]
    cam_SE3_velo = offset @ one.corners.view.cam_SE3_velo
    # Of two frames the second one: the errors of the first one's motion are left as they are.
    curvature, slope = np.zeros((UNKNOWNS + 6, UNKNOWNS + 6)), np.zeros(UNKNOWNS + 6)
    cost = add_corner_sums(
        one.corners.planes_velo, one.corners.rays, one.later_px, deviations_px, one.sweep_shifts_m,
        cam_SE3_velo, one.later_SE3_velo, from_motion_vector(motion_error), IMAGE_P_CAM, one.corners.view.center_m,
        0.2, 3.0, 3.0, UNKNOWNS, curvature, slope,
    )  # fmt: skip
    inliers = np.mean(misfits[known] < 3)
    assert 0.05 < inliers < 0.95
    expected_slope = inliers**2 * np.einsum("k,kri,kr->i", weights, rows, left_px[known])
    expected = inliers**2 * np.einsum("k,kri,krj->ij", weights, rows, rows)
    its = [*range(SHARED), *range(UNKNOWNS, UNKNOWNS + 6)]
    np.testing.assert_allclose(slope[its], expected_slope, atol=1e-6)
    np.testing.assert_allclose(curvature[np.ix_(its, its)], expected, atol=1e-6)
    assert not slope[SHARED:UNKNOWNS].any()
    assert not curvature[SHARED:UNKNOWNS].any()
    assert cost == pytest.approx(4.5 * ((squares / (1 + squares)).sum() + 1))
    assert known.sum() == len(one) - 1


def test_what_moves_by_itself_counts_little():
    frames = [tracks(seed, ERROR, noise_px=0.1) for seed in range(4)]
    for one in frames:
        one.later_px[::5] += [15.0, 4.0]
    found = align_motion(frames, np.zeros(6), NOTHING).estimate
    np.testing.assert_allclose(found.offset[:3], ERROR[:3], atol=3e-3)


def test_deviations_hold_the_errors_of_noisy_tracks():
    shares = []
    for seed in range(8):
        frames = [tracks(10 * seed + number, noise_px=0.3) for number in range(3)]
        found = align_motion(frames, np.zeros(6), NOTHING).estimate
        shares.append(found.offset / found.deviations)
    assert np.abs(shares).max() < 3
    assert np.std(shares) > 0.1


def test_what_is_known_holds_what_motion_does_not_tell():
    """A motion of a centimetre tells nothing, and the offset stays where other evidence has put it."""
    known = OffsetEstimate(ERROR, np.full(6, 1e-4))
    found = align_motion([tracks(0, motion_m=0.01)], np.zeros(6), known).estimate
    np.testing.assert_allclose(found.offset, ERROR, atol=2e-4)


@pytest.mark.parametrize("turn", [-1, 1])
def test_a_sweep_is_no_error_of_the_calibration(turn):
    """Planes as a turning LiDAR measures them in motion: those at the left earlier than those at the right, or later."""
    frames = []
    for seed in range(4):
        one = tracks(seed)
        planes = one.corners.planes_velo.copy()
        planes[:, 3] -= turn * one.sweep_shifts_m
        frames.append(replace(one, corners=replace(one.corners, planes_velo=planes)))
    found = align_motion(frames, np.zeros(6), NOTHING).estimate
    assert np.abs(found.offset[:3]).max() < np.radians(0.15)


def test_the_cost_is_lowest_at_the_truth():
    frames = [tracks(seed, ERROR, noise_px=0.1) for seed in range(3)]
    known = OffsetEstimate(ERROR, UNKNOWN)
    there = align_motion(frames, ERROR, known).cost
    tight = OffsetEstimate(np.zeros(6), np.full(6, 1e-4))
    assert align_motion(frames, np.zeros(6), tight).cost > there + 50


def test_an_estimate_is_refined_by_motion_and_never_surer_than_scenes_allow():
    frames = []
    for seed in range(4):
        one = tracks(seed, ERROR)
        corners = replace(one.corners, offset_SE3_cam=from_motion_vector(ERROR))
        frames.append(replace(one, corners=corners))
    by_edges = OffsetEstimate(ERROR + np.array([0.002, 0, -0.002, 0.01, 0, 0.01]), np.full(6, 0.01))
    found = refine_by_motion(frames, by_edges).estimate
    assert np.abs(found.offset - ERROR)[:3].max() < 1e-3
    assert (found.deviations >= [*np.radians([0.06, 0.07, 0.09]), 0.010, 0.012, 0.015]).all()


def test_an_offset_and_its_transform_are_one():
    np.testing.assert_allclose(motion_vector(from_motion_vector(ERROR)), ERROR, atol=1e-12)
