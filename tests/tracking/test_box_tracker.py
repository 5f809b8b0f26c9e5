"""Exact small scenes: boxes whose sides are seen as a LiDAR at the origin sees them, 10 scans a second."""

from dataclasses import replace

import numpy as np
import pytest

from perception.geometry.footprints import Footprints, footprints_of
from perception.geometry.grids import LocalArea
from perception.geometry.se3 import from_euler
from perception.tracking.box_tracker import BoxTracker
from perception.types import Tracks

HERE = np.eye(4)
NOTHING = Footprints.empty()
CAR = (4.3, 1.75, 1.5)
WALKER = (0.8, 0.6, 1.7)
ROAD_M = -1.7


def sides(x: float, y: float, yaw: float, size: tuple[float, float, float]) -> np.ndarray:
    """Return points every 10 cm on the sides of a box that face the origin, at two heights."""
    length, width, height = size
    along, across = np.arange(-length / 2, length / 2, 0.1), np.arange(-width / 2, width / 2, 0.1)
    faces = [
        (np.column_stack([np.full(len(across), length / 2), across]), (1, 0)),
        (np.column_stack([np.full(len(across), -length / 2), across]), (-1, 0)),
        (np.column_stack([along, np.full(len(along), width / 2)]), (0, 1)),
        (np.column_stack([along, np.full(len(along), -width / 2)]), (0, -1)),
    ]
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    seen = []
    for points, normal in faces:
        points_velo = points @ turn.T + (x, y)
        if (points_velo.mean(axis=0) @ (turn @ normal)) < 0:
            seen.append(points_velo)
    flat = np.concatenate(seen)
    heights = np.repeat([ROAD_M, ROAD_M + height], len(flat))
    return np.column_stack([np.tile(flat, (2, 1)), heights])


def clusters(*clouds: np.ndarray) -> Footprints:
    if not clouds:
        return NOTHING
    numbers = np.repeat(np.arange(len(clouds)), [len(cloud) for cloud in clouds])
    return footprints_of(np.concatenate(clouds), numbers, len(clouds))


class Drive:
    """A tracker, and scans for it every 0.1 s."""

    def __init__(self, area: LocalArea | None = None) -> None:
        self.tracker, self.stamp_s = BoxTracker(area), 100.0

    def scan(
        self, *clouds: np.ndarray, static: Footprints = NOTHING, after_s: float = 0.1
    ) -> Tracks:
        self.stamp_s += after_s
        return self.tracker.update(self.stamp_s, HERE, clusters(*clouds), static)


def test_a_car_that_passes_keeps_its_size_and_has_no_bias():
    drive, seen = Drive(), []
    for step in range(60):  # oncoming at 10 m/s, from ahead to behind: front, side, rear
        x = 28.0 - 1.0 * step
        tracks = drive.scan(sides(x, 4.0, np.pi, CAR))
        if step >= 10:
            assert tracks.ids.tolist() == [0]
            seen.append((*(tracks.boxes.bottom_m[0, :2] - (x, 4.0)), *tracks.boxes.size_m[0]))
            np.testing.assert_allclose(tracks.velocities_m_s, [[-10.0, 0.0]], atol=0.4)
            assert abs(np.cos(tracks.boxes.yaw_rad[0]) + 1) < 0.01
    seen = np.array(seen)
    assert np.abs(seen[:, :2].mean(axis=0)).max() < 0.1
    assert np.abs(seen[:, :2]).max() < 0.3
    assert np.ptp(seen[:, 2]) < 0.25  # the length
    np.testing.assert_allclose(seen[:, 2:].mean(axis=0), CAR, atol=0.15)


def test_a_car_whose_rear_alone_is_seen_is_as_long_as_cars_are():
    drive = Drive()
    for step in range(20):
        x = 12.0 + 0.8 * step
        tracks = drive.scan(sides(x, 0.0, 0.0, CAR))
    assert tracks.boxes.size_m[0, 0] == pytest.approx(2.4 * CAR[1], abs=0.3)
    assert tracks.boxes.bottom_m[0, 0] == pytest.approx(x, abs=0.25)
    np.testing.assert_allclose(tracks.velocities_m_s, [[8.0, 0.0]], atol=0.2)
    assert tracks.boxes.yaw_rad[0] == pytest.approx(0.0, abs=0.03)


def test_a_cluster_observed_once_is_no_track():
    drive = Drive()
    for _ in range(3):
        assert len(drive.scan(sides(10, 2, 0, WALKER))) == 0
        for _ in range(5):
            assert len(drive.scan()) == 0


