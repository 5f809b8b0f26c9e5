"""Scenes small enough to draw: a plane, a wall, boxes, seen by rays from a simulated sensor."""

from dataclasses import dataclass
from itertools import compress

import numpy as np
import pytest

from perception.errors import UsageError
from perception.geometry.grids import LocalArea
from perception.geometry.se3 import from_euler
from perception.localization.scan_window import PosedScan, ScanWindow
from perception.obstacles.config import MotionConfig, MotionCountersConfig
from perception.obstacles.free_space import FreeSpaceMemory
from perception.obstacles.motion_counters import CounterSegmenter
from perception.obstacles.motion_segmentation import (
    FreeSpaceSegmenter,
    motion_segmenter,
    static_threshold,
)
from perception.obstacles.rigid_bodies import OccupiedPlaces, moving_bodies
from perception.sensor import HDL_32E, HDL_64E, VLP_16, LidarModel
from perception.types import PointState
from tests.rays import unit_rays

AREA = LocalArea()
WALL = (
    28.0,
    -20.0,
    0.0,
    1.0,
    40.0,
    6.0,
)  # least x, y, z and size: what beams end at behind all else


@dataclass(frozen=True)
class Road:
    """A level road under a sensor."""

    height_m: float

    def distance_m(self, points_velo):
        return points_velo[:, 2] + self.height_m


def box(x, y, length=0.4, width=0.5, height=1.7):
    return (x, y, 0.0, length, width, height)


def cast(sensor: LidarModel, origin_xy, boxes):
    """Return the points of a scan and the number of the box each lies on, -1 for the road.

    Boxes and origin are in the world, whose road is z = 0; the points are in the sensor's frame.
    """
    ray = unit_rays(np.arange(-0.8, 0.8, sensor.azimuth_step_rad), sensor.elevations_rad)
    ray[ray == 0] = 1e-9
    origin = np.array([*origin_xy, sensor.height_m])
    reach = np.where(ray[:, 2] < 0, -origin[2] / ray[:, 2], np.inf)
    owner = np.full(len(ray), -1)
    for number, values in enumerate(boxes):
        low, size = np.array(values[:3]), np.array(values[3:])
        first, second = (low - origin) / ray, (low + size - origin) / ray
        enters = np.minimum(first, second).max(axis=1)
        leaves = np.maximum(first, second).min(axis=1)
        meets = (enters <= leaves) & (enters > 0) & (enters < reach)
        reach[meets], owner[meets] = enters[meets], number
    seen = reach < 60.0
    points = np.zeros((int(seen.sum()), 4), np.float32)
    points[:, :3] = ray[seen] * reach[seen, None]
    return points, owner[seen]


def drive(
    boxes_at, frames, *, sensor=HDL_64E, ego_x=lambda k: 0.0, segmenter=None, pose_noise_m=0.0
):
    """Segment a scene frame by frame; yield (owner of each point, states, obstacles)."""
    segmenter = segmenter or FreeSpaceSegmenter(sensor, AREA)
    rng = np.random.default_rng(5)
    window = ScanWindow(6)
    for k in range(frames):
        points, owner = cast(sensor, (ego_x(k), 0.0), [WALL, *boxes_at(k)])
        place = np.array([ego_x(k), 0.0, 0.0]) + rng.normal(0, pose_noise_m, 3) * (1, 1, 0)
        window.push(PosedScan(points, from_euler(0, 0, 0, place), stamp_s=k / sensor.rate_hz))
        obstacles = segmenter.update(window, Road(sensor.height_m))
        yield owner, obstacles.point_states, obstacles


def moving_share(owner, states, number):
    """Return which share of a box's obstacle points is called moving; box 0 is the first after the wall."""
    of_box = (owner == number + 1) & np.isin(states, (PointState.STATIC, PointState.MOVING))
    return float(np.mean(states[of_box] == PointState.MOVING))


