"""Errors of poses since the first scan, in a world that is turned, and intervals of random walks."""

from dataclasses import replace

import numpy as np
import pytest

from perception.evaluation.pose_intervals import PoseIntervals
from perception.geometry.se3 import from_euler
from tests.known_result import known_result

STEP = from_euler(0, 0, 0.01, np.array([1.0, 0, 0]))
RESULT = known_result()


def pose_at(index, start):
    pose = start
    for _ in range(index):
        pose = pose @ STEP
    return pose


def result_at(index, pose, covariance):
    frame = replace(RESULT.frame, index=index, stamp_s=0.1 * index)
    return replace(RESULT, frame=frame, world_SE3_velo=pose, pose_covariance=covariance)


def test_a_world_that_begins_elsewhere_is_no_error_and_covariances_turn_with_it():
    true = [pose_at(index, np.eye(4)) for index in range(3)]
    left = from_euler(0, 0, np.pi / 2, np.array([100.0, 50.0, 3.0]))
    measured = PoseIntervals(true)
    # 0.1 m ahead of the truth is along y of the world.
    ahead = from_euler(0, 0, 0, np.array([0.1, 0, 0]))
    covariance = np.diag([1e-8, 0.1**2, 1e-8, 1e-8, 1e-8, 1e-8])
    for index in range(3):
        pose = left @ (ahead if index else np.eye(4)) @ true[index]
        measured.update(result_at(index, pose, covariance))
    found = measured.compute()
    assert list(found) == ["up to 1 s"]
    metrics = found["up to 1 s"]
    assert metrics.frames == 2
    assert metrics.position_m == pytest.approx(0.1)
    assert metrics.rotation_deg == pytest.approx(0, abs=1e-6)
    assert (metrics.position_coverage, metrics.rotation_coverage) == (1.0, 1.0)


@pytest.mark.parametrize(("ratio", "expected"), [(1.0, 0.9), (0.5, 0.33)])
def test_intervals_of_a_random_error_hold_what_they_say(ratio, expected):
    random = np.random.default_rng(0)
    true = [pose_at(index, np.eye(4)) for index in range(2000)]
    measured = PoseIntervals(true)
    deviations = np.repeat([0.05, 0.002], 3)
    for index, pose in enumerate(true):
        off = random.normal(0, deviations) * (index > 0)
        found = pose.copy()
        found[:3, :3] = from_euler(*off[3:])[:3, :3] @ pose[:3, :3]
        found[:3, 3] += off[:3]
        covariance = np.diag((ratio * deviations) ** 2) * (index > 0)
        measured.update(result_at(index, found, covariance))
    long = measured.compute()["from 5 s"]
    assert long.position_coverage == pytest.approx(expected, abs=0.04)
    np.testing.assert_allclose(measured.errors.deviation_ratios(), 1 / ratio, rtol=0.1)
    assert long.rotation_coverage == pytest.approx(expected, abs=0.04)


def test_without_exact_poses_errors_are_unknown():
    measured = PoseIntervals(None)
    measured.update(result_at(0, np.eye(4), np.eye(6)))
    assert measured.compute() == {}
