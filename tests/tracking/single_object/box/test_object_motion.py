"""Motion models of tracked objects: on curves, straight on, static."""

import numpy as np
import pytest

from perception.tracking.single_object.box.object_motion import KinematicState, motion_model_for

CAR, CYCLIST, WALKER = (
    motion_model_for(np.array(size))
    for size in ((4.4, 1.8, 1.5), (1.8, 0.7, 1.75), (0.8, 0.6, 1.75))
)
EXACT = np.full(3, 0.01)


def _state(*mean: float) -> KinematicState:
    return KinematicState(np.array(mean), np.eye(5) * 0.01)


def test_a_car_turns_about_the_centre_of_its_curve() -> None:
    speed, turn = 6.0, 0.3
    state = CAR.predict(_state(0, 0, 0, speed, turn), 0.1)
    arm_m = 0.3 * 4.4  # the middle lies before the rear axle, which goes along the heading
    radius_m, angle = speed / turn, turn * 0.1
    axle = radius_m * np.array([np.sin(angle), 1 - np.cos(angle)])
    middle = axle + arm_m * np.array([np.cos(angle), np.sin(angle)]) - (arm_m, 0)
    np.testing.assert_allclose(state.mean[:2], middle, atol=2e-3)
    assert state.mean[2] == pytest.approx(angle)


@pytest.mark.parametrize("motion", [CAR, CYCLIST, WALKER], ids=["car", "cyclist", "walker"])
def test_one_long_step_is_as_sure_as_many_short_ones(motion: object) -> None:
    start = CAR.init(np.zeros(3), EXACT) if motion is CAR else WALKER.init(np.zeros(3), EXACT)
    assert hasattr(motion, "predict")
    once = motion.predict(start, 1.2)
    often = start
    for _ in range(12):
        often = motion.predict(often, 0.1)
    np.testing.assert_allclose(once.mean, often.mean, atol=1e-9)
    np.testing.assert_allclose(np.diag(once.covariance), np.diag(often.covariance), rtol=0.3)


def test_positions_determine_the_speed() -> None:
    state = CAR.init(np.zeros(3), EXACT)
    for number in range(1, 6):
        state = CAR.predict(state, 0.1)
        state = state.with_pose(np.array([0.8 * number, 0.0, 0.0]), np.diag(EXACT**2))
    np.testing.assert_allclose(CAR.velocity_m_s(state), [8.0, 0.0], atol=0.2)
    assert not CAR.may_be_static(state)


def test_an_observation_of_the_predicted_pose_leaves_the_state() -> None:
    state = CAR.predict(_state(1, 2, 0.5, 4, 0.1), 0.1)
    same = state.with_pose(state.mean[:3], state.covariance[:3, :3])
    np.testing.assert_allclose(same.mean, state.mean)
    np.testing.assert_allclose(same.covariance, state.covariance, atol=1e-12)


def test_cars_may_go_backwards_and_cyclists_may_not() -> None:
    backwards = _state(0, 0, 0.2, -2.0, 0.0)
    assert CAR.correct_heading(backwards).mean[2] == 0.2
    turned = CYCLIST.correct_heading(backwards)
    assert turned.mean[2] == pytest.approx(0.2 + np.pi)
    np.testing.assert_allclose(CYCLIST.velocity_m_s(turned), CYCLIST.velocity_m_s(backwards))


def test_a_static_car_does_not_turn() -> None:
    certain = np.diag([0.01, 0.01, 0.01, 1e-6, 1e-6]) ** 2
    stands = CAR.predict(KinematicState(np.zeros(5), certain), 1.0)
    rolls = CAR.predict(KinematicState(np.array([0, 0, 0, 5.0, 0]), certain), 1.0)
    assert stands.covariance[2, 2] < 0.5 * rolls.covariance[2, 2]


def test_a_walker_faces_its_course_even_after_turning_round() -> None:
    state = KinematicState(np.array([0, 0, 0.0, -1.4, 0.0]), np.eye(5) * 0.001)
    assert abs(WALKER.correct_heading(state).mean[2]) == pytest.approx(np.pi)
    stands = KinematicState(np.array([0, 0, 0.7, 0.1, 0.0]), np.eye(5) * 0.01)
    assert WALKER.correct_heading(stands).mean[2] == 0.7
    assert WALKER.may_be_static(stands)
