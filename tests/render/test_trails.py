"""What is remembered from frame to frame: paths, headings, colours and the speed of the vehicle."""

from dataclasses import replace

import numpy as np
import pytest

from perception.geometry import se3
from perception.render.palette import TRACKS
from perception.render.scene import SceneObjects
from perception.render.trails import SceneHistory
from perception.types import Boxes3D, Tracks


@pytest.fixture
def moment(scene):
    """Make a result at a time, of a vehicle that has driven and turned, with tracks of one velocity."""

    def make(
        stamp_s,
        bottoms_velo,
        *,
        x_m=0.0,
        yaw_rad=0.0,
        first_id=1,
        velocity=(10.0, 0.0),
        box_yaw_rad=0.0,
    ):
        frame = replace(scene.frame, stamp_s=stamp_s)
        pose = se3.from_euler(0, 0, yaw_rad, np.array([x_m, 0, 0]))
        count = len(bottoms_velo)
        boxes = Boxes3D(
            np.array(bottoms_velo, float).reshape(-1, 3),
            np.tile([4.0, 2.0, 1.5], (count, 1)),
            np.full(count, box_yaw_rad),
        )
        velocities = np.tile(np.array(velocity, float), (count, 1))
        tracks = Tracks.unclassified(
            np.arange(first_id, first_id + count), boxes, velocities, np.ones(count, bool)
        )
        return replace(scene, frame=frame, world_SE3_velo=pose, tracks=tracks)

    return make


def seen(history, result):
    return history.update(result, SceneObjects.of(result))


def test_a_path_stays_on_the_road_while_the_vehicle_drives(moment):
    # An object 10 m ahead drives on by 1 m a frame, while the vehicle drives 2 m a frame.
    history = SceneHistory()
    for step in range(4):
        scene = seen(history, moment(0.1 * step, [(10 - step, 0, -1.7)], x_m=2.0 * step))
    (path,) = scene.paths_velo
    # In the world it was at x = 10, 11, 12, 13; the vehicle is at 6 now. The last position is the box itself.
    np.testing.assert_allclose(path[:, 0], [4, 5, 6, 7, 7])
    np.testing.assert_allclose(path[:, 1:], [(0, -1.7)] * 5, atol=1e-12)


def test_a_path_turns_with_the_vehicle(moment):
    history = SceneHistory()
    seen(history, moment(0.0, [(10, 0, 0)]))
    # The vehicle has turned left by 90 degrees: what lay ahead lies to the right.
    turned = moment(0.1, [(0, -12, 0)], yaw_rad=np.pi / 2, velocity=(0.0, -20.0))
    np.testing.assert_allclose(
        seen(history, turned).paths_velo[0], [(0, -10, 0), (0, -12, 0), (0, -12, 0)], atol=1e-12
    )


def test_only_the_last_seconds_are_kept(moment):
    history = SceneHistory(duration_s=1.0)
    for step in range(50):
        scene = seen(history, moment(0.1 * step, [(float(step), 0, 0)]))
    (path,) = scene.paths_velo
    assert 10 <= len(path) <= 12
    assert path[0, 0] == pytest.approx(39, abs=1)


def test_a_standing_object_has_no_path_however_its_box_wanders(moment):
    history = SceneHistory()
    for step in range(30):
        scene = seen(history, moment(0.1 * step, [(10 + 0.1 * step, 0, 0)], velocity=(0.3, 0)))
    np.testing.assert_allclose(scene.paths_velo[0], [(12.9, 0, 0)] * 2)
    assert not scene.objects.is_moving[0]


def test_an_object_moves_once_it_has_travelled(moment):
    history = SceneHistory()
    moves = [
        bool(seen(history, moment(0.1 * step, [(10.0 + step, 0, 0)])).objects.is_moving[0])
        for step in range(4)
    ]
    assert moves == [False, False, True, True]


def test_an_object_that_is_missed_for_a_moment_is_remembered(moment):
    history = SceneHistory(duration_s=1.0)
    seen(history, moment(0.0, [(10, 0, 0)]))
    seen(history, moment(0.1, []))
    assert len(seen(history, moment(0.2, [(12, 0, 0)])).paths_velo[0]) == 3
    # After the duration of a path it is not.
    assert len(seen(history, moment(3.0, [(14, 0, 0)])).paths_velo[0]) == 2


@pytest.mark.parametrize(
    "reset",
    [{"stamp_s": 0.0, "x_m": 0.0}, {"stamp_s": 5.1, "x_m": 500.0}],
    ids=["time runs backwards", "the pose jumps"],
)
def test_all_is_forgotten_where_ids_or_poses_are_reset(moment, reset):
    history = SceneHistory()
    seen(history, moment(5.0, [(10, 0, 0)]))
    scene = seen(history, moment(bottoms_velo=[(20, 0, 0)], **reset))
    np.testing.assert_allclose(scene.paths_velo[0], [(20, 0, 0), (20, 0, 0)])
    assert np.isnan(scene.ego_speed_m_s)


