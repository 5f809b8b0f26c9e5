"""The default tracker on exact scenes: a sensor at the origin, boxes of points, a flat ground."""

import logging
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from data.open_drive import open_drive
from perception.errors import PerceptionError
from perception.geometry import se3
from perception.sensor import HDL_64E
from perception.tracking.single_object.box.box_fit_tracker import BoxFitTracker, log_lidar_only
from perception.tracking.single_object.tracker import TrackedObject, TrackerInput, TrackStatus
from perception.tracking.single_object.trackers import single_object_tracker
from perception.types import Boxes3D, Float, Float32, Float64

CAR_M, CYCLIST_M, WALKER_M = (4.4, 1.8, 1.5), (1.8, 0.7, 1.75), (0.8, 0.6, 1.75)
GROUND_M = -1.73


@dataclass(frozen=True)
class _MovingBox:
    """A box that goes straight on at a constant velocity."""

    size_m: tuple[float, float, float]
    start_m: tuple[float, float]
    yaw_rad: float = 0.0
    speed_m_s: float = 0.0

    def box(self, time_s: float) -> Boxes3D:
        displacement_m = (
            self.speed_m_s * time_s * np.array([np.cos(self.yaw_rad), np.sin(self.yaw_rad)])
        )
        x, y = np.array(self.start_m) + displacement_m
        return Boxes3D(
            np.array([[x, y, GROUND_M]]), np.array([self.size_m]), np.array([self.yaw_rad])
        )

    def points(self, time_s: float, rng: np.random.Generator) -> Float32:
        """Return points on the sides that face the sensor, or in the middle of a slender body."""
        box = self.box(time_s)
        length, width, height = self.size_m
        x, y, _ = box.bottom_m[0]
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        sensor = np.array([-(cos * x + sin * y), sin * x - cos * y])  # along and left
        rows = np.arange(0.3, height, 0.2)
        solid = 1.0 if width > 1.2 else 0.5
        faces = []
        for axis, (reach, across) in enumerate(((length, width), (width, length))):
            if abs(sensor[axis]) > reach / 2:
                sweep = np.arange(-across / 2, across / 2 + 0.05, 0.1) * solid
                face = np.full(len(sweep), np.sign(sensor[axis]) * reach / 2 * solid)
                faces.append(np.column_stack((face, sweep) if axis == 0 else (sweep, face)))
        outline = np.concatenate(faces)
        along, left = np.repeat(outline, len(rows), axis=0).T
        z = np.tile(rows, len(outline)) + GROUND_M
        world = np.column_stack([x + cos * along - sin * left, y + sin * along + cos * left, z])
        return (world + rng.normal(0, 0.02, world.shape)).astype(np.float32)


class _FlatGround:
    def height_m(self, xy_m: Float) -> Float64:
        return np.full(len(xy_m), GROUND_M)

    def distance_m(self, points_velo: Float) -> Float:
        return np.asarray(points_velo[:, 2] - GROUND_M)


