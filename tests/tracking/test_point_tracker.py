import numpy as np
import pytest

from benchmarks.reference.point_tracker import ReferencePointTracker
from perception.errors import UsageError
from perception.geometry.footprints import Footprints, footprints_of
from perception.geometry.se3 import from_euler, inverse, transform_points
from perception.tracking.config import PointTrackerConfig
from perception.tracking.point_tracker import PointTracker
from perception.types import Tracks

METHODS = pytest.mark.parametrize("method", ["thesis", "author"])
HERE = np.eye(4)
NOTHING = Footprints.empty()
# Five points of a cluster 2 m long, 1 m wide, from 1.5 m below the LiDAR to its height.
CLUSTER = np.array([[1, 0.5, -1.5], [1, -0.5, 0], [-1, -0.5, 0], [-1, 0.5, -1.5], [0, 0, -0.75]])


def clusters(*positions_m: tuple[float, float]) -> Footprints:
    if not positions_m:
        return NOTHING
    points_m = np.concatenate([CLUSTER + np.array([x, y, 0.0]) for x, y in positions_m])
    return footprints_of(
        points_m, np.repeat(np.arange(len(positions_m)), len(CLUSTER)), len(positions_m)
    )


class Drive:
    """A tracker, and scans for it every 0.1 s."""

    def __init__(self, tracker: PointTracker) -> None:
        self.tracker, self.stamp_s = tracker, 100.0

    def scan(self, *positions_m: tuple[float, float], after_s: float = 0.1, pose=HERE) -> Tracks:
        self.stamp_s += after_s
        return self.tracker.update(self.stamp_s, pose, clusters(*positions_m), NOTHING)


@METHODS
def test_a_cluster_is_a_track_from_its_second_frame_on(method):
    drive = Drive(PointTracker(method))
    assert len(drive.scan((10, 0))) == 0
    tracks = drive.scan((10, 0))
    assert tracks.ids.tolist() == [0]
    assert tracks.is_observed.tolist() == [True]
    np.testing.assert_allclose(tracks.boxes.bottom_m, [[10, 0, -1.5]], atol=1e-9)
    np.testing.assert_allclose(tracks.boxes.size_m, [[2, 1, 1.5]])
    np.testing.assert_allclose(tracks.boxes.yaw_rad, [0])
    np.testing.assert_allclose(tracks.velocities_m_s, [[0, 0]], atol=1e-9)


def test_the_thesis_drops_what_the_next_frame_does_not_confirm():
    drive = Drive(PointTracker())
    drive.scan((10, 0))
    assert len(drive.scan()) == 0
    drive.scan((10, 0))
    assert drive.scan((10, 0)).ids.tolist() == [1]


def test_the_author_shows_a_leftover_from_the_next_frame_on_seen_or_not():
    drive = Drive(PointTracker("author"))
    drive.scan((10, 0))
    tracks = drive.scan()
    assert tracks.ids.tolist() == [0]
    assert tracks.is_observed.tolist() == [False]


def test_the_thesis_predicts_through_misses():
    drive = Drive(PointTracker())
    for frame in range(80):
        tracks = drive.scan((frame * 0.3, 2.0))
    np.testing.assert_allclose(tracks.velocities_m_s, [[3, 0]], atol=0.05)
    for miss in range(1, 6):
        tracks = drive.scan()
        assert tracks.is_observed.tolist() == [False]
        np.testing.assert_allclose(tracks.boxes.bottom_m[0, 0], 23.7 + 0.3 * miss, atol=0.1)
    np.testing.assert_allclose(tracks.velocities_m_s, [[3, 0]], atol=0.05)
    assert drive.scan((25.5, 2.0)).is_observed.tolist() == [True]


def test_the_author_brakes_through_misses():
    drive = Drive(PointTracker("author"))
    for frame in range(20):
        drive.scan((frame * 0.5, 2.0))
    for _ in range(80):
        tracks = drive.scan()
    assert tracks.ids.tolist() == [0]
    assert tracks.boxes.bottom_m[0, 0] < 11.5
    np.testing.assert_allclose(tracks.velocities_m_s, [[0, 0]], atol=0.05)