def test_each_object_has_its_own_path(moment):
    history = SceneHistory()
    seen(history, moment(0.0, [(5, 1, 0), (8, -1, 0)]))
    scene = seen(history, moment(0.1, [(9, -1, 0)], first_id=2))
    np.testing.assert_allclose(scene.paths_velo[0][:, 0], [8, 9, 9])


def headings_rad(history, steps):
    """Return the headings that are drawn, NaN where no front is marked."""
    scenes = [seen(history, step) for step in steps]
    return [
        scene.objects.boxes.yaw_rad[0] if scene.objects.has_front[0] else np.nan for scene in scenes
    ]


def test_a_heading_follows_the_motion_and_is_held_while_the_object_stands(moment):
    # Which end of the box is its front changes at every scan, and at some scans a side is.
    yaws = [0.1, 0.1 + np.pi, 0.1, 0.1 - np.pi, 0.1 + np.pi / 2, 0.1 + np.pi, 0.1 - np.pi / 2]
    moving = [moment(0.1 * i, [(10 + i, 0, 0)], box_yaw_rad=yaw) for i, yaw in enumerate(yaws)]
    standing = [
        moment(0.7 + 0.1 * i, [(16, 0, 0)], box_yaw_rad=yaw, velocity=(0.2, 0.1))
        for i, yaw in enumerate(yaws)
    ]
    drawn = np.array(headings_rad(SceneHistory(), moving + standing))
    assert np.isnan(drawn[:2]).all()
    np.testing.assert_allclose(np.exp(1j * drawn[2:]), np.exp(0.1j), atol=1e-9)


def test_a_box_keeps_its_outline_when_another_side_becomes_its_front(moment):
    history = SceneHistory()
    seen(history, moment(0.0, [(10, 0, 0)]))
    boxes = seen(history, moment(0.2, [(12, 0, 0)], box_yaw_rad=np.pi / 2)).objects.boxes
    np.testing.assert_allclose(boxes.size_m[0], [2, 4, 1.5])
    np.testing.assert_allclose(boxes.yaw_rad[0], 0, atol=1e-12)


def test_a_heading_never_turns_round_from_one_frame_to_the_next(moment):
    # The object drives on, then back: its front is unknown until it has gone two metres back.
    x_m = [10, 11, 12, 13, 14, 11, 10, 9, 8, 7]
    steps = [
        moment(0.1 * i, [(x, 0, 0)], velocity=(10.0 if i < 5 else -10.0, 0))
        for i, x in enumerate(x_m)
    ]
    drawn = headings_rad(SceneHistory(), steps)
    np.testing.assert_allclose(np.cos(drawn), [np.nan] * 2 + [1] * 3 + [np.nan] * 2 + [-1] * 3)


def test_an_arrow_against_the_path_is_not_drawn(moment):
    history = SceneHistory()
    for step in range(4):
        scene = seen(history, moment(0.1 * step, [(10.0 + step, 0, 0)], velocity=(-9.0, 0)))
    assert not scene.objects.is_moving[0]


def test_objects_have_different_colours_as_long_as_there_are_some(moment):
    history = SceneHistory()
    scene = seen(history, moment(0.0, [(10, y, 0) for y in range(len(TRACKS))], first_id=3))
    assert sorted(scene.objects.colors.tolist()) == list(range(len(TRACKS)))
    later = seen(history, moment(0.1, [(10, 1, 0)], first_id=4))
    assert later.objects.colors.tolist() == [scene.objects.colors[1]]


def test_an_object_without_a_3d_box_keeps_its_colour(moment):
    history = SceneHistory()
    nowhere = (np.nan, np.nan, np.nan)
    for step, others in enumerate(([1.0, 2.0, 3.0], [], [4.0])):
        bottoms = [*((9, y, 0) for y in others), nowhere]
        result = moment(0.1 * step, bottoms, first_id=8 - len(others))
        scene = seen(history, result)
        assert scene.objects.colors[-1] == 3
        assert not scene.objects.is_moving[-1]


def test_the_speed_of_the_vehicle_is_measured_over_some_frames(moment):
    history = SceneHistory()
    assert np.isnan(seen(history, moment(0.0, [])).ego_speed_m_s)
    for step in range(1, 9):
        scene = seen(history, moment(0.1 * step, [], x_m=0.7 * step))
    assert scene.ego_speed_m_s == pytest.approx(7.0)


def test_frames_of_no_sequence_have_no_history(moment):
    history = SceneHistory(duration_s=0.0)
    for step in range(4):
        scene = seen(history, moment(0.1 * step, [(10.0 + step, 0, 0)], x_m=float(step)))
    assert not scene.objects.is_moving[0]
    assert np.isnan(scene.ego_speed_m_s)
