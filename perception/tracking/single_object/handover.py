"""From tracks of many objects to a tracker of one: what the thesis suggests for its DATMO system (5.3)."""

import numpy as np

from perception.errors import UsageError
from perception.geometry.grids import EgoVehicle
from perception.tracking.single_object.tracker import (
    SingleObjectTracker,
    TrackedObject,
    TrackerInput,
)
from perception.types import Boxes3D, Result


def tracker_input_of(result: Result, body: EgoVehicle) -> TrackerInput:
    """Return what a tracker of one object is shown of a frame that the pipeline has seen.

    Args:
        result: pose and ground of the frame.
        body: the vehicle's own outline, whose returns are left out.
    """
    frame = result.frame
    return TrackerInput(
        stamp_s=frame.stamp_s,
        points_velo=frame.points_velo[~body.contains_xy(frame.points_velo)],
        world_SE3_velo=result.world_SE3_velo,
        ground=result.ground,
        image=frame.image,
        image_P_velo=None if frame.calibration is None else frame.calibration.image_P_velo,
    )


class TrackHandover:
    """Gives one object of the pipeline to a tracker of one object, in the first frame that has it.

    It is a track of what moves or, where none has its id, a detected vehicle: they share the count of ids.

    From there on the tracker is on its own: it may keep what the pipeline loses, and lose what the
    pipeline keeps.
    """

    def __init__(self, track_id: int, tracker: SingleObjectTracker, body: EgoVehicle) -> None:
        """Wait for an object.

        Args:
            track_id: of a track or a vehicle of the pipeline.
            tracker: that takes it over.
            body: the vehicle's own outline.
        """
        if track_id < 0:
            raise UsageError("track to follow", expected="an id of 0 or more", found=str(track_id))
        self.track_id, self._tracker, self._body = track_id, tracker, body
        self.has_started = False

    def update(self, result: Result) -> TrackedObject | None:
        """Follow the object on; None as long as the pipeline has not given its track."""
        if self.has_started:
            return self._tracker.update(tracker_input_of(result, self._body))
        box = self._box(result)
        if not len(box):
            return None
        self.has_started = True
        return self._tracker.start(tracker_input_of(result, self._body), box)

    def _box(self, result: Result) -> Boxes3D:
        """Return the box of the object, or none."""
        boxes = result.tracks.boxes[result.tracks.ids == self.track_id]
        if len(boxes) or result.vehicles is None:
            return boxes
        vehicles = result.vehicles
        is_located = np.isfinite(vehicles.boxes.bottom_m).all(axis=1)
        return vehicles.boxes[is_located & (vehicles.ids == self.track_id)]