def _tracker_input(time_s: float, *targets: _MovingBox, ground: bool = True) -> TrackerInput:
    rng = np.random.default_rng(round(time_s * 1000))
    lattice = np.stack(np.meshgrid(np.arange(-40, 40, 0.8), np.arange(-20, 20, 0.8)), -1)
    flat = lattice.reshape(-1, 2) + rng.uniform(-0.2, 0.2, (lattice.size // 2, 2))
    clouds = [np.column_stack([flat, np.full(len(flat), GROUND_M)])]
    clouds += [target.points(time_s, rng) for target in targets]
    points = np.concatenate(clouds)
    points_velo = np.column_stack([points, np.zeros(len(points))]).astype(np.float32)
    return TrackerInput(time_s, points_velo, np.eye(4), _FlatGround() if ground else None)


def _times(frames: int) -> list[float]:
    return [round(0.1 * number, 3) for number in range(frames)]


def _error_m(found: TrackedObject, target: _MovingBox, time_s: float) -> float:
    assert found.box_velo is not None
    return float(np.linalg.norm(found.box_velo.bottom_m[0] - target.box(time_s).bottom_m[0]))


def _yaw_error_rad(found: TrackedObject, target: _MovingBox) -> float:
    assert found.box_velo is not None
    off = float(found.box_velo.yaw_rad[0]) - target.yaw_rad
    return abs((off + np.pi) % (2 * np.pi) - np.pi)


def _started(target: _MovingBox, *others: _MovingBox) -> BoxFitTracker:
    tracker = BoxFitTracker(HDL_64E)
    tracker.init(_tracker_input(0.0, target, *others), target.box(0.0))
    return tracker


def test_is_the_default() -> None:
    assert isinstance(single_object_tracker("default", HDL_64E), BoxFitTracker)


@pytest.mark.parametrize("ground", [True, False])
@pytest.mark.parametrize(
    "target",
    [
        _MovingBox(CAR_M, (8.0, 6.0), 0.2, 8.0),
        _MovingBox(CAR_M, (20.0, -4.0), 3.0, 6.0),
        _MovingBox(CYCLIST_M, (8.0, 3.0), 0.4, 4.0),
        _MovingBox(WALKER_M, (10.0, -3.0), 1.6, 1.3),
        _MovingBox(CAR_M, (12.0, 5.0)),
    ],
    ids=["L-shape", "oncoming", "cyclist", "walker", "parked"],
)
def test_tracks_straight_motion(target: _MovingBox, ground: bool) -> None:
    tracker = _started(target)
    for time_s in _times(25)[1:]:
        found = tracker.update(_tracker_input(time_s, target, ground=ground))
        assert found.status is TrackStatus.SEEN
        assert _error_m(found, target, time_s) < 0.15
    assert _yaw_error_rad(found, target) < 0.1
    assert np.hypot(*found.velocity_m_s) == pytest.approx(target.speed_m_s, abs=0.35)


def test_bridges_a_full_occlusion_of_one_second() -> None:
    car = _MovingBox(CAR_M, (10.0, 6.0), 0.1, 7.0)
    tracker = _started(car)
    states = {}
    for time_s in _times(40)[1:]:
        is_hidden = 1.0 < time_s <= 2.0
        found = tracker.update(_tracker_input(time_s, *([] if is_hidden else [car])))
        states[time_s] = found.status
        assert _error_m(found, car, time_s) < 0.5
    assert all(states[time_s] is TrackStatus.PREDICTED for time_s in _times(21)[11:])
    assert states[2.1] is TrackStatus.SEEN
    assert _error_m(found, car, 3.9) < 0.15


def test_is_not_stolen_by_a_parked_car_while_hidden() -> None:
    car, parked = _MovingBox(CAR_M, (10.0, 6.0), 0.0, 7.0), _MovingBox(CAR_M, (22.0, 8.6))
    tracker = _started(car, parked)
    for time_s in _times(40)[1:]:
        is_hidden = 1.2 < time_s <= 2.4
        found = tracker.update(_tracker_input(time_s, *([] if is_hidden else [car]), parked))
        assert _error_m(found, car, time_s) < 0.6


def test_is_not_stolen_by_a_walker_passing_a_cyclist() -> None:
    cyclist = _MovingBox(CYCLIST_M, (8.0, 3.0), 0.0, 3.0)
    walker = _MovingBox(WALKER_M, (14.0, 4.1), np.pi, 1.4)
    tracker = _started(cyclist, walker)
    for time_s in _times(30)[1:]:
        found = tracker.update(_tracker_input(time_s, cyclist, walker))
        assert _error_m(found, cyclist, time_s) < 0.25


def test_leaves_a_row_of_parked_cars_alone() -> None:
    cars = [_MovingBox(CAR_M, (10.0 + 5.3 * number, 5.0)) for number in range(4)]
    tracker = _started(cars[1], cars[0], *cars[2:])
    for time_s in _times(15)[1:]:
        found = tracker.update(_tracker_input(time_s, *cars))
        assert _error_m(found, cars[1], time_s) < 0.15


def test_a_walker_who_stood_can_walk_off_sideways() -> None:
    stands = _MovingBox(WALKER_M, (10.0, 2.0), 0.0)
    walks = _MovingBox(WALKER_M, (10.0, 2.0 - 1.3 * 1.0), np.pi / 2, 1.3)
    tracker = _started(stands)
    for time_s in _times(35)[1:]:
        target = stands if time_s < 1.0 else walks
        found = tracker.update(_tracker_input(time_s, target))
        assert _error_m(found, target, time_s) < 0.3
    assert _yaw_error_rad(found, walks) < 0.3


def test_motion_corrects_a_rough_initial_box() -> None:
    car = _MovingBox(CAR_M, (9.0, 5.0), 0.1, 6.0)
    exact = car.box(0.0)
    rough = Boxes3D(
        exact.bottom_m + np.array([0.3, -0.3, 0.0]),
        exact.size_m * 1.1,
        exact.yaw_rad + np.radians(10),
    )
    tracker = BoxFitTracker(HDL_64E)
    tracker.init(_tracker_input(0.0, car), rough)
    for time_s in _times(25)[1:]:
        found = tracker.update(_tracker_input(time_s, car))
    assert _error_m(found, car, 2.4) < 0.4
    assert _yaw_error_rad(found, car) < 0.06


def test_an_empty_initial_box_is_predicted_then_lost() -> None:
    car = _MovingBox(CAR_M, (10.0, 5.0))
    tracker = BoxFitTracker(HDL_64E)
    tracker.init(_tracker_input(0.0), car.box(0.0))
    states = [tracker.update(_tracker_input(time_s)).status for time_s in _times(40)[1:]]
    assert states[0] is TrackStatus.PREDICTED
    assert states[-1] is TrackStatus.LOST


def test_an_object_that_disappears_is_predicted_then_lost_and_never_nan() -> None:
    car = _MovingBox(CAR_M, (10.0, 5.0), 0.0, 5.0)
    tracker = _started(car)
    states = []
    for time_s in _times(80)[1:]:
        found = tracker.update(_tracker_input(time_s, *([car] if time_s < 1.0 else [])))
        states.append(found.status)
        assert found.box_velo is not None
        assert np.isfinite(found.box_velo.bottom_m).all()
        assert np.isfinite([*found.velocity_m_s, *found.box_velo.yaw_rad]).all()
    assert states.index(TrackStatus.LOST) - states.index(TrackStatus.PREDICTED) == 30
    assert states[-1] is TrackStatus.LOST


def test_an_empty_scan_is_a_missed_one() -> None:
    car = _MovingBox(CAR_M, (10.0, 5.0), 0.0, 5.0)
    tracker = _started(car)
    for time_s in _times(10)[1:]:
        tracker.update(_tracker_input(time_s, car))
    empty = replace(_tracker_input(1.0), points_velo=np.zeros((0, 4), np.float32), ground=None)
    found = tracker.update(empty)
    assert found.status is TrackStatus.PREDICTED
    assert _error_m(found, car, 1.0) < 0.2
    assert tracker.update(_tracker_input(1.1, car)).status is TrackStatus.SEEN


def test_a_scan_given_twice_gives_the_same_result() -> None:
    car = _MovingBox(CAR_M, (10.0, 5.0), 0.0, 5.0)
    tracker = _started(car)
    first = tracker.update(_tracker_input(0.1, car))
    again = tracker.update(_tracker_input(0.1, car))
    assert first.box_velo is not None and again.box_velo is not None
    np.testing.assert_array_equal(first.box_velo.bottom_m, again.box_velo.bottom_m)
    assert again.status is first.status


def test_bridges_a_gap_in_time() -> None:
    car = _MovingBox(CAR_M, (8.0, 6.0), 0.0, 8.0)
    tracker = _started(car)
    for time_s in (*_times(11)[1:], 2.0, 2.1):
        found = tracker.update(_tracker_input(time_s, car))
        assert found.status is TrackStatus.SEEN
        assert _error_m(found, car, time_s) < 0.2


def test_boxes_are_in_the_frame_of_a_moving_sensor() -> None:
    car = _MovingBox(CAR_M, (12.0, 5.0))
    tracker = _started(car)
    for time_s in _times(15)[1:]:
        world_SE3_velo = se3.from_euler(0, 0, 0.2 * time_s, np.array([3 * time_s, 0.0, 0.0]))
        still = _tracker_input(time_s, car)
        points_velo = se3.transform_points(se3.inverse(world_SE3_velo), still.points_velo)
        tracker_input = replace(
            still, points_velo=points_velo, world_SE3_velo=world_SE3_velo, ground=None
        )
        found = tracker.update(tracker_input)
        assert found.box_velo is not None
        bottom_world = world_SE3_velo[:3, :3] @ found.box_velo.bottom_m[0] + world_SE3_velo[:3, 3]
        np.testing.assert_allclose(bottom_world, car.box(0.0).bottom_m[0], atol=0.15)


@pytest.mark.parametrize(
    "box",
    [
        Boxes3D(np.array([[np.nan, 0, 0]]), np.array([CAR_M]), np.zeros(1)),
        Boxes3D(np.zeros((1, 3)), np.array([[4.0, 0.0, 1.5]]), np.zeros(1)),
        Boxes3D.empty(),
    ],
    ids=["NaN", "flat", "none"],
)
def test_an_invalid_initial_box_is_an_error(box: Boxes3D) -> None:
    with pytest.raises(PerceptionError) as caught:
        BoxFitTracker(HDL_64E).init(_tracker_input(0.0), box)
    assert caught.value.where == "initial box"


def test_an_update_before_init_fails() -> None:
    with pytest.raises(PerceptionError) as caught:
        BoxFitTracker(HDL_64E).update(_tracker_input(0.0))
    assert caught.value.expected == "a call of init before update"


def test_logs_once_that_images_are_not_used(caplog: pytest.LogCaptureFixture) -> None:
    log_lidar_only.cache_clear()
    with caplog.at_level(logging.INFO):
        _started(_MovingBox(CAR_M, (10.0, 5.0)))
        _started(_MovingBox(CAR_M, (10.0, 5.0)))
    assert caplog.text.count("uses the LiDAR alone") == 1


@pytest.mark.parametrize(("track_id", "limit_m"), [(1, 0.20), (0, 0.60)], ids=["cyclist", "van"])
def test_tracks_real_objects(kitti_root: Path, track_id: int, limit_m: float) -> None:
    drive = open_drive(kitti_root / "tracking", sequence="0000", images=False)
    tracker, errors_m = BoxFitTracker(HDL_64E), []
    for index in range(40):
        frame, labels = drive[index], drive.labels(index)
        assert frame.world_SE3_velo is not None
        tracker_input = TrackerInput(frame.stamp_s, frame.points_velo, frame.world_SE3_velo)
        truth = labels.boxes_velo[labels.track_ids == track_id]
        found = tracker.update(tracker_input) if index else tracker.init(tracker_input, truth)
        assert found.status is TrackStatus.SEEN
        assert found.box_velo is not None
        errors_m.append(np.linalg.norm(found.box_velo.bottom_m[0] - truth.bottom_m[0]))
    assert np.mean(errors_m) < limit_m
