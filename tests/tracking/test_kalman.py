import numpy as np
import pytest
from scipy.stats import chi2

from benchmarks.reference.point_tracker import ReferenceKalmanFilter
from perception.tracking.kalman import Gaussians, mahalanobis_squared, predict, update

STEP_S = 0.1
TRANSITION = np.eye(4) + STEP_S * np.eye(4, k=2)
OBSERVATION = np.eye(2, 4)
# White acceleration of 2 m/s² over one step, and a position measured to 30 cm and 20 cm.
PUSH = np.array([[STEP_S**2 / 2, 0], [0, STEP_S**2 / 2], [STEP_S, 0], [0, STEP_S]])
PROCESS_NOISE = 4.0 * PUSH @ PUSH.T
MEASUREMENT_NOISE = np.diag([0.3**2, 0.2**2])


def random_gaussians(count: int, rng: np.random.Generator) -> Gaussians:
    root = rng.normal(size=(count, 4, 4))
    return Gaussians(rng.normal(size=(count, 4)), root @ root.transpose(0, 2, 1) + 0.1 * np.eye(4))


def one_by_one(states: Gaussians) -> list[ReferenceKalmanFilter]:
    return [
        ReferenceKalmanFilter(*state) for state in zip(states.mean, states.covariance, strict=True)
    ]


def assert_same(states: Gaussians, plain: list[ReferenceKalmanFilter]) -> None:
    np.testing.assert_allclose(states.mean, [f.mean for f in plain], atol=1e-10)
    np.testing.assert_allclose(states.covariance, [f.covariance for f in plain], atol=1e-10)


def test_prediction_by_hand():
    states = Gaussians(np.array([[1.0, 2.0, 3.0, -4.0]]), np.eye(4)[None])
    ahead = predict(states, TRANSITION, np.zeros((4, 4)))
    np.testing.assert_allclose(ahead.mean, [[1.3, 1.6, 3.0, -4.0]])
    np.testing.assert_allclose(ahead.covariance[0, 0], [1.01, 0, 0.1, 0])


def test_update_by_hand_meets_halfway_between_equals():
    states = Gaussians(np.array([[0.0, 0, 0, 0]]), np.eye(4)[None])
    updated = update(states, np.array([[2.0, -4.0]]), OBSERVATION, np.eye(2))
    np.testing.assert_allclose(updated.mean, [[1.0, -2.0, 0, 0]])
    np.testing.assert_allclose(updated.covariance[0], np.diag([0.5, 0.5, 1, 1]))


def test_a_batch_is_a_loop_of_single_filters(rng):
    states, measured = random_gaussians(7, rng), rng.normal(size=(7, 2))
    plain = one_by_one(states)
    for step in range(20):
        states = update(
            predict(states, TRANSITION, PROCESS_NOISE),
            measured + step,
            OBSERVATION,
            MEASUREMENT_NOISE,
        )
        for state, position in zip(plain, measured, strict=True):
            state.predict(TRANSITION, PROCESS_NOISE)
            state.update(position + step, OBSERVATION, MEASUREMENT_NOISE)
    assert_same(states, plain)


def test_each_filter_may_have_a_noise_of_its_own(rng):
    states, measured = random_gaussians(3, rng), rng.normal(size=(3, 2))
    process_noise = np.arange(1, 4)[:, None, None] * PROCESS_NOISE
    measurement_noise = np.arange(1, 4)[:, None, None] * MEASUREMENT_NOISE
    plain = one_by_one(states)
    states = update(
        predict(states, TRANSITION, process_noise), measured, OBSERVATION, measurement_noise
    )
    for row, state in enumerate(plain):
        state.predict(TRANSITION, process_noise[row])
        state.update(measured[row], OBSERVATION, measurement_noise[row])
    assert_same(states, plain)