def test_the_gate_is_around_the_position_of_the_method():
    # Thing and vehicle drive at 30 m/s: 3 m a frame, by which the two rules' centres differ.
    poses = [from_euler(0, 0, 0, np.array([3.0 * frame, 0, 0])) for frame in range(120)]
    for method, center_m in (("thesis", 10.0), ("author", 7.0)):
        for away_m, expected in ((3.9, [True]), (4.1, [False]), (-3.9, [True]), (-4.1, [False])):
            drive = Drive(PointTracker(method))
            for pose in poses[:-1]:
                drive.scan((10, 0), pose=pose)
            tracks = drive.scan((center_m + away_m, 0.0), pose=poses[-1])
            assert tracks.ids.tolist() == [0]
            assert tracks.is_observed.tolist() == expected


@METHODS
def test_leaving_the_grid_takes_a_track_out_of_view(method):
    drive = Drive(PointTracker(method))
    for frame in range(6):
        tracks = drive.scan((27 + 0.5 * frame, 0))
    assert tracks.ids.tolist() == [0]
    assert len(drive.scan((30.4, 0))) == 0


def test_the_thesis_forgets_who_left_and_the_author_does_not():
    for method, expected in (("thesis", [1]), ("author", [0])):
        drive = Drive(PointTracker(method))
        for x in (29.0, 29.0, 30.6, 30.6, 30.6, 29.0, 29.0):
            tracks = drive.scan((x, 0))
        assert tracks.ids.tolist() == expected


def test_the_author_keeps_only_tracks_nearby():
    drive = Drive(PointTracker("author"))
    for frame in range(400):
        pose = from_euler(0, 0, 0, np.array([10.0 * frame, 0, 0]))
        drive.scan((15, 5), (10, -5), (20, 0), pose=pose)
    assert len(drive.tracker) < 40
    assert drive.scan(pose=pose).ids.max() == 1199


def test_positions_and_velocities_are_in_the_axes_of_the_scan():
    # The vehicle drives along the world's +y and turns; the object drives along the world's +x.
    drive = Drive(PointTracker())
    for frame in range(80):
        pose = from_euler(0.01, -0.02, 1.0 - 0.005 * frame, np.array([50, 30 + 0.1 * frame, 2]))
        thing_world = np.array([[52.0 + 0.1 * frame, 42.0, 2.0]], np.float32)
        thing_velo = transform_points(inverse(pose), thing_world)
        tracks = drive.scan(tuple(thing_velo[0, :2]), pose=pose)
    np.testing.assert_allclose(tracks.boxes.bottom_m[0, :2], thing_velo[0, :2], atol=0.1)
    np.testing.assert_allclose(tracks.velocities_m_s[0], inverse(pose)[:2, 0], atol=0.05)
    assert tracks.ids.tolist() == [0]


@METHODS
def test_equals_the_reference_implementation(method):
    rng = np.random.default_rng(11)
    fast, plain = Drive(PointTracker(method)), Drive(ReferencePointTracker(method))
    positions_m, velocity_m_s = rng.uniform(-9, 9, (12, 2)), rng.normal(0, 5, (12, 2))
    shown = 0
    for frame in range(60):
        is_found = rng.uniform(size=12) < 0.7
        found = (positions_m + 0.1 * frame * velocity_m_s)[is_found]
        pose = from_euler(0, 0.02, 0.02 * frame, np.array([0.5 * frame, 0, 0]))
        step_s = rng.choice([0.1, 0.1, 0.0, 0.3])
        ours, theirs = (d.scan(*found, after_s=step_s, pose=pose) for d in (fast, plain))
        shown += len(ours)
        assert ours.ids.tolist() == theirs.ids.tolist()
        assert ours.is_observed.tolist() == theirs.is_observed.tolist()
        np.testing.assert_allclose(ours.boxes.bottom_m, theirs.boxes.bottom_m, atol=1e-8)
        np.testing.assert_allclose(ours.boxes.size_m, theirs.boxes.size_m, atol=1e-8)
        np.testing.assert_allclose(ours.velocities_m_s, theirs.velocities_m_s, atol=1e-8)
    assert shown > 100


