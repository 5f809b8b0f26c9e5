"""A constant error of the elevations of beams: found where there is one, not confirmed where there is none."""

import numpy as np
import pytest

from perception.geometry.se3 import from_euler, inverse, motion_vector
from perception.localization.alignment import PreprocessedPoints, preprocess_points
from perception.localization.elevation_bias import ElevationBias, raised
from perception.localization.odometry import LidarOdometry
from tests.localization.test_odometry import STEP_S, observed_from, path

FIVE_METRES = from_euler(0, 0, 0.02, np.array([5.0, 0.1, 0.0]))


def pair(seed: int, too_high_deg: float) -> tuple[PreprocessedPoints, PreprocessedPoints]:
    """Return two scans 5 m apart whose elevations are too high."""
    first, second = (
        preprocess_points(
            raised(observed_from(pose, 2 * seed + late), np.radians(too_high_deg)), 0.5
        )
        for late, pose in enumerate((np.eye(4), FIVE_METRES))
    )
    return first, second


def test_points_rise_by_the_angle_and_keep_range_and_azimuth() -> None:
    points = observed_from(np.eye(4), 0)
    found = raised(points, 0.01)
    before, after = (
        np.arctan2(one[:, 2], np.hypot(one[:, 0], one[:, 1])) for one in (points, found)
    )
    np.testing.assert_allclose(after - before, 0.01, atol=1e-5)
    for change in (
        lambda p: np.linalg.norm(p[:, :3], axis=1),
        lambda p: np.arctan2(p[:, 1], p[:, 0]),
    ):
        np.testing.assert_allclose(change(found), change(points), rtol=1e-5)
    assert raised(points, 0.0) is points


@pytest.mark.parametrize("too_high_deg", [-0.25, 0.12])
def test_a_bias_is_found_to_a_hundredth_of_a_degree_though_the_motion_is_off(too_high_deg) -> None:
    bias = ElevationBias()
    off = FIVE_METRES @ from_euler(0.002, 0.004, 0, np.array([0.03, 0.02, 0.05]))
    changes = [bias.update(*pair(seed, too_high_deg), off) for seed in range(4)]
    assert changes[:2] == [0, 0]
    assert abs(np.degrees(bias.correction_rad) + too_high_deg) < 0.015
    assert np.isclose(sum(changes), bias.correction_rad)


def test_no_bias_is_confirmed_where_there_is_none() -> None:
    bias = ElevationBias()
    assert not any(bias.update(*pair(seed, 0.0), FIVE_METRES) for seed in range(12))
    assert bias.correction_rad == 0


def test_pairs_that_disagree_prove_nothing() -> None:
    bias = ElevationBias()
    for seed, too_high_deg in enumerate((0.3, -0.1, 0.25, 0.0, -0.2, 0.2)):
        bias.update(*pair(seed, too_high_deg), FIVE_METRES)
    assert bias.correction_rad == 0


def test_scans_without_surfaces_tell_nothing() -> None:
    bias, empty = ElevationBias(), preprocess_points(np.zeros((0, 4), np.float32), 0.5)
    assert bias.update(empty, empty, FIVE_METRES) == 0
    assert bias.correction_rad == 0


def test_the_path_by_scans_alone_tilts_less_and_an_ins_keeps_it() -> None:
    truth, found = path(45, speed_m_s=10.0, turn_rad_s=0.0), {}
    for prior in ("none", "uncorrected", "INS"):
        odometry = LidarOdometry()
        if prior == "uncorrected":
            odometry._elevation.update = lambda *_: 0.0
        for index, pose in enumerate(truth):
            points = raised(observed_from(pose, index), np.radians(-0.4))
            ins = pose if prior == "INS" else None
            last = odometry.update(points, index * STEP_S, ins).world_SE3_velo
        tilt_deg = np.degrees(np.abs(motion_vector(inverse(pose) @ last)[1]))
        found[prior] = tilt_deg, np.degrees(odometry._elevation.correction_rad)
    assert found["uncorrected"][0] > 0.5
    assert found["none"][0] < 0.6 * found["uncorrected"][0]
    assert abs(found["none"][1] - 0.4) < 0.03
    assert found["INS"][1] == 0
