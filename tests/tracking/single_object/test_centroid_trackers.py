"""The thesis' trackers in a hand-made scene: a red car of points over flat ground, before a grey wall."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest

from perception.errors import PerceptionError
from perception.geometry import se3
from perception.geometry.boxes import transform_boxes
from perception.geometry.camera import project
from perception.sensor import HDL_64E
from perception.tracking.single_object.config import CentroidTrackerConfig
from perception.tracking.single_object.fusion.fusion_tracker import FusionTracker
from perception.tracking.single_object.tracker import TrackedObject, TrackerInput, TrackStatus
from perception.tracking.single_object.trackers import single_object_tracker
from perception.types import Boxes3D

NAMES = ("h-fus", "l-fus", "3d-ms", "3d-kf")
SIZE_M = np.array([4.0, 1.8, 1.5])
SPEED_M_S = 6.0
GROUND_M = -HDL_64E.height_m
SIZE_PX = (640, 240)
# Looks along +x from the place of the LiDAR.
IMAGE_P_VELO = np.array([[320.0, -400, 0, 0], [120.0, 0, -400, 0], [1.0, 0, 0, 0]])


@dataclass(frozen=True)
class Scene:
    """A car that drives straight on; the vehicle drives and turns, too, on request.

    Attributes:
        start_xy_m: (2,) of the car's middle in the world.
        ego_speed_m_s: of the vehicle along x.
        ego_turn_rad_s: of the vehicle.
    """

    start_xy_m: tuple[float, float] = (14.0, 2.0)
    ego_speed_m_s: float = 0.0
    ego_turn_rad_s: float = 0.0

    def pose(self, time_s: float) -> np.ndarray:
        position = np.array([self.ego_speed_m_s * time_s, 0, 0])
        return se3.from_euler(0, 0, self.ego_turn_rad_s * time_s, position)

    def position(self, time_s: float) -> np.ndarray:
        """Return the middle of the car's bottom in the world."""
        x, y = self.start_xy_m
        return np.array([x + SPEED_M_S * time_s, y, GROUND_M])

    def box(self, time_s: float) -> Boxes3D:
        """Return the car in the LiDAR frame."""
        box_world = Boxes3D(self.position(time_s)[None], SIZE_M[None], np.zeros(1))
        return transform_boxes(se3.inverse(self.pose(time_s)), box_world)

    def tracker_input(
        self, frame: int, *, has_car: bool = True, has_image: bool = True
    ) -> TrackerInput:
        time_s = 0.1 * frame
        velo_SE3_world = se3.inverse(self.pose(time_s))
        car = (car_points() + self.position(time_s)).astype(np.float32)
        car_velo = se3.transform_points(velo_SE3_world, car) if has_car else np.zeros((0, 3))
        points = np.vstack([ground_points(), car_velo])
        points_velo = np.column_stack([points, np.zeros(len(points))]).astype(np.float32)
        image = image_of(car_velo) if has_image else None
        return TrackerInput(time_s, points_velo, self.pose(time_s), None, image, IMAGE_P_VELO)


def ground_points() -> np.ndarray:
    x, y = np.meshgrid(np.arange(4, 40, 0.5), np.arange(-12, 12, 0.5))
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, GROUND_M)])


def car_points() -> np.ndarray:
    """Return points throughout a car a little smaller than its box, over its place on the ground."""
    x, y, z = np.mgrid[-1.8:1.81:0.2, -0.75:0.76:0.15, 0.0:1.51:0.15]
    return np.column_stack([x.ravel(), y.ravel(), z.ravel()]).astype(np.float32)


def image_of(car_velo: np.ndarray) -> np.ndarray:
    image = np.full((SIZE_PX[1], SIZE_PX[0], 3), 120, np.uint8)
    pixels = project(IMAGE_P_VELO, car_velo)[0] if len(car_velo) else np.zeros((0, 2))
    pixels = pixels[np.isfinite(pixels).all(axis=1)]
    if len(pixels):
        cv2.fillConvexPoly(image, cv2.convexHull(pixels.astype(np.int32)), (200, 30, 30))
    return image


def center_of(tracked: TrackedObject) -> np.ndarray:
    assert tracked.box_velo is not None
    return tracked.box_velo.bottom_m[0] + (0, 0, SIZE_M[2] / 2)


def assert_finite(tracked: TrackedObject) -> None:
    box = tracked.box_velo
    assert box is not None
    for numbers in (box.bottom_m, box.size_m, box.yaw_rad, tracked.velocity_m_s):
        assert np.isfinite(numbers).all()
    assert tracked.box_px is None or np.isfinite(tracked.box_px).all()