def last(frames):
    *_, final = frames
    return final


@pytest.mark.parametrize("sensor", [HDL_64E, VLP_16], ids=lambda sensor: sensor.name)
@pytest.mark.parametrize(
    "velocity", [(0.0, 1.2), (0.0, 0.6), (-1.2, 0.0), (1.2, 0.0)],
    ids=["across", "slowly across", "towards", "away"],
)  # fmt: skip
def test_a_walker_moves_and_a_standing_person_does_not(sensor, velocity):
    def scene(k):
        t = 0.1 * k
        return [box(9.0 + velocity[0] * t, -1.0 + velocity[1] * t), box(9.0, 5.0)]

    owner, states, _ = last(drive(scene, 20, sensor=sensor))
    assert moving_share(owner, states, 0) > 0.8
    assert moving_share(owner, states, 1) == 0


@pytest.mark.parametrize("speed_mps", [-8.0, 4.0, 9.0], ids=["oncoming", "slower", "as fast"])
def test_a_car_moves_from_a_moving_vehicle(speed_mps):
    def scene(k):
        start = 22.0 if speed_mps < 0 else 9.0
        return [
            box(start + speed_mps * 0.1 * k, 1.0, 4.2, 1.8, 1.5),
            box(14.0, -7.0, 4.2, 1.8, 1.5),
        ]

    owner, states, _ = last(drive(scene, 14, ego_x=lambda k: 0.5 * k))
    assert moving_share(owner, states, 0) > 0.8
    assert moving_share(owner, states, 1) == 0


@pytest.mark.parametrize("speed_m_s", [0.6, 1.5, 3.0, -1.5])
def test_the_smooth_side_of_a_long_vehicle_moves_with_its_ends(speed_m_s):
    def scene(k):
        start = 12.0 if speed_m_s < 0 else 6.0
        return [box(start + speed_m_s * 0.1 * k, 4.0, 9.0, 2.5, 3.0), box(8.0, -5.0, 9.0, 2.5, 3.0)]

    owner, states, _ = last(drive(scene, 20))
    assert moving_share(owner, states, 0) > 0.95
    assert moving_share(owner, states, 1) == 0


def moves_as_a_body(scene, area=AREA):
    """Return whether what has a box after the first moves as one body in the last of 16 scans."""
    memory = FreeSpaceMemory(HDL_64E, horizon_s=1.5)
    for k in range(16):
        points, owner = cast(HDL_64E, (0.0, 0.0), scene(k))
        memory.push(points, np.eye(4), 0.1 * k)
    places = points[(owner == 1) & area.contains_xy(points), :3]
    every, none = np.ones(len(places), bool), np.zeros(len(places), bool)
    occupied = OccupiedPlaces(places, every.astype(np.int64), every, none, none, area)
    return bool(moving_bodies(occupied, memory).any())


@pytest.mark.parametrize("hidden_scans", [0, 4, 14])
def test_a_body_hidden_from_the_oldest_scan_moves_by_a_younger_one(hidden_scans):
    def scene(k):
        screen = [box(0.0, 3.0, 20.0, 0.1, 2.5)] if k < hidden_scans else []
        return [WALL, box(4.0 + 0.15 * k, 5.0, 9.0, 2.5, 3.0), *screen]

    assert moves_as_a_body(scene) == (hidden_scans < 10)


def test_a_body_of_one_visible_side_moves():
    assert moves_as_a_body(lambda k: [WALL, box(4.0 + 0.1 * k, 5.0, 6.0, 0.05, 1.6)])


def test_a_body_that_rests_behind_one_that_passes_does_not_move():
    def scene(k):
        return [WALL, box(8.0, 5.0, 4.2, 1.8, 1.5), box(-2.0 + 0.6 * k, 2.0, 6.0, 2.5, 3.0)]

    assert not moves_as_a_body(scene)