def test_distances_are_those_of_single_filters(rng):
    states, measured = random_gaussians(4, rng), rng.normal(size=(6, 2))
    squared = mahalanobis_squared(states, measured, OBSERVATION, MEASUREMENT_NOISE)
    expected = [
        [f.mahalanobis_squared(m, OBSERVATION, MEASUREMENT_NOISE) for m in measured]
        for f in one_by_one(states)
    ]
    np.testing.assert_allclose(squared, expected)


def test_covariances_stay_symmetric_and_positive_over_ten_thousand_steps(rng):
    states = Gaussians(rng.normal(size=(3, 4)), np.tile(1e4 * np.eye(4), (3, 1, 1)))
    for _ in range(10_000):
        states = update(
            predict(states, TRANSITION, PROCESS_NOISE),
            rng.normal(size=(3, 2)),
            OBSERVATION,
            1e-6 * np.eye(2),
        )
    flipped = states.covariance.transpose(0, 2, 1)
    np.testing.assert_allclose(states.covariance, flipped, rtol=1e-9, atol=1e-15)
    assert np.linalg.eigvalsh(states.covariance).min() > 0


def test_errors_and_innovations_are_as_large_as_the_filter_says(rng):
    # The sum of R independent chi-squared values of k degrees is chi-squared of R k degrees.
    runs, steps = 300, 40
    truth = rng.multivariate_normal(np.zeros(4), np.eye(4), runs)
    states = Gaussians(np.zeros((runs, 4)), np.tile(np.eye(4), (runs, 1, 1)))
    squared_errors, squared_innovations = [], []
    for _ in range(steps):
        truth = truth @ TRANSITION.T + rng.normal(0, 2.0, (runs, 2)) @ PUSH.T
        measured = truth[:, :2] + rng.normal(size=(runs, 2)) * (0.3, 0.2)
        states = predict(states, TRANSITION, PROCESS_NOISE)
        across = mahalanobis_squared(states, measured, OBSERVATION, MEASUREMENT_NOISE)
        squared_innovations.append(np.diag(across).sum())
        states = update(states, measured, OBSERVATION, MEASUREMENT_NOISE)
        away = states.mean - truth
        inverse = np.linalg.inv(states.covariance)
        squared_errors.append(np.einsum("ri,rij,rj->", away, inverse, away))
    for squared, degrees in ((squared_errors, 4), (squared_innovations, 2)):
        low, high = chi2.interval(1 - 1e-4, runs * degrees)
        assert low < min(squared)
        assert max(squared) < high


@pytest.mark.parametrize(("tracks", "detections"), [(0, 0), (0, 3), (3, 0)])
def test_no_filters_and_no_measurements(rng, tracks, detections):
    states = predict(random_gaussians(tracks, rng), TRANSITION, PROCESS_NOISE)
    updated = update(states, np.zeros((tracks, 2)), OBSERVATION, MEASUREMENT_NOISE)
    squared = mahalanobis_squared(states, np.zeros((detections, 2)), OBSERVATION, MEASUREMENT_NOISE)
    assert len(updated) == tracks
    assert squared.shape == (tracks, detections)


def test_rows_are_taken_joined_and_replaced(rng):
    states = random_gaussians(4, rng)
    chosen = states[np.array([3, 1])]
    np.testing.assert_array_equal(chosen.mean, states.mean[[3, 1]])
    assert len(states.joined(chosen)) == 6
    replaced = states.replaced(np.array([0, 2]), chosen)
    np.testing.assert_array_equal(replaced.mean, states.mean[[3, 1, 1, 3]])
    np.testing.assert_array_equal(replaced.covariance, states.covariance[[3, 1, 1, 3]])


def test_arguments_are_left_as_they_were(rng):
    states, measured = random_gaussians(2, rng), np.zeros((2, 2))
    before = states.mean.copy(), states.covariance.copy()
    predict(states, TRANSITION, PROCESS_NOISE)
    update(states, measured, OBSERVATION, MEASUREMENT_NOISE)
    states.replaced(np.array([0]), states[np.array([1])])
    np.testing.assert_array_equal(states.mean, before[0])
    np.testing.assert_array_equal(states.covariance, before[1])


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(5)
