"""Objects that stand, move, start and stop, observed at several rates."""

import numpy as np
import pytest

from perception.tracking import motion_model
from perception.tracking.vehicles.motion_modes import MotionModes

_NOISE_M = 0.2
_NOISE = _NOISE_M**2 * np.eye(2)[None]


def observed(place_m: float) -> MotionModes:
    """Return the motions of a car that is observed for the first time."""
    states = motion_model.init(np.array([[place_m, 0.0]]), _NOISE, np.array([[4.0, 1.6]]))
    return MotionModes.init(states)


def driven(rate_hz: float, places_m: list[float], seed: int = 0) -> list[MotionModes]:
    """Return the motions after each observation of a car at places along x."""
    noise_m = _NOISE_M * np.random.default_rng(seed).standard_normal((len(places_m), 2))
    found = [observed(places_m[0])]
    for place_m, off_m in zip(places_m[1:], noise_m[1:], strict=True):
        center_m = np.array([[place_m, 0.0]]) + off_m
        found.append(found[-1].predicted(1 / rate_hz).corrected(center_m, _NOISE))
    return found


@pytest.mark.parametrize("rate_hz", [2.0, 5.0, 10.0, 20.0])
def test_a_parked_car_has_no_velocity_at_any_rate(rate_hz):
    states = [one.merged for one in driven(rate_hz, [10.0] * int(10 * rate_hz))]
    settled = states[len(states) // 2 :]
    assert max(np.linalg.norm(one.mean[0, 2:]) for one in settled) < 0.3
    assert max(abs(one.mean[0, 0] - 10.0) for one in settled) < 0.5
    assert driven(rate_hz, [10.0] * int(10 * rate_hz))[-1].probabilities[0, 0] > 0.9


@pytest.mark.parametrize("rate_hz", [2.0, 10.0])
@pytest.mark.parametrize("speed_m_s", [3.0, 15.0])
def test_a_moving_car_keeps_its_velocity(rate_hz, speed_m_s):
    found = driven(rate_hz, (np.arange(5 * rate_hz) / rate_hz * speed_m_s).tolist())[-1]
    assert found.merged.mean[0, 2] == pytest.approx(speed_m_s, abs=0.6)
    assert found.probabilities[0, 1] > 0.95


def test_a_car_that_starts_and_stops_changes_its_motion_within_a_second():
    times_s = np.arange(90) / 10
    places_m = np.clip(
        4 * (times_s - 3), 0, 12
    ).tolist()  # waits for three seconds, and stops after six
    standing = [one.probabilities[0, 0] for one in driven(10.0, places_m)]
    assert standing[29] > 0.9
    assert max(standing[40:60]) < 0.1
    assert standing[75] > 0.6


def test_uncertainty_of_both_motions_is_that_of_the_merged_state():
    found = observed(5.0).predicted(0.5)
    variances = np.diagonal(found.merged.covariance[0])
    np.testing.assert_allclose(
        variances[2:], found.probabilities[0, 1] * found.covariances[0, 1, 2, 2]
    )
    assert variances[0] > found.covariances[0, 0, 0, 0]


def test_a_car_is_near_where_either_motion_takes_it():
    found = observed(10.0).predicted(0.5)
    place_m = np.array([[17.0, 0.0]])
    distance = motion_model.squared_distances(found.merged, place_m[:, None], _NOISE[:, None])
    assert distance[0, 0] == pytest.approx(10.97, abs=0.01)
    assert found.squared_distances(place_m, _NOISE)[0] == pytest.approx(5.47, abs=0.01)
    assert found.squared_distances(place_m - [7.0, 0.0], _NOISE)[0] == pytest.approx(0.0)


def test_a_shift_moves_the_places_of_both_motions():
    before = observed(10.0)
    after = before.shifted(np.array([[0.5, -0.25]]))
    np.testing.assert_allclose(after.means[0] - before.means[0], [[0.5, -0.25, 0, 0]] * 2)