@METHODS
def test_a_repeated_frame_gives_the_same_tracks(method):
    drive = Drive(PointTracker(method))
    drive.scan((10, 0))
    assert len(drive.scan((10, 0), after_s=0.0)) == 0  # not its own confirmation
    first = drive.scan((10.2, 0))
    for earlier_s in (0.0, -0.3):
        again = drive.scan((13.0, 0), (5, 5), after_s=earlier_s)
        drive.stamp_s -= earlier_s
        assert again.ids.tolist() == first.ids.tolist()
        np.testing.assert_array_equal(again.boxes.bottom_m, first.boxes.bottom_m)
        np.testing.assert_array_equal(again.velocities_m_s, first.velocities_m_s)
    assert drive.scan((10.4, 0)).ids.tolist() == [0]


def test_the_thesis_follows_over_a_gap_in_time():
    drive = Drive(PointTracker())
    for frame in range(20):
        drive.scan((frame * 0.5 - 5, 2.0))
    tracks = drive.scan((14.5, 2.0), after_s=2.0)
    assert tracks.ids.tolist() == [0]
    assert tracks.is_observed.tolist() == [True]


def test_the_author_loses_the_object_in_a_gap():
    drive = Drive(PointTracker("author"))
    for frame in range(20):
        drive.scan((frame * 0.5 - 5, 2.0))
    drive.scan((14.5, 2.0), after_s=2.0)
    assert drive.scan((15.0, 2.0)).ids.tolist() == [0, 1]


@METHODS
def test_an_hour_without_frames_or_without_detections_does_no_harm(method):
    drive = Drive(PointTracker(method))
    for frame in range(5):
        drive.scan((frame * 0.5, 2.0), (10, -3))
    drive.scan(after_s=3600.0)
    for _ in range(300):
        tracks = drive.scan()
    assert np.isfinite(tracks.boxes.bottom_m).all()
    drive.scan((5, 5))
    tracks = drive.scan((5, 5))
    assert np.isfinite(tracks.boxes.bottom_m).all()
    assert tracks.is_observed.sum() == 1


@METHODS
def test_no_detections_at_all(method):
    drive = Drive(PointTracker(method))
    assert [len(drive.scan()) for _ in range(3)] == [0, 0, 0]


@METHODS
def test_clear_deletes_all_tracks_and_keeps_counting_ids(method):
    drive = Drive(PointTracker(method))
    for _ in range(3):
        drive.scan((10, 0), (5, 5))
    drive.tracker.clear()
    assert len(drive.scan((10, 0), (5, 5), after_s=-90.0)) == 0  # also on an earlier clock
    assert drive.scan((10, 0), (5, 5)).ids.tolist() == [2, 3]
    drive.tracker.clear()
    drive.tracker.clear()
    assert len(drive.scan()) == 0


@METHODS
def test_ids_rise_and_are_never_given_twice(method):
    rng, drive = np.random.default_rng(2), Drive(PointTracker(method))
    ended: set[int] = set()
    before: set[int] = set()
    for _ in range(150):
        positions = rng.uniform([-9, -9], [29, 9], (rng.integers(0, 6), 2))
        ids = drive.scan(*positions).ids.tolist()
        assert ids == sorted(set(ids))
        assert not ended & set(ids)
        if method == "thesis":  # the author's tracks are hidden outside, not ended
            ended |= before - set(ids)
        before = set(ids)


def test_trackers_do_not_share_ids():
    first, second = Drive(PointTracker()), Drive(PointTracker())
    for drive in (first, second):
        drive.scan((10, 0))
        assert drive.scan((10, 0)).ids.tolist() == [0]


def test_detections_outside_the_grid_begin_no_track():
    drive = Drive(PointTracker())
    for _ in range(3):
        tracks = drive.scan((35, 0), (0, 12), (10, 0))
    assert len(tracks) == 1


@pytest.mark.parametrize("change", [{"gate_m": 0.0}, {"initial_variance": -1.0}])
def test_invalid_configs_are_errors(change):
    with pytest.raises(UsageError) as caught:
        PointTrackerConfig(**change)
    assert caught.value.where == "point tracker"