def started(name: str, scene: Scene, frames: int = 1):
    """Return a tracker that has tracked the car over some frames."""
    tracker = single_object_tracker(name, HDL_64E)
    tracker.init(scene.tracker_input(0), scene.box(0))
    for frame in range(1, frames):
        tracker.update(scene.tracker_input(frame))
    return tracker


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    "scene",
    [
        pytest.param(Scene(), id="vehicle is static"),
        pytest.param(Scene(ego_speed_m_s=6.0), id="vehicle follows"),
        pytest.param(Scene(ego_turn_rad_s=0.1), id="vehicle turns"),
    ],
)
def test_follows_the_car(name, scene):
    tracker = single_object_tracker(name, HDL_64E)
    first = tracker.init(scene.tracker_input(0), scene.box(0))
    assert first.status is TrackStatus.SEEN
    np.testing.assert_allclose(first.box_velo.bottom_m, scene.box(0).bottom_m, atol=1e-9)
    for frame in range(1, 25):
        tracked = tracker.update(scene.tracker_input(frame))
        truth = scene.box(0.1 * frame)
        assert tracked.status is TrackStatus.SEEN
        np.testing.assert_array_equal(tracked.box_velo.size_m, truth.size_m)
        away_m = tracked.box_velo.bottom_m[0, :2] - truth.bottom_m[0, :2]
        # The mean of coloured points is that of what the camera sees first.
        assert np.hypot(*away_m) < (0.6 if name == "l-fus" else 0.45)
        assert tracked.box_velo.yaw_rad[0] == pytest.approx(truth.yaw_rad[0], abs=0.15)
    heading = np.array([np.cos(truth.yaw_rad[0]), np.sin(truth.yaw_rad[0])])
    assert tracked.velocity_m_s @ heading == pytest.approx(SPEED_M_S, abs=1.0)
    assert tracked.box_px is not None


@pytest.mark.parametrize("name", ["default", "h-fus", "l-fus", "3d-kf"])
def test_the_next_position_is_predicted_along_the_motion(name):
    scene = Scene(ego_turn_rad_s=0.1)
    tracked = started(name, scene, frames=24).update(scene.tracker_input(24))
    step_m = tracked.next_bottom_velo - tracked.box_velo.bottom_m[0]
    np.testing.assert_allclose(step_m[:2], tracked.velocity_m_s / 10, atol=0.1)
    assert np.hypot(*step_m[:2]) == pytest.approx(SPEED_M_S / 10, abs=0.1)


def test_a_mean_shift_without_a_filter_predicts_that_the_object_stays():
    scene = Scene()
    tracked = started("3d-ms", scene, frames=5).update(scene.tracker_input(5))
    np.testing.assert_allclose(tracked.next_bottom_velo, tracked.box_velo.bottom_m[0])


def test_the_region_holds_the_car_while_the_image_shows_it():
    scene = Scene()
    tracker = started("h-fus", scene, frames=5)
    region = tracker.update(scene.tracker_input(5)).region
    corners_px = project(IMAGE_P_VELO, car_points() + scene.position(0.5))[0]
    np.testing.assert_allclose(region.box_px[:2], corners_px.min(axis=0), atol=8)
    np.testing.assert_allclose(region.box_px[2:], corners_px.max(axis=0), atol=8)
    assert region.is_ring.sum() == pytest.approx(region.is_inside.sum(), rel=0.1)
    assert tracker.update(scene.tracker_input(6, has_image=False)).region is None
    assert tracker.update(scene.tracker_input(7)).region is not None
    assert tracker.update(scene.tracker_input(8, has_car=False)).region is None


@pytest.mark.parametrize("name", ["h-fus", "3d-ms", "3d-kf"])
def test_without_a_camera_the_scan_is_enough(name):
    scene = Scene()
    tracker = single_object_tracker(name, HDL_64E)
    tracker.init(replace(scene.tracker_input(0), image=None, image_P_velo=None), scene.box(0))
    for frame in range(1, 10):
        tracker_input = replace(scene.tracker_input(frame), image=None, image_P_velo=None)
        tracked = tracker.update(tracker_input)
        assert tracked.status is TrackStatus.SEEN
        assert tracked.box_px is None
    away_m = tracked.box_velo.bottom_m[0] - scene.box(0.9).bottom_m[0]
    assert np.hypot(*away_m[:2]) < 0.3


def test_coloured_points_need_an_image_to_begin():
    scene = Scene()
    with pytest.raises(PerceptionError) as caught:
        single_object_tracker("l-fus", HDL_64E).init(
            scene.tracker_input(0, has_image=False), scene.box(0)
        )
    assert caught.value.expected == "an image of the first frame"
    assert caught.value.found == "none"


@pytest.mark.parametrize("name", NAMES)
def test_an_image_may_be_missing_for_some_frames(name):
    scene = Scene()
    tracker = started(name, scene, frames=8)
    for frame in range(8, 20):
        tracked = tracker.update(scene.tracker_input(frame, has_image=not 9 <= frame < 14))
        assert tracked.status is TrackStatus.SEEN
        assert_finite(tracked)
        assert (tracked.box_px is None) == (9 <= frame < 14)
    away_m = tracked.box_velo.bottom_m[0, :2] - scene.box(1.9).bottom_m[0, :2]
    assert np.hypot(*away_m) < 0.6


