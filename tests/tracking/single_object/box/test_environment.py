"""Background around a tracked object, and the ground below it."""

import numpy as np

from perception.tracking.single_object.box.environment import BackgroundModel, LocalGround
from perception.tracking.single_object.box.observation import observation_of
from perception.tracking.single_object.tracker import TrackerInput
from perception.types import Float, Float64

POLE, WALKER = np.array([[5.0, 2.0]]), np.array([[4.0, 1.0]])
BOTH = np.concatenate([POLE, WALKER])


def test_a_point_beside_the_object_is_background_at_once() -> None:
    around = BackgroundModel().updated(POLE, is_hidden=False)
    np.testing.assert_array_equal(around.contains(BOTH), [True, False])


def test_it_is_forgotten_after_a_few_scans() -> None:
    around = BackgroundModel().updated(POLE, is_hidden=False)
    for _ in range(4):
        around = around.updated(np.zeros((0, 2)), is_hidden=False)
    assert not around.contains(POLE).any()


def test_while_the_object_is_hidden_only_static_points_are_background() -> None:
    around = BackgroundModel()
    for number in range(8):
        walker = WALKER + np.array([0.14 * number, 0.0])
        around = around.updated(np.concatenate([POLE, walker]), is_hidden=True)
    np.testing.assert_array_equal(around.contains(np.concatenate([POLE, walker])), [True, False])


def test_without_scans_or_points_there_is_no_background() -> None:
    assert not BackgroundModel().contains(BOTH).any()
    assert len(BackgroundModel().updated(POLE, is_hidden=False).contains(np.zeros((0, 2)))) == 0


def test_an_observation_averages_points_over_cells() -> None:
    points = np.array([[1.01, 1.01, 0.2], [1.03, 1.05, 0.9], [2.51, 1.0, 0.5]])
    observation = observation_of(points, np.zeros(2), 0.1)
    np.testing.assert_allclose(observation.points_xy_m, [[1.02, 1.03], [2.51, 1.0]])
    np.testing.assert_allclose(observation.tops_m, [0.9, 0.5])
    np.testing.assert_allclose(observation.weights, [np.sqrt(0.5), 0.5])
    assert len(observation.near(np.array([2.5, 1.0]), 0.5, 10)) == 1
    assert len(observation_of(np.zeros((0, 3)), np.zeros(2), 0.1)) == 0


def test_points_around_are_those_in_the_square() -> None:
    points = np.array([[1, 1, 0, 0], [4, 1, 0, 0], [1, 4, 0, 0]], np.float32)
    world = np.eye(4)
    world[:3, 3] = 100.0, 0.0, 0.0
    tracker_input = TrackerInput(0.0, points, world)
    around = tracker_input.points_near(np.array([101.0, 1.0, 0.0]), 2.0)
    np.testing.assert_allclose(tracker_input.in_world(around), [[101.0, 1.0, 0.0]])


class _Stage:
    def __init__(self, height_m: float) -> None:
        self._height_m = height_m

    def height_m(self, xy_m: Float) -> Float64:
        return np.full(len(xy_m), self._height_m)

    def distance_m(self, points_velo: Float) -> Float:
        return np.asarray(points_velo[:, 2] - self._height_m)


def _ground_after(stage: _Stage | None, *, road_m: float = -1.6) -> float:
    xy = np.stack(np.meshgrid(np.arange(6, 14, 0.3), np.arange(-4, 4, 0.3)), -1).reshape(-1, 2)
    road = np.column_stack([xy, np.full(len(xy), road_m)])
    position = np.array([10.0, 0.0, -1.7])
    tracker_input = TrackerInput(0.0, np.zeros((0, 4), np.float32), np.eye(4), stage)
    ground = LocalGround.below_box(-1.7)
    for _ in range(30):
        ground = ground.moved(0.5).updated(tracker_input, position, 4.0, road)
    return ground.z_world_m


def test_the_ground_comes_from_the_stage() -> None:
    assert abs(_ground_after(_Stage(-1.65)) + 1.65) < 0.01


def test_the_road_around_the_object_stands_in_where_the_stage_leaves_it() -> None:
    for stage in (None, _Stage(3.0), _Stage(np.nan)):
        assert abs(_ground_after(stage) + 1.63) < 0.02


def test_one_height_that_is_far_off_counts_little() -> None:
    ground = LocalGround(0.0, 0.05**2)
    assert abs(ground.measured(1.0, 0.05).z_world_m) < 0.05
    assert ground.measured(0.02, 0.05).z_world_m == 0.01
