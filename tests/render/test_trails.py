from dataclasses import replace

import numpy as np
import pytest

from perception.geometry import se3
from perception.render.trails import Trails
from perception.types import Boxes3D, Tracks


def tracks_at(bottoms, first_id=1):
    count = len(bottoms)
    boxes = Boxes3D(np.array(bottoms, float).reshape(-1, 3), np.ones((count, 3)), np.zeros(count))
    return Tracks.unclassified(
        np.arange(first_id, first_id + count), boxes, np.zeros((count, 2)), np.ones(count, bool)
    )


@pytest.fixture
def moment(scene):
    """Make a result at a time, of a vehicle that has driven so far and turned so much."""

    def make(stamp_s, bottoms_velo, x_m=0.0, yaw_rad=0.0, **others):
        frame = replace(scene.frame, stamp_s=stamp_s)
        pose = se3.from_euler(0, 0, yaw_rad, np.array([x_m, 0, 0]))
        tracks = tracks_at(bottoms_velo, **others)
        return replace(scene, frame=frame, world_SE3_velo=pose, tracks=tracks)

    return make


def test_a_trail_stays_on_the_road_while_the_vehicle_drives(moment):
    # A thing that stands 10 m ahead, then drives on by 1 m a frame, while the vehicle drives 2 m a frame.
    trails = Trails()
    for step in range(4):
        now = moment(0.1 * step, [(10 - step, 0, -1.7)], x_m=2.0 * step)
        trails.add(now)
    (path,) = trails.paths_velo(now)
    # In the world it was at x = 10, 11, 12, 13; the vehicle is at 6 now. The last place is the box itself.
    np.testing.assert_allclose(path[:, 0], [4, 5, 6, 7, 7])
    np.testing.assert_allclose(path[:, 1:], [(0, -1.7)] * 5, atol=1e-12)


def test_a_trail_turns_with_the_vehicle(moment):
    trails = Trails()
    trails.add(moment(0.0, [(10, 0, 0)]))
    # The vehicle has turned left by 90 degrees: what lay ahead lies to the right.
    turned = moment(0.1, [(0, -12, 0)], yaw_rad=np.pi / 2)
    trails.add(turned)
    np.testing.assert_allclose(
        trails.paths_velo(turned)[0], [(0, -10, 0), (0, -12, 0), (0, -12, 0)], atol=1e-12
    )


def test_only_the_last_seconds_are_kept(moment):
    trails = Trails(duration_s=1.0)
    for step in range(50):
        now = moment(0.1 * step, [(float(step), 0, 0)])
        trails.add(now)
    (path,) = trails.paths_velo(now)
    assert 10 <= len(path) <= 12
    assert path[0, 0] == pytest.approx(39, abs=1)


def test_what_does_not_move_has_one_place(moment):
    trails = Trails()
    for step in range(30):
        now = moment(0.1 * step, [(10, 0.01 * (step % 2), 0)])
        trails.add(now)
    assert len(trails.paths_velo(now)[0]) == 2


def test_a_track_that_ended_is_forgotten(moment):
    trails = Trails()
    trails.add(moment(0.0, [(10, 0, 0)]))
    trails.add(moment(0.1, []))
    back = moment(0.2, [(20, 0, 0)])
    trails.add(back)
    np.testing.assert_allclose(trails.paths_velo(back)[0], [(20, 0, 0), (20, 0, 0)])


@pytest.mark.parametrize(
    "anew",
    [{"stamp_s": 0.0, "x_m": 0.0}, {"stamp_s": 5.1, "x_m": 500.0}],
    ids=["time runs backwards", "the pose leaps"],
)
def test_all_is_forgotten_when_ids_or_poses_begin_anew(moment, anew):
    trails = Trails()
    trails.add(moment(5.0, [(10, 0, 0)]))
    now = moment(bottoms_velo=[(20, 0, 0)], **anew)
    trails.add(now)
    np.testing.assert_allclose(trails.paths_velo(now)[0], [(20, 0, 0), (20, 0, 0)])


def test_a_repeated_frame_adds_nothing(moment):
    trails = Trails()
    now = moment(1.0, [(10, 0, 0)])
    trails.add(now)
    trails.add(now)
    assert len(trails.paths_velo(now)[0]) == 2


def test_each_track_has_its_own_trail(moment):
    trails = Trails()
    trails.add(moment(0.0, [(5, 1, 0), (8, -1, 0)]))
    now = moment(0.1, [(9, -1, 0)], first_id=2)
    trails.add(now)
    np.testing.assert_allclose(trails.paths_velo(now)[0][:, 0], [8, 9, 9])


def test_a_result_that_was_never_added_has_paths_of_one_place(moment):
    now = moment(0.0, [(5, 1, 0)])
    np.testing.assert_allclose(Trails().paths_velo(now)[0], [(5, 1, 0)])