def test_a_wide_trailer_moves_with_the_narrow_end_that_appeared():
    def scene(k):
        x = 4.0 + 0.2 * k
        return [box(x, 4.0, 9.0, 2.5, 1.5), box(x + 8.95, 4.9, 1.2, 0.6, 2.4)]

    owner, states, _ = last(drive(scene, 20))
    assert moving_share(owner, states, 0) > 0.95


def test_a_long_vehicle_that_slows_down_moves_as_a_whole():
    def scene(k):
        t = 0.1 * k
        return [box(4.0 + 2.2 * t - 0.45 * t**2, 4.0, 9.0, 2.5, 3.0)]

    *_, (owner, states, _) = drive(scene, 21)  # 0.4 m/s at the end
    assert moving_share(owner, states, 0) > 0.95


@pytest.mark.parametrize("length_m", [4.2, 9.0])
def test_a_vehicle_that_has_stopped_is_static_within_a_second(length_m):
    def scene(k):
        return [box(6.0 + 0.2 * min(k, 20), 4.0, length_m, 2.5, 3.0)]

    frames = list(drive(scene, 30))
    assert moving_share(*frames[20][:2], 0) > 0.95
    assert moving_share(*frames[29][:2], 0) < 0.02


def test_a_long_vehicle_moves_while_its_front_leaves_the_area():
    def scene(k):
        return [box(33.0 - 13.0 + 0.2 * k, 4.0, 9.0, 2.5, 3.0)]

    frames = [frame[:2] for frame in drive(scene, 50)][8:]
    obstacles = (PointState.STATIC, PointState.MOVING)
    # In the last frames the rear has left it, too.
    is_inside = [np.isin(states[owner == 1], obstacles).any() for owner, states in frames]
    shares = [moving_share(*frame, 0) for frame in compress(frames, is_inside)]
    assert len(shares) > 15
    assert min(shares) > 0.85
    assert min(shares[12:]) > 0.9


def test_the_stretch_of_a_rail_that_is_visible_between_lorries_is_static():
    def scene(k):
        x = 0.25 * k
        lorries = [box(x + start, 4.0, 8.0, 2.5, 3.0) for start in (-26.0, -12.0, 2.0, 16.0)]
        return [*lorries, box(-20.0, 8.5, 60.0, 0.3, 1.0)]

    for owner, states, _ in drive(scene, 30):
        if (owner == 5).sum() > 20:
            assert moving_share(owner, states, 4) < 0.02


def test_a_parked_car_that_comes_to_light_in_a_row_is_static():
    def scene(k):
        row = [box(x, 4.0, 4.2, 1.8, 1.5) for x in (2.0, 8.0, 14.0, 20.0)]
        return [box(-2.0 + 0.6 * k, 1.2, 4.2, 1.8, 1.7), *row]

    for owner, states, _ in drive(scene, 24):
        for number in (1, 2, 3, 4):
            if (owner == number + 1).sum() > 20:
                # What comes to light may appear for a scan, but no car of the row moves as a whole.
                assert moving_share(owner, states, number) < 0.4


def test_a_walker_along_a_wall_does_not_move_the_wall():
    def scene(k):
        return [box(7.0, 4.0, 10.0, 0.4, 1.7), box(8.0 + 0.12 * k, 3.4)]

    owner, states, _ = last(drive(scene, 20))
    assert moving_share(owner, states, 1) > 0.8
    assert moving_share(owner, states, 0) < 0.05  # what he touches


def test_a_parked_car_beside_a_lorry_that_touches_it_stays_static():
    def scene(k):
        return [box(5.0 + 0.15 * k, 4.0, 9.0, 2.5, 3.0), box(8.0, 2.1, 4.2, 1.8, 1.4)]

    owner, states, _ = last(drive(scene, 20))
    assert moving_share(owner, states, 1) < 0.1


