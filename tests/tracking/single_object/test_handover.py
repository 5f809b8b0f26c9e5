"""A track of the pipeline is handed over in its first frame, and tracked on its own from then on."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from perception.errors import PerceptionError, UsageError
from perception.geometry.grids import EgoVehicle
from perception.sensor import HDL_64E
from perception.tracking.single_object.handover import TrackHandover, tracker_input_of
from perception.tracking.single_object.tracker import TrackedObject, TrackerInput, TrackStatus
from perception.tracking.single_object.trackers import single_object_tracker
from perception.types import Boxes3D, Calibration, Frame, Obstacles, Result, Tracks, Voxels
from tests.faults import fault


@dataclass(frozen=True)
class FlatGround:
    def height_m(self, xy_m):
        return np.full(len(xy_m), -1.73)

    def distance_m(self, points_velo):
        return points_velo[:, 2] + 1.73


@dataclass
class Recorder:
    """A tracker that remembers what it was asked."""

    calls: list[str] = field(default_factory=list)
    tracker_inputs: list[TrackerInput] = field(default_factory=list)

    def init(self, tracker_input, box_velo):
        self.calls.append(f"init at {box_velo.bottom_m[0, 0]:g}")
        return self._report(tracker_input)

    def update(self, tracker_input):
        self.calls.append("update")
        return self._report(tracker_input)

    def _report(self, tracker_input):
        self.tracker_inputs.append(tracker_input)
        return TrackedObject(TrackStatus.SEEN, None, np.zeros(2), None)


def tracks_of(*ids: int) -> Tracks:
    count = len(ids)
    boxes = Boxes3D(
        np.array([[10.0 + number, 0, -1.7] for number in ids]).reshape(-1, 3),
        np.full((count, 3), 2.0),
        np.zeros(count),
    )
    return Tracks.unclassified(
        np.array(ids, np.int64), boxes, np.zeros((count, 2)), np.ones(count, bool)
    )


def result_with(*ids: int) -> Result:
    # The second point lies on the vehicle itself.
    points = np.array([[12, 0, -1, 0.5], [0, 0, -0.4, 0.1], [20, 5, 0, 0.2]], np.float32)
    camera = Calibration(np.eye(3, 4), np.eye(4))
    image = np.zeros((4, 6, 3), np.uint8)
    frame = Frame(3, 0.3, points, image=image, calibration=camera)
    nothing = Voxels(np.zeros((0, 3), np.float32), np.zeros(0, np.int64), 0.1)
    obstacles = Obstacles(np.zeros(3, np.uint8), nothing, nothing)
    pose = np.eye(4)
    pose[0, 3] = 7
    return Result(frame, pose, FlatGround(), obstacles, tracks=tracks_of(*ids))


def test_a_tracker_input_is_the_frame_without_the_vehicle_itself():
    result = result_with()
    tracker_input = tracker_input_of(result, EgoVehicle())
    np.testing.assert_array_equal(tracker_input.points_velo, result.frame.points_velo[[0, 2]])
    assert tracker_input.stamp_s == 0.3
    assert tracker_input.world_SE3_velo[0, 3] == 7
    assert tracker_input.ground is result.ground
    assert tracker_input.image is result.frame.image
    np.testing.assert_array_equal(tracker_input.image_P_velo, np.eye(3, 4))


def test_without_a_camera_a_tracker_input_has_no_image():
    result = result_with()
    bare = replace(result, frame=replace(result.frame, image=None, calibration=None))
    tracker_input = tracker_input_of(bare, EgoVehicle())
    assert tracker_input.image is None
    assert tracker_input.image_P_velo is None


def test_the_track_is_handed_over_once():
    tracker = Recorder()
    handover = TrackHandover(5, tracker, EgoVehicle())
    assert handover.update(result_with()) is None
    assert handover.update(result_with(4)) is None
    assert not handover.has_started
    assert handover.update(result_with(4, 5)) is not None
    for ids in [(5,), (4,), ()]:
        assert handover.update(result_with(*ids)) is not None
    assert tracker.calls == ["init at 15", "update", "update", "update"]
    assert handover.has_started
    assert all(len(tracker_input.points_velo) == 2 for tracker_input in tracker.tracker_inputs)


def test_a_tracker_of_images_waits_until_the_image_shows_the_object():
    camera = Calibration(np.array([[4.0, -4, 0, 0], [2.0, 0, -4, 0], [1, 0, 0, 0]]), np.eye(4))
    ahead = result_with(5)
    ahead = replace(ahead, frame=replace(ahead.frame, calibration=camera))
    boxes = replace(ahead.tracks.boxes, bottom_m=np.array([[-15.0, 0, -1.7]]))
    behind = replace(ahead, tracks=replace(ahead.tracks, boxes=boxes))
    handover = TrackHandover(5, single_object_tracker("ms-i", HDL_64E), EgoVehicle())
    assert handover.update(behind) is None
    assert not handover.has_started
    assert handover.update(ahead).box_px is not None


def test_without_a_camera_a_tracker_of_images_is_an_error():
    result = result_with(5)
    bare = replace(result, frame=replace(result.frame, image=None, calibration=None))
    handover = TrackHandover(5, single_object_tracker("ms-i", HDL_64E), EgoVehicle())
    with fault(PerceptionError, where="tracker ms-i", found="none"):
        handover.update(bare)


def test_a_negative_id_is_an_error():
    with pytest.raises(UsageError) as caught:
        TrackHandover(-1, Recorder(), EgoVehicle())
    assert (caught.value.expected, caught.value.found) == ("an id of 0 or more", "-1")