@pytest.mark.parametrize("name", NAMES)
def test_another_light_does_no_harm(name):
    scene = Scene()
    tracker = started(name, scene, frames=6)
    dark = scene.tracker_input(6)
    tracked = tracker.update(replace(dark, image=np.zeros_like(dark.image)))
    assert_finite(tracked)


@pytest.mark.parametrize("name", NAMES)
def test_hidden_it_is_predicted_then_lost_and_never_nan(name):
    scene = Scene()
    tracker = started(name, scene, frames=20)
    states = []
    for frame in range(20, 60):
        tracked = tracker.update(scene.tracker_input(frame, has_car=False))
        assert_finite(tracked)
        states.append(tracked.status)
    # A second, give or take a scan: time adds up with rounding.
    assert states[:9] == [TrackStatus.PREDICTED] * 9
    assert states[10:] == [TrackStatus.LOST] * 30
    np.testing.assert_array_equal(tracked.velocity_m_s, [0, 0])
    assert tracked.next_bottom_velo is None


@pytest.mark.parametrize("name", ["h-fus", "l-fus", "3d-kf"])
def test_it_is_found_again_behind_an_occluder(name):
    scene = Scene()
    tracker = started(name, scene, frames=20)
    for frame in range(20, 26):
        tracked = tracker.update(scene.tracker_input(frame, has_car=False))
        assert tracked.status is TrackStatus.PREDICTED
    for frame in range(26, 32):
        tracked = tracker.update(scene.tracker_input(frame))
        assert tracked.status is TrackStatus.SEEN
    away_m = tracked.box_velo.bottom_m[0, :2] - scene.box(3.1).bottom_m[0, :2]
    assert np.hypot(*away_m) < 0.6


def test_a_lost_object_that_returns_is_found():
    scene = Scene()
    tracker = started("h-fus", scene, frames=5)
    for frame in range(5, 40):
        lost = tracker.update(scene.tracker_input(frame, has_car=False))
    assert lost.status is TrackStatus.LOST
    position = lost.box_velo.bottom_m[0]
    there = Scene(start_xy_m=(position[0] + 0.5 - 4.0 * SPEED_M_S, position[1]))
    found = tracker.update(there.tracker_input(40))
    assert found.status is TrackStatus.SEEN
    assert center_of(found)[0] == pytest.approx(position[0] + 0.5, abs=0.35)


@pytest.mark.parametrize("name", NAMES)
def test_an_initial_box_without_points_is_a_prediction(name):
    scene = Scene()
    tracker = single_object_tracker(name, HDL_64E)
    first = tracker.init(scene.tracker_input(0, has_car=False), scene.box(0))
    assert first.status is TrackStatus.PREDICTED
    np.testing.assert_allclose(first.box_velo.bottom_m, scene.box(0).bottom_m, atol=1e-9)
    found = tracker.update(scene.tracker_input(1))
    assert found.status is TrackStatus.SEEN
    assert_finite(found)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    "box",
    [
        pytest.param(Boxes3D.empty(), id="no box"),
        pytest.param(Boxes3D(np.zeros((2, 3)), np.ones((2, 3)), np.zeros(2)), id="two boxes"),
        pytest.param(
            Boxes3D(np.array([[np.nan, 0, 0]]), np.ones((1, 3)), np.zeros(1)), id="nan place"
        ),
        pytest.param(
            Boxes3D(np.zeros((1, 3)), np.array([[4.0, 0.0, 1.5]]), np.zeros(1)), id="no width"
        ),
        pytest.param(Boxes3D(np.zeros((1, 3)), -np.ones((1, 3)), np.zeros(1)), id="negative size"),
        pytest.param(
            Boxes3D(np.zeros((1, 3)), np.ones((1, 3)), np.array([np.inf])), id="infinite yaw"
        ),
    ],
)
def test_an_invalid_initial_box_is_an_error(name, box):
    with pytest.raises(PerceptionError) as caught:
        single_object_tracker(name, HDL_64E).init(Scene().tracker_input(0), box)
    assert caught.value.where == "initial box"
    assert caught.value.expected.startswith("one box of finite x y z")


@pytest.mark.parametrize("name", NAMES)
def test_a_frame_given_twice_gives_the_same_result(name):
    scene = Scene()
    tracker = started(name, scene, frames=10)
    once = tracker.update(scene.tracker_input(10))
    again = tracker.update(scene.tracker_input(10))
    assert again.status is once.status
    np.testing.assert_array_equal(again.box_velo.bottom_m, once.box_velo.bottom_m)
    np.testing.assert_array_equal(again.velocity_m_s, once.velocity_m_s)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("stamp_s", [-5.0, 60.0, np.nan])
