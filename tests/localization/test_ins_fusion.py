from itertools import pairwise

import numpy as np
import pytest

from perception.geometry.se3 import from_euler, from_motion_vector, inverse, motion_vector
from perception.localization.ins_fusion import InsFusion
from perception.types import Frame

STEP_S = 0.1


def path(frames: int, rng: np.random.Generator, tilt_rad: float = 0.01) -> list[np.ndarray]:
    """Return poses of a drive that turns, with a body that rolls and pitches."""
    poses = [np.eye(4)]
    for _ in range(frames - 1):
        turn = np.array([*rng.normal(0, tilt_rad, 2), 0.03])
        poses.append(poses[-1] @ from_motion_vector(np.array([*turn, 0.8, 0, 0])))
    return poses


def drifting(poses: list[np.ndarray], by: np.ndarray, rng: np.random.Generator) -> list[np.ndarray]:
    """Return poses whose steps err by a bias and by chance, as those of scans do."""
    found = [poses[0]]
    for before, after in pairwise(poses):
        step = inverse(before) @ after
        found.append(found[-1] @ step @ from_motion_vector(by + rng.normal(0, 1e-4, 6)))
    return found


def jittering(poses: list[np.ndarray], rad: float, m: float, rng: np.random.Generator) -> list:
    deviations = np.repeat([rad, m], 3)
    return [pose @ from_motion_vector(rng.normal(0, deviations)) for pose in poses]


def frame(index: int, ins_world_SE3_velo: np.ndarray | None) -> Frame:
    points_velo = np.ones((1, 4), np.float32)
    return Frame(index, STEP_S * index, points_velo, world_SE3_velo=ins_world_SE3_velo)


def fused(odometry: list, ins: list) -> tuple[list[np.ndarray], InsFusion]:
    fusion, found = InsFusion(), []
    for index, (pose, stated) in enumerate(zip(odometry, ins, strict=True)):
        fusion.update(frame(index, stated), pose, is_continuous=True)
        found.append(fusion.world_SE3_odom @ pose)
    return found, fusion


def errors(poses: list[np.ndarray], true: list[np.ndarray]) -> np.ndarray:
    return np.array([motion_vector(inverse(a) @ b) for a, b in zip(true, poses, strict=True)])


def test_a_pose_neither_drifts_nor_jitters():
    rng = np.random.default_rng(0)
    true = path(200, rng)
    odometry = drifting(true, np.array([0, 0, 1e-4, 0.01, 0, 0]), rng)
    ins = jittering(true, 1e-3, 0.05, rng)
    found, fusion = fused(odometry, ins)
    worst_m = [np.linalg.norm(errors(one, true)[:, 3:], axis=1).max() for one in (odometry, ins)]
    ours = errors(found, true)[100:]
    assert worst_m[0] > 0.4 and worst_m[1] > 0.14
    assert np.sqrt((ours[:, 3:] ** 2).mean()) < 0.035  # the INS: 0.05 m
    assert np.sqrt((ours[:, :3] ** 2).mean()) < 7e-4  # the INS: 1e-3 rad
    spread = np.einsum(
        "ki,ij,kj->k",
        np.roll(ours, 3, axis=1),
        np.linalg.inv(fusion.covariance),
        np.roll(ours, 3, axis=1),
    )
    assert (spread < 10.64).mean() > 0.8  # 90 % of chi-square with six degrees of freedom


def test_what_the_ins_states_exactly_is_kept():
    rng = np.random.default_rng(1)
    true = path(60, rng)
    found, _ = fused(drifting(true, np.array([3e-3, 0, 2e-3, 0.02, 0.02, 0.05]), rng), true)
    assert np.abs(errors(found, true)[40:]).max() < 0.02


def test_the_height_of_a_planar_ins_is_that_of_the_scans():
    rng = np.random.default_rng(2)
    true = [pose.copy() for pose in path(80, rng, tilt_rad=0.0)]
    for index, pose in enumerate(true):
        pose[2, 3] = 0.02 * index  # uphill
    planar = [pose.copy() for pose in true]
    for pose in planar:
        pose[2, 3] = 1.8
    found, _ = fused(drifting(true, np.array([0, 0, 0, 0.01, 0, 0]), rng), planar)
    heights_m = np.array([pose[2, 3] for pose in found])
    assert np.diff(heights_m[10:]) == pytest.approx(0.02, abs=2e-3)
    assert errors(found, true)[45:, 3] == pytest.approx(0, abs=0.02)  # along, as the INS says


def test_without_ins_the_odometry_stays_and_a_pose_goes_on_by_it():
    rng = np.random.default_rng(3)
    true = path(50, rng)
    found, fusion = fused(true, [None] * 50)
    assert fusion.covariance is None
    assert found == pytest.approx(np.array(true))
    moved = from_euler(0, 0, 0.4, np.array([5.0, 2.0, 1.0]))
    ins = [moved @ pose for pose in true[:25]] + [None] * 25
    found, fusion = fused(true, ins)
    assert np.array(found) == pytest.approx(np.array([moved @ pose for pose in true]), abs=1e-6)
    before = fusion.covariance
    fusion.update(frame(50, None), true[-1], is_continuous=True)
    assert (np.diag(fusion.covariance) > np.diag(before)).all()


def test_a_step_that_no_scan_gave_is_left_to_the_ins():
    rng = np.random.default_rng(4)
    true = path(40, rng)
    fusion = InsFusion()
    lost = from_euler(0, 0, 1.0, np.array([30.0, 0, 0]))
    for index, pose in enumerate(true):
        odometry = pose if index < 20 else lost @ pose
        fusion.update(frame(index, pose), odometry, is_continuous=index != 20)
        assert fusion.world_SE3_odom @ odometry == pytest.approx(pose, abs=1e-6)
