"""Challenges of tracks made by hand."""

import numpy as np
import pytest

from perception.evaluation.single_object.challenges import Challenge, variations
from perception.evaluation.single_object.track import TrueTrack
from perception.types import Boxes3D


def track(
    x_m: np.ndarray,
    *,
    yaw_rad: np.ndarray | float = 0.0,
    occlusion: np.ndarray | int = 0,
    frames: np.ndarray | None = None,
) -> TrueTrack:
    count = len(x_m)
    frames = np.arange(count) if frames is None else frames
    return TrueTrack(
        frames=frames,
        stamps_s=frames * 0.1,
        boxes_velo=Boxes3D(
            np.column_stack([x_m, np.zeros(count), np.full(count, -1.7)]),
            np.ones((count, 3)),
            np.broadcast_to(yaw_rad, count) * 1.0,
        ),
        boxes_px=np.zeros((count, 4)),
        velocities_m_s=np.zeros((count, 2)),
        occlusion=np.broadcast_to(occlusion, count),
    )


STILL = np.full(20, 10.0)


def test_an_object_that_stays_before_the_vehicle_is_no_challenge():
    found = variations(track(STILL))
    assert found.challenges() == ()
    assert (found.occluded_share, found.turn_deg, found.distance_ratio) == (0, 0, 1)


@pytest.mark.parametrize(
    ("levels", "expected"),
    [
        ([0] * 19 + [1], ()),  # one frame of twenty
        ([0] * 18 + [1, 2], (Challenge.OCC,)),
        ([3] * 20, ()),  # unknown is not occluded
    ],
)
def test_occlusion(levels: list[int], expected: tuple[Challenge, ...]):
    assert variations(track(STILL, occlusion=np.array(levels))).challenges() == expected


def test_frames_without_a_label_between_the_first_and_the_last_are_occluded():
    frames = np.delete(np.arange(22), [8, 9, 10])
    found = variations(track(np.full(19, 10.0), frames=frames))
    assert found.occluded_share == pytest.approx(3 / 22)
    assert found.challenges() == (Challenge.OCC,)


def test_pose_is_the_outermost_headings_across_the_seam():
    yaw = np.linspace(3.0, 3.0 + np.radians(51), 20)
    wrapped = (yaw + np.pi) % (2 * np.pi) - np.pi
    assert variations(track(STILL, yaw_rad=wrapped)).turn_deg == pytest.approx(51)
    assert variations(track(STILL, yaw_rad=wrapped)).challenges() == (Challenge.POS,)
    assert variations(track(STILL, yaw_rad=wrapped * 0.1)).challenges() == ()


def test_distance_must_double():
    steady = np.linspace(10, 19.9, 20)
    assert variations(track(steady)).challenges() == ()
    assert variations(track(np.linspace(10, 20, 20))).challenges() == (Challenge.DIS,)


def test_relative_velocity_is_measured_over_a_second():
    accelerates = 30 + np.concatenate([np.zeros(15), 0.35 * np.arange(15)])  # to 3.5 m/s
    found = variations(track(accelerates))
    assert found.speed_change_m_s == pytest.approx(3.5)
    assert found.challenges() == (Challenge.RVL,)
    leaves = variations(track(10 + 0.5 * np.arange(20)))  # steadily at 5 m/s
    assert leaves.speed_change_m_s == pytest.approx(0.0, abs=1e-9)
    jitter = 30 + np.where(np.arange(30) % 2, 0.2, -0.2)
    assert variations(track(jitter)).speed_change_m_s < 0.5


def test_less_than_a_second_has_no_change_of_speed():
    assert variations(track(np.array([10.0, 30.0]))).speed_change_m_s == 0.0
    assert variations(track(np.array([10.0]))).distance_ratio == 1.0