def test_a_stopped_object_is_static_within_a_second():
    def scene(k):
        return [box(8.0, min(-3.0 + 0.12 * k, -1.0))]  # stops in frame 17

    frames = list(drive(scene, 27))
    assert moving_share(*frames[16][:2], 0) > 0.8
    assert moving_share(*frames[26][:2], 0) == 0


def test_what_comes_to_light_behind_a_passer_by_is_static():
    def scene(k):
        return [box(7.0, -4.0 + 0.5 * k, 0.8, 4.0, 1.5), box(12.0, 0.0)]

    for owner, states, _ in drive(scene, 22):
        if (owner == 2).sum() > 20:
            assert moving_share(owner, states, 1) == 0


@pytest.mark.parametrize("seed", range(3))
def test_a_parked_car_that_a_passing_one_uncovers_stays_static_from_the_second_scan_on(seed):
    """Few beams, and a history of 0.1 s: only that the passing car is another body tells what it uncovers."""
    rng = np.random.default_rng(seed)

    def scene(k):
        noise_m = rng.normal(0, 0.002)
        passing = box(3.0 + 0.8 * k, 2.2 + noise_m, 4.2, 1.7, 1.5)
        return [passing, box(4.0, 4.7 + noise_m, 4.2, 1.7, 1.5)]

    for k, (owner, states, _) in enumerate(drive(scene, 6, sensor=VLP_16)):
        assert not (states[owner == 2] == PointState.MOVING).any()
        assert k < 3 or moving_share(owner, states, 0) > 0.8


def test_thin_posts_stay_static_under_pose_errors_of_5_cm():
    def scene(k):
        del k
        return [box(x, y, 0.08, 0.08, 1.5) for x in (6.0, 10.0, 15.0) for y in (-4.0, 4.0)]

    for owner, states, _ in drive(scene, 20, ego_x=lambda k: 0.4 * k, pose_noise_m=0.05):
        assert not (states[owner > 0] == PointState.MOVING).any()


def test_free_space_removes_the_shadow_of_a_walker():
    def scene(k):
        return [box(9.0, -3.0 + 0.15 * max(k - 5, 0))]

    def mapped_where_he_stood(obstacles):
        x, y = obstacles.static.centers_m[:, :2].T
        return int(((np.abs(x - 9.0) < 0.6) & (y > -3.2) & (y < -2.4)).sum())

    frames = [obstacles for _, _, obstacles in drive(scene, 16)]
    assert mapped_where_he_stood(frames[5]) > 20
    assert mapped_where_he_stood(frames[15]) == 0


def test_the_static_map_keeps_what_is_hidden_for_a_moment():
    def scene(k):
        passer_by = [box(6.0, -2.0, 0.8, 4.0, 1.9)] if k in (4, 5) else []
        return [box(12.0, -0.5, 0.3, 1.0, 1.5), *passer_by]

    for k, (owner, _, obstacles) in enumerate(drive(scene, 6)):
        centers = obstacles.static.centers_m
        mapped = (np.abs(centers[:, 0] - 12.0) < 0.2) & (np.abs(centers[:, 1]) < 0.6)
        assert mapped.sum() > 10
        if k == 5:
            assert (owner == 1).sum() == 0


def test_a_new_window_forgets():
    def scene(k):
        return [box(9.0, -3.0 + 0.15 * k)]

    segmenter = FreeSpaceSegmenter(HDL_64E, AREA)
    assert moving_share(*last(drive(scene, 12, segmenter=segmenter))[:2], 0) > 0.8
    _, states, obstacles = next(drive(scene, 1, segmenter=segmenter))
    assert not (states == PointState.MOVING).any()
    assert len(obstacles.moving) == 0