def test_a_cluster_that_stays_in_place_is_no_track():
    drive, noise = Drive(), np.random.default_rng(0)
    for _ in range(20):
        x, y = noise.normal((10.0, 3.0), 0.02)
        assert len(drive.scan(sides(x, y, 0, WALKER))) == 0


def test_a_well_observed_walker_is_reported_by_its_third_scan():
    drive = Drive()
    reported = [len(drive.scan(sides(10 + 0.14 * step, 2, 0, WALKER))) for step in range(4)]
    assert reported[0] == 0
    assert reported[2:] == [1, 1]


def test_a_second_of_occlusion_keeps_the_id():
    drive = Drive()
    for step in range(40):
        is_hidden = 15 <= step < 25
        cloud = () if is_hidden else (sides(8.0, -6.0 + 0.15 * step, np.pi / 2, WALKER),)
        tracks = drive.scan(*cloud)
        if 20 <= step < 25:
            assert len(tracks) == 0  # nobody knows where it is any more
        if step >= 27:
            assert tracks.ids.tolist() == [0]
            assert tracks.is_observed.all()


def test_two_walkers_who_cross_keep_their_ids():
    drive = Drive()
    for step in range(50):
        left = sides(10.0, -3.0 + 0.13 * step, np.pi / 2, WALKER)
        right = sides(11.5, 3.0 - 0.13 * step, -np.pi / 2, WALKER)
        tracks = drive.scan(left, right)
        if step >= 4:
            assert tracks.ids.tolist() == [0, 1]
            assert tracks.boxes.bottom_m[0, 0] < tracks.boxes.bottom_m[1, 0]
            assert tracks.velocities_m_s[0, 1] > 0.8
            assert tracks.velocities_m_s[1, 1] < -0.8


def test_a_car_that_stops_keeps_its_id_and_is_slow():
    drive, x, speed, reported = Drive(), 20.0, 6.0, []
    for step in range(60):
        x -= 0.1 * speed
        speed = max(0.0, speed - 0.3)
        cloud = sides(x, 3.5, np.pi, CAR)
        tracks = drive.scan(static=clusters(cloud)) if 26 <= step < 40 else drive.scan(cloud)
        reported.append(tracks.ids.tolist())
        if step >= 40:  # it moves again, as far as the detector is concerned
            assert tracks.ids.tolist() == [0]
            assert np.hypot(*tracks.velocities_m_s[0]) < 0.3
    assert reported[26:34] == [[0]] * 8
    assert reported[37:40] == [[]] * 3  # standing for a second is no news


def test_a_static_post_continues_no_track():
    drive, post = Drive(), sides(10.0, 1.6, 0, WALKER)
    for step in range(12):
        drive.scan(sides(10.0, 0.13 * step, np.pi / 2, WALKER), static=clusters(post))
    assert len(drive.scan(static=clusters(post))) == 1  # going on as it went
    for _ in range(4):
        tracks = drive.scan(static=clusters(post))
    assert len(tracks) == 0


def test_a_track_ends_beyond_the_area():
    drive = Drive(LocalArea(ahead_m=30, behind_m=10, side_m=10))
    for step in range(30):
        tracks = drive.scan(sides(8.0, 6.0 + 0.15 * step, np.pi / 2, WALKER))
    y = 6.0 + 0.15 * 29
    assert y > 10
    assert tracks.is_observed.tolist() == [True]
    assert len(drive.scan()) == 0
    assert len(drive.scan(sides(8.0, y + 0.3, np.pi / 2, WALKER))) == 0


def test_a_fragment_is_no_track_of_its_own():
    drive = Drive()
    for step in range(20):
        car = sides(14.0 + 0.8 * step, 2.0, 0.0, CAR)
        seat = np.array([[13.8, 2.1, -0.6], [13.9, 2.0, -0.5], [13.8, 2.0, -0.5]])
        tracks = drive.scan(car, seat + np.array([0.8 * step, 0, 0]))
        if step >= 3:
            assert tracks.ids.tolist() == [0]


def test_one_scan_that_joins_two_objects_does_not_change_the_size():
    drive = Drive()
    for step in range(20):
        x = 10.0 + 0.13 * step
        walker = sides(x, 2.0, 0.0, WALKER)
        cloud = np.vstack([walker, sides(x, 3.5, 0.0, WALKER)]) if step == 12 else walker
        tracks = drive.scan(cloud)
        if step == 11:
            before = tracks
    np.testing.assert_allclose(tracks.boxes.size_m[:, :2], before.boxes.size_m[:, :2], atol=0.05)


