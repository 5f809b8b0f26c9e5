"""Handover of a track of the pipeline to a tracker of one object, as the thesis suggests for its DATMO system (5.3)."""

import numpy as np

from perception.errors import PerceptionError, UsageError
from perception.geometry.grids import EgoVehicle
from perception.tracking.single_object.tracker import (
    SingleObjectTracker,
    TrackedObject,
    TrackerInput,
)
from perception.types import Boxes3D, Result


def tracker_input_of(result: Result, ego_vehicle: EgoVehicle) -> TrackerInput:
    """Return a frame of the pipeline as the input of a tracker of one object.

    Args:
        result: Pose and ground of the frame.
        ego_vehicle: Outline of the vehicle itself, whose returns are left out.
    """
    frame = result.frame
    return TrackerInput(
        stamp_s=frame.stamp_s,
        points_velo=frame.points_velo[~ego_vehicle.contains_xy(frame.points_velo)],
        world_SE3_velo=result.odom_SE3_velo,
        ground=result.ground,
        image=frame.image,
        image_P_velo=None if frame.calibration is None else frame.calibration.image_P_velo,
    )


class TrackHandover:
    """Hands one object of the pipeline to a tracker of one object, in the first frame that has it.

    A tracker that needs the image takes it over in the first frame that shows it. The object is a track of a moving object or, where none has its id, a detected vehicle; they share their
    ids. From then on the tracker is independent: it may keep what the pipeline loses, and lose what the
    pipeline keeps.
    """

    def __init__(
        self, track_id: int, tracker: SingleObjectTracker, ego_vehicle: EgoVehicle
    ) -> None:
        """Wait for the object.

        Args:
            track_id: Id of a track or a vehicle of the pipeline.
            tracker: Tracker that takes the object over.
            ego_vehicle: Outline of the vehicle itself.
        """
        if track_id < 0:
            raise UsageError("track id", expected="an id of 0 or more", found=str(track_id))
        self.track_id, self._tracker, self._ego_vehicle = track_id, tracker, ego_vehicle
        self.has_started = False

    def update(self, result: Result) -> TrackedObject | None:
        """Track the object into the next frame; None before the first frame that has it.

        Raises:
            PerceptionError: The tracker lacks a required input, as a camera.
        """
        tracker_input = tracker_input_of(result, self._ego_vehicle)
        if self.has_started:
            return self._tracker.update(tracker_input)
        box = self._box(result)
        if not len(box):
            return None
        try:
            tracked = self._tracker.init(tracker_input, box)
        except PerceptionError:
            if result.frame.calibration is None or tracker_input.box_px(box) is not None:
                raise
            return None  # a tracker of images waits until the camera has the object in view
        self.has_started = True
        return tracked

    def _box(self, result: Result) -> Boxes3D:
        """Return the box of the object, or none."""
        boxes = result.tracks.boxes[result.tracks.ids == self.track_id]
        if len(boxes) or result.vehicles is None:
            return boxes
        vehicles = result.vehicles
        is_located = np.isfinite(vehicles.boxes.bottom_m).all(axis=1)
        return vehicles.boxes[is_located & (vehicles.ids == self.track_id)]