@pytest.mark.parametrize("is_stated", [False, True])
def test_a_scan_of_uncertain_pose_adds_no_moving_points(is_stated):
    """Two degrees and 0.4 m off in one scan; no later scan takes it for evidence either."""
    scene = [WALL, box(9.0, -4.0), box(12.0, 3.0), box(18.0, -6.0, 4.2, 1.8, 1.5)]
    off, moving = from_euler(0, 0, np.radians(2.0), np.array([0.4, 0.0, 0.0])), []
    stated = np.diag([0.4**2, 0.4**2, 0, 0, 0, np.radians(2.0) ** 2])
    segmenter, window = FreeSpaceSegmenter(HDL_64E, AREA), ScanWindow(6)
    for k in range(30):
        points, _ = cast(HDL_64E, (0.0, 0.0), scene)
        pose, doubt = (off, stated) if k == 12 else (np.eye(4), np.zeros((6, 6)))
        window.push(PosedScan(points, pose, doubt if is_stated else np.zeros((6, 6))))
        moving.append(len(segmenter.update(window, Road(HDL_64E.height_m)).moving))
    assert (sum(moving) == 0) == is_stated


def test_segmentation_is_deterministic():
    def scene(k):
        return [box(9.0, -3.0 + 0.15 * k), box(12.0, 3.0)]

    first, second = (last(drive(scene, 10)) for _ in range(2))
    assert (first[1] == second[1]).all()
    assert (first[2].static.centers_m == second[2].static.centers_m).all()


def test_the_world_s_origin_does_not_matter():
    """Poses millions of metres from the origin, as in map coordinates, cost no accuracy."""
    far = from_euler(0, 0, 0, np.array([4.5e5, 5.4e6, 100.0]))

    def states_of(shift):
        segmenter, window = FreeSpaceSegmenter(HDL_64E, AREA), ScanWindow(6)
        for k in range(12):
            points, _ = cast(
                HDL_64E, (0.0, 0.0), [WALL, box(9.03, -3.0 + 0.15 * k), box(12.03, 3.03)]
            )
            window.push(PosedScan(points, shift, stamp_s=0.1 * k))
            obstacles = segmenter.update(window, Road(HDL_64E.height_m))
        return obstacles

    here, there = states_of(np.eye(4)), states_of(far)
    assert (here.point_states == there.point_states).mean() > 0.999
    assert len(here.static) == pytest.approx(len(there.static), rel=0.05)


def test_a_scan_without_obstacles_is_segmented():
    points = np.array([[5, 0, -1.73, 0.2], [6, 1, -1.73, 0.2]], np.float32)
    window = ScanWindow(6)
    segmenter = FreeSpaceSegmenter(HDL_64E, AREA)
    for k in range(3):
        window.push(PosedScan(points, np.eye(4), stamp_s=0.1 * k))
        obstacles = segmenter.update(window, Road(1.73))
    assert obstacles.point_states.tolist() == [PointState.GROUND, PointState.GROUND]
    assert len(obstacles.static) == len(obstacles.moving) == 0


def test_each_method_makes_its_segmenter():
    config = MotionConfig()
    assert isinstance(motion_segmenter(config, "default", HDL_64E, AREA), FreeSpaceSegmenter)
    assert isinstance(motion_segmenter(config, "thesis", HDL_64E, AREA), CounterSegmenter)


@pytest.mark.parametrize(
    ("sensor", "previous_scans", "expected"),
    [(HDL_64E, 6, 50), (HDL_64E, 13, 100), (HDL_32E, 6, 26), (VLP_16, 6, 11)],
)
def test_static_threshold_follows_the_window_and_the_sensor(sensor, previous_scans, expected):
    assert static_threshold(MotionConfig(previous_scans=previous_scans), sensor) == expected


@pytest.mark.parametrize("name", ["voxel_size_m", "previous_scans"])
def test_empty_sizes_are_refused(name):
    with pytest.raises(UsageError) as error:
        MotionConfig(**{name: 0})
    assert (error.value.where, error.value.found) == (name, "0")


def test_a_given_static_threshold_holds_for_every_sensor():
    config = MotionConfig(counters=MotionCountersConfig(static_threshold=7))
    assert static_threshold(config, VLP_16) == 7