def test_after_a_jump_in_time_the_object_is_lost(name, stamp_s):
    scene = Scene()
    tracker = started(name, scene, frames=10)
    jumped = tracker.update(replace(scene.tracker_input(10), stamp_s=stamp_s))
    assert jumped.status is TrackStatus.LOST
    assert_finite(jumped)
    after = tracker.update(replace(scene.tracker_input(11, has_car=False), stamp_s=stamp_s + 0.1))
    assert after.status is TrackStatus.LOST
    assert_finite(after)


@pytest.mark.parametrize("name", NAMES)
def test_an_empty_scan_is_no_observation(name):
    scene = Scene()
    tracker = started(name, scene, frames=10)
    empty = replace(scene.tracker_input(10), points_velo=np.zeros((0, 4), np.float32))
    tracked = tracker.update(empty)
    assert tracked.status is TrackStatus.PREDICTED
    assert_finite(tracked)


@pytest.mark.parametrize("name", NAMES)
def test_an_object_that_leaves_the_image_is_tracked_by_its_points(name):
    scene = Scene(start_xy_m=(9.0, -5.0), ego_turn_rad_s=0.35)
    tracker = single_object_tracker(name, HDL_64E)
    tracker.init(scene.tracker_input(0), scene.box(0))
    seen_px = []
    for frame in range(1, 20):
        tracked = tracker.update(scene.tracker_input(frame))
        assert tracked.status is TrackStatus.SEEN
        assert_finite(tracked)
        seen_px.append(tracked.box_px is not None)
    assert seen_px[0]
    assert not seen_px[-1]
    away_m = tracked.box_velo.bottom_m[0, :2] - scene.box(1.9).bottom_m[0, :2]
    assert np.hypot(*away_m) < 0.6


def test_a_hull_of_fewer_than_three_points_teaches_no_colours():
    scene = Scene()
    tracker = FusionTracker(HDL_64E)
    tracker_input = scene.tracker_input(0)
    two = np.array([[14.0, 2, 0, 0], [14.0, 2, -0.5, 0]], np.float32)
    bare = replace(
        tracker_input,
        points_velo=np.vstack([tracker_input.points_velo[: len(ground_points())], two]),
    )
    assert tracker.init(bare, scene.box(0)).status is TrackStatus.SEEN
    assert len(tracker.colors.colors) == 0
    tracked = tracker.update(scene.tracker_input(1))
    assert tracked.status is TrackStatus.SEEN
    assert len(tracker.colors.colors) > 0
    assert_finite(tracked)


def test_colours_are_those_of_the_car():
    scene = Scene()
    tracker = started("h-fus", scene, frames=5)
    red = 6 * 64 + 0 * 8 + 0
    assert tracker.colors.colors.ratios.argmax() == red
    assert tracker.colors.measured[red] == 1.0
    center_px = tracker.colors.regions[-1].center_px
    middle_m = scene.position(0.4)[None] + np.array([0, 0, SIZE_M[2] / 2])
    expected_px = project(IMAGE_P_VELO, middle_m)[0][0]
    assert np.hypot(*(center_px - expected_px)) < 12


def test_what_lies_beyond_the_gate_is_not_the_object():
    scene = Scene()
    tracker = single_object_tracker("3d-kf", HDL_64E)
    tracker.init(scene.tracker_input(0), scene.box(0))
    aside = Scene(start_xy_m=(14.0, 2.0 + 2 * SIZE_M[1] + 0.2))
    assert tracker.update(aside.tracker_input(1)).status is TrackStatus.PREDICTED


def test_the_ground_may_be_that_of_the_obstacle_stage():
    scene = Scene()
    tracker = FusionTracker(HDL_64E, point=CentroidTrackerConfig(ground="stage"))
    with pytest.raises(PerceptionError) as caught:
        tracker.init(scene.tracker_input(0), scene.box(0))
    assert caught.value.expected == "a ground model of the ground stage"
    assert caught.value.found == "none"


def test_an_update_before_init_fails():
    with pytest.raises(PerceptionError) as caught:
        FusionTracker(HDL_64E).update(Scene().tracker_input(0))
    assert caught.value.expected == "a call of init before update"


def test_a_tracker_can_be_initialized_again():
    scene = Scene()
    once = started("h-fus", scene, frames=8).update(scene.tracker_input(8))
    tracker = started("h-fus", Scene(start_xy_m=(20.0, -4.0)), frames=6)
    tracker.init(scene.tracker_input(0), scene.box(0))
    for frame in range(1, 9):
        again = tracker.update(scene.tracker_input(frame))
    np.testing.assert_array_equal(again.box_velo.bottom_m, once.box_velo.bottom_m)