def test_tracks_are_in_the_frame_of_their_scan():
    """The same street seen from a vehicle that drives beside the car sees the car stand still before it."""
    tracker = BoxTracker()
    for step in range(20):
        pose = np.eye(4)
        pose[:2, :2] = [[0, -1], [1, 0]]  # the vehicle drives along the world's y
        pose[1, 3] = 0.8 * step
        tracks = tracker.update(0.1 * step, pose, clusters(sides(12.0, 0.0, 0.0, CAR)), NOTHING)
    np.testing.assert_allclose(tracks.boxes.bottom_m[0, :2], [12.0, 0.0], atol=0.3)
    np.testing.assert_allclose(tracks.velocities_m_s[0], [8.0, 0.0], atol=0.3)
    assert tracks.boxes.yaw_rad[0] == pytest.approx(0.0, abs=0.05)


def test_boxes_begin_at_the_lowest_point_of_clusters():
    drive = Drive()
    for step in range(20):
        tracks = drive.scan(sides(14.0 + 0.8 * step, 2.0, 0.0, CAR))
    assert tracks.boxes.bottom_m[0, 2] == pytest.approx(ROAD_M)
    assert tracks.boxes.size_m[0, 2] == pytest.approx(CAR[2])


def test_the_order_of_clusters_does_not_matter():
    first, second = Drive(), Drive()
    for step in range(10):
        clouds = [
            sides(10.0 + 0.13 * step, 2.0, 0.0, WALKER),
            sides(20.0 - 0.8 * step, -4.0, np.pi, CAR),
        ]
        one, other = first.scan(*clouds), second.scan(*clouds[::-1])
    assert one.ids.tolist() == other.ids.tolist() == [0, 1]
    np.testing.assert_allclose(one.boxes.bottom_m, other.boxes.bottom_m[::-1], atol=1e-9)
    assert len(replace(one)) == 2


@pytest.mark.parametrize("speed_m_s", [-9.0, 9.0])
def test_from_its_first_report_on_a_vehicle_heads_where_it_goes(speed_m_s):
    drive, reported = Drive(), 0
    for step in range(8):
        tracks = drive.scan(sides(16.0 + 0.1 * speed_m_s * step, 4.0, 0.0, CAR))
        reported += len(tracks)
        ahead = tracks.velocities_m_s[:, 0] * np.cos(tracks.boxes.yaw_rad)
        assert (ahead > 0).all()
    assert reported >= 5


LORRY = (10.7, 2.6, 3.2)


def test_a_lorry_beside_the_sensor_keeps_its_heading_and_its_id():
    drive, rng = Drive(), np.random.default_rng(2)
    for step in range(36):  # only its side is visible
        cloud = sides(-4.0 + 0.25 * step, 3.5, 0.0, LORRY)
        cloud[:, :2] += rng.normal(0, 0.05, (len(cloud), 2))
        tracks = drive.scan(cloud)
        if step > 10:
            assert tracks.ids.tolist() == [0]
            assert abs(tracks.boxes.yaw_rad[0]) < 0.05
            near_side_m = tracks.boxes.bottom_m[0, 1] - tracks.boxes.size_m[0, 1] / 2
            assert near_side_m == pytest.approx(2.2, abs=0.3)


def test_a_part_that_turns_out_to_be_of_a_long_body_gives_it_its_id():
    drive = Drive()
    for step in range(40):
        x_m = 4.0 + 0.2 * step
        whole = sides(x_m, 4.5, 0.0, LORRY)
        part = whole[whole[:, 0] < x_m - LORRY[0] / 2 + 2.0]
        tracks = drive.scan(part if step < 12 else whole)
        if step > 5:
            assert set(tracks.ids.tolist()) <= {0, 1}
    assert tracks.ids.tolist() == [0]
    assert tracks.boxes.size_m[0, 0] == pytest.approx(10.7, abs=0.6)


def test_a_tram_is_as_long_as_it_is():
    drive = Drive()
    for step in range(30):
        tracks = drive.scan(sides(3.0 + 0.3 * step, 5.0, 0.0, (18.8, 2.5, 3.5)))
    assert tracks.ids.tolist() == [0]
    assert tracks.boxes.size_m[0, 0] == pytest.approx(18.8, abs=0.6)


def test_two_lorries_in_a_row_stay_two():
    drive = Drive()
    for step in range(30):
        x_m = -6.0 + 0.25 * step
        tracks = drive.scan(sides(x_m, 4.5, 0.0, LORRY), sides(x_m + 13.0, 4.5, 0.0, LORRY))
    assert tracks.ids.tolist() == [0, 1]


def test_a_car_that_leaves_the_shadow_of_a_lorry_has_its_own_id():
    drive = Drive()
    for step in range(30):
        lorry = sides(6.0 + 0.1 * step, 3.5, 0.0, LORRY)
        car = sides(9.0 + 0.6 * step, 7.0, 0.0, CAR)
        tracks = drive.scan(*([lorry, car] if step > 8 else [lorry]))
    assert tracks.ids.tolist() == [0, 1]
    assert tracks.velocities_m_s[:, 0] == pytest.approx([1.0, 6.0], abs=0.3)


