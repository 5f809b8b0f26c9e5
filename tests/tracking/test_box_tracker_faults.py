"""What goes wrong on drives: tracks survive or end, and no number is ever lost or used twice."""

import numpy as np
import pytest

from perception.geometry.footprints import Footprints, footprints_of
from perception.tracking.box_tracker import BoxTracker
from perception.types import Tracks

HERE, NOTHING = np.eye(4), Footprints.empty()


def walker(step: float, y: float = 2.0) -> Footprints:
    """Return a walker at 1.4 m/s, ten steps a second, as a dense block."""
    across = np.linspace(-0.25, 0.25, 6)
    grid = np.stack(np.meshgrid(across, across, [-1.7, 0.0]), axis=-1).reshape(-1, 3)
    return footprints_of(
        grid + np.array([10 + 0.14 * step, y, 0]), np.zeros(len(grid), np.int64), 1
    )


def tracked(steps: int = 10) -> BoxTracker:
    tracker = BoxTracker()
    for step in range(steps):
        tracker.update(0.1 * step, HERE, walker(step), NOTHING)
    return tracker


def is_finite(tracks: Tracks) -> bool:
    columns = (
        tracks.boxes.bottom_m,
        tracks.boxes.size_m,
        tracks.boxes.yaw_rad,
        tracks.velocities_m_s,
    )
    return all(bool(np.isfinite(column).all()) for column in columns)


def test_no_scan_has_no_tracks():
    tracker = BoxTracker()
    for step in range(3):
        assert len(tracker.update(0.1 * step, HERE, NOTHING, NOTHING)) == 0


@pytest.mark.parametrize("back_s", [0.0, 0.4])
def test_a_stamp_that_is_not_later_leaves_the_tracks(back_s):
    tracker = tracked()
    before = tracker.update(1.0, HERE, walker(10), NOTHING)
    again = tracker.update(1.0 - back_s, HERE, walker(50, y=-5), NOTHING)
    assert again.ids.tolist() == before.ids.tolist() == [0]
    np.testing.assert_array_equal(again.boxes.bottom_m, before.boxes.bottom_m)
    after = tracker.update(1.1, HERE, walker(11), NOTHING)
    assert after.ids.tolist() == [0]
    np.testing.assert_allclose(after.velocities_m_s, [[1.4, 0.0]], atol=0.1)


def test_a_short_gap_in_time_is_bridged():
    tracker = tracked(20)
    tracks = tracker.update(2.6, HERE, walker(26), NOTHING)
    assert tracks.ids.tolist() == [0]
    np.testing.assert_allclose(tracks.velocities_m_s, [[1.4, 0.0]], atol=0.1)


def test_a_long_gap_in_time_ends_tracks_and_ids_go_on():
    tracker = tracked()
    assert len(tracker.update(60.0, HERE, NOTHING, NOTHING)) == 0
    for step in range(10):
        tracks = tracker.update(61 + 0.1 * step, HERE, walker(step), NOTHING)
    assert tracks.ids.tolist() == [1]
    assert is_finite(tracks)


def test_ids_are_not_used_again_after_all_tracks_ended():
    tracker = tracked()
    tracker.clear()
    assert len(tracker.update(2.0, HERE, NOTHING, NOTHING)) == 0
    tracker.clear()
    for step in range(10):  # the clock may restart as well
        tracks = tracker.update(0.1 * step, HERE, walker(step), NOTHING)
    assert tracks.ids.tolist() == [1]


def test_two_trackers_count_for_themselves():
    for _ in range(2):
        tracks = tracked().update(1.0, HERE, walker(10), NOTHING)
        assert tracks.ids.tolist() == [0]


def test_a_jump_of_the_pose_ends_the_track_and_begins_another():
    tracker, far = tracked(), np.eye(4)
    far[:2, 3] = 5e5, -3e5
    for step in range(10, 30):
        tracks = tracker.update(0.1 * step, far, walker(step), NOTHING)
        assert is_finite(tracks)
    assert tracks.ids.tolist() == [1]
    np.testing.assert_allclose(tracks.boxes.bottom_m[0, :2], [10 + 0.14 * 29, 2.0], atol=0.2)


def test_other_scan_rates_give_the_same_speed():
    for period_s in (0.05, 0.2):
        tracker = BoxTracker()
        for scan in range(15):
            tracks = tracker.update(period_s * scan, HERE, walker(10 * period_s * scan), NOTHING)
        np.testing.assert_allclose(tracks.velocities_m_s, [[1.4, 0.0]], atol=0.1)


def test_clusters_of_one_point_give_no_nan():
    tracker = BoxTracker()
    for step in range(20):
        point = np.array([[10 + 0.14 * step, 2.0, -1.0]])
        cluster = footprints_of(point, np.zeros(1, np.int64), 1)
        tracks = tracker.update(0.1 * step, HERE, cluster, cluster)
        assert is_finite(tracks)


def test_a_crowd_is_tracked():
    tracker, count = BoxTracker(), 60
    for step in range(6):
        parts = [walker(step, y=2.0 * n) for n in range(count)]
        points = np.concatenate(
            [np.column_stack([part.vertices_m, np.zeros(len(part.vertices_m))]) for part in parts]
        )
        numbers = np.repeat(np.arange(count), [int(part.corners[0]) for part in parts])
        crowd = footprints_of(np.repeat(points, 8, axis=0), np.repeat(numbers, 8), count)
        tracks = tracker.update(0.1 * step, HERE, crowd, NOTHING)
    assert tracks.ids.tolist() == list(range(count))
    np.testing.assert_allclose(tracks.velocities_m_s, np.tile([1.4, 0.0], (count, 1)), atol=0.15)
