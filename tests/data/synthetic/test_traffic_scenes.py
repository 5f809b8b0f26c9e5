"""The scripted scenes hold the traffic that their names say."""

import numpy as np
import pytest

from data.synthetic.traffic_scenes import TRAFFIC_SCENES, TrafficSceneDrive
from perception.sensor import VLP_16

FRAMES = 40


@pytest.fixture(scope="module", params=TRAFFIC_SCENES)
def scene(request) -> TrafficSceneDrive:
    return TrafficSceneDrive(request.param, FRAMES, sensor=VLP_16, images=False)


def places_m(scene: TrafficSceneDrive) -> np.ndarray:
    """Return (actors, frames, 2) positions along and left of the road."""
    times_s = np.arange(FRAMES) / VLP_16.rate_hz
    return np.array([np.stack(one.path.at(times_s), axis=-1) for one in scene.world.actors])


def test_vehicles_move_as_the_scene_is_named(scene):
    moved_m = np.diff(places_m(scene)[:, [0, -1]], axis=1)[:, 0]
    ego_m_s = float(scene.world.ego.speed_m_s(np.array([1.0]))[0])
    if scene.name == "highway":
        assert ego_m_s == pytest.approx(20)
        assert np.abs(moved_m[:, 0]).min() > 60
        assert {*np.sign(moved_m[:, 0])} == {-1.0, 1.0}
    elif scene.name == "junction":
        # One comes from another lane, and two join the road.
        assert moved_m[0].tolist() == pytest.approx([-7 * 3.9, 0])
        assert np.abs(moved_m[1:, 1]).min() > 5
        ends_m = [one.path.at(9.0)[1] for one in scene.world.actors]
        assert ends_m == pytest.approx([2, -2, 2])
    else:
        assert ego_m_s == 0
        assert np.abs(moved_m[:, 0]).max() == 0
        assert np.abs(moved_m[:, 1]).min() > 10


def test_vehicles_keep_apart_and_face_their_course(scene):
    places = places_m(scene)
    for one in range(len(places)):
        for other in range(one):
            assert np.hypot(*(places[one] - places[other]).T).min() > 2.5
    for actor in scene.world.actors:
        pose, velocity = (
            actor.pose(scene.world.road, 2.0),
            actor.velocity_m_s(scene.world.road, 2.0),
        )
        course = velocity[:2] / np.linalg.norm(velocity[:2])
        assert pose[:2, 0] @ course == pytest.approx(1, abs=0.01)


def test_objects_are_labelled_with_their_motion(scene):
    moving = np.concatenate(
        [truth.instances[truth.is_moving] for truth in map(scene.point_truth, (10, 30))]
    )
    assert len({*moving.tolist()}) >= 2