def moments(rate_hz: float, duration_s: float) -> list[float]:
    """Return stamps of scans that come up to a tenth of the period early or late."""
    jitter = np.random.default_rng(0).uniform(-0.1, 0.1, round(duration_s * rate_hz))
    return [(number + off) / rate_hz for number, off in enumerate(jitter.tolist())]


def reported_at(stamps_s: list[float], *paths: tuple, hidden_s: tuple = (0.0, 0.0)) -> list[Tracks]:
    """Return the tracks of each scan; paths are x, y, vx, vy, size, and when the object comes and goes."""
    tracker, found = BoxTracker(), []
    for stamp_s in stamps_s:
        is_hidden = hidden_s[0] <= stamp_s < hidden_s[1]
        seen = [
            sides(x + vx * stamp_s, y + vy * stamp_s, np.arctan2(vy, vx), size)
            for x, y, vx, vy, size, comes_s, goes_s in paths
            if comes_s <= stamp_s < goes_s and not is_hidden
        ]
        found.append(tracker.update(100.0 + stamp_s, HERE, clusters(*seen), NOTHING))
    return found


RATES = pytest.mark.parametrize("rate_hz", [2, 5, 10, 20])


@RATES
def test_an_object_has_one_id_at_any_rate(rate_hz):
    stamps_s = moments(rate_hz, 5.0)
    for vx, size in ((-10.0, CAR), (1.4, WALKER)):
        found = reported_at(stamps_s, (25.0, 4.0, vx, 0.0, size, -1, 9))
        confirmed_s = next(s for s, one in zip(stamps_s, found, strict=True) if len(one))
        assert confirmed_s <= max(1.2 / rate_hz, 0.5)
        is_late = np.array(stamps_s) > 1.2
        late = [one for one, is_one in zip(found, is_late, strict=True) if is_one]
        assert [one.ids.tolist() for one in late] == [[0]] * len(late)
        np.testing.assert_allclose(late[-1].velocities_m_s, [[vx, 0.0]], atol=0.5)


@RATES
def test_two_who_cross_keep_their_ids_at_any_rate(rate_hz):
    left = (10.0, -3.5, 0.0, 1.4, WALKER, -1, 9)
    right = (12.0, 3.5, 0.0, -1.4, WALKER, -1, 9)
    for tracks in reported_at(moments(rate_hz, 5.0), left, right)[rate_hz:]:
        order = np.argsort(tracks.velocities_m_s[:, 1])
        assert tracks.ids[order].tolist() == [1, 0]


@RATES
def test_a_second_without_it_keeps_the_id_at_any_rate(rate_hz):
    stamps_s = moments(rate_hz, 6.0)
    found = reported_at(stamps_s, (30.0, 4.0, -8.0, 0.0, CAR, -1, 9), hidden_s=(2.55, 3.45))
    assert {number for one in found for number in one.ids.tolist()} == {0}
    assert len(found[-1]) == 1


@RATES
def test_who_leaves_and_who_comes_are_two_at_any_rate(rate_hz):
    leaves = (20.0, 4.0, 10.0, 0.0, CAR, -1, 2.4)
    comes = (-20.0, 4.0, 10.0, 0.0, CAR, 2.4, 9)
    found = reported_at(moments(rate_hz, 5.0), leaves, comes)
    assert {number for one in found for number in one.ids.tolist()} == {0, 1}
    assert found[-1].ids.tolist() == [1]


@pytest.mark.parametrize(("is_stated", "off_m"), [(False, 0.15), (True, 0.03)])
def test_a_scan_of_doubtful_pose_hardly_moves_a_track(is_stated, off_m):
    """One scan turned by a degree shifts a car 25 m away by 0.4 m."""
    tracker, turned = BoxTracker(), np.radians(1.0)
    doubt, sideways_m = np.diag([0, 0, 0, 0, 0, turned**2]), []
    for step in range(20):
        pose = from_euler(0, 0, turned if step == 15 else 0.0)
        stated = doubt if is_stated and step == 15 else None
        car = clusters(sides(10.0 + step, 0.0, 0.0, CAR))
        tracks = tracker.update(100 + 0.1 * step, pose, car, NOTHING, stated)
        assert tracks.ids.tolist() == ([0] if step else [])
        if step >= 15:
            sideways_m.append((pose[:3, :3] @ tracks.boxes.bottom_m[0])[1])
    assert max(sideways_m) == pytest.approx(off_m, abs=0.01)
