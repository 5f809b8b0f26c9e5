"""Trajectory of one tracked object: `trajectory.jsonl` and KITTI's tracking rows.

trajectory.jsonl  one `TrajectoryRecord` a line
trajectory.txt    result rows of KITTI's tracking benchmark (18 columns) while the object is in the image and not lost
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from data.kitti.tracking_rows import TrackingRows
from data.results.tracks import (
    OBSERVED_SCORE,
    PREDICTED_SCORE,
    FrameTracks,
    VeloPlace,
    WorldPlace,
    kitti_rows,
    to_tracking_rows,
)
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.types import Boxes3D, Calibration, Detections, Result, Tracks

_UNKNOWN_BOX = Boxes3D(np.full((1, 3), np.nan), np.full((1, 3), np.nan), np.full(1, np.nan))


@dataclass(frozen=True)
class TrajectoryRecord:
    """One line of `trajectory.jsonl`; null where the tracker does not estimate a value.

    Attributes:
        frame: Index of the frame.
        stamp_s: Time of the scan.
        state: `seen`, `predicted` or `lost`.
        size_m: Length, width and height.
        speed_m_s: Speed over the ground.
        velo: Place in the LiDAR frame.
        world: Place in the world frame.
        box_px: Rectangle x1 y1 x2 y2 in the image.
    """

    frame: int
    stamp_s: float
    state: str
    size_m: list[float] | None
    speed_m_s: float | None
    velo: VeloPlace | None
    world: WorldPlace | None
    box_px: list[float] | None

    @classmethod
    def of(cls, result: Result, tracked: TrackedObject) -> Self:
        """Return the object in one frame."""
        line = FrameTracks.of(replace(result, tracks=as_tracks(tracked, 0)))
        box_px = None if tracked.box_px is None else [round(float(x), 2) for x in tracked.box_px]
        track = line.tracks[0] if line.tracks else None
        return cls(
            frame=line.frame,
            stamp_s=line.stamp_s,
            state=str(tracked.status),
            size_m=None if track is None else track.size_m,
            speed_m_s=None if track is None else track.speed_m_s,
            velo=None if track is None else track.velo,
            world=None if track is None else track.world,
            box_px=box_px,
        )


def trajectory_rows(
    result: Result,
    tracked: TrackedObject,
    object_id: int,
    kind: str | None,
    calibration: Calibration | None,
) -> TrackingRows | None:
    """Return the row of one frame, or none where the object is lost or not in the image.

    Args:
        result: Result of the frame.
        tracked: Object in the frame.
        object_id: Track id of the row.
        kind: KITTI type of the row; None to classify by the size of the box.
        calibration: Camera calibration; without the size of the image there are no rows.
    """
    frame, tracks = result.frame.index, as_tracks(tracked, object_id)
    if calibration is None or calibration.image_size_px is None:
        return None
    rows = to_tracking_rows(frame, tracks, calibration, calibration.image_size_px)
    if tracked.box_velo is None and tracked.box_px is not None:
        # Only the rectangle in the image is known.
        is_seen = np.array([tracked.status is TrackStatus.SEEN])
        scores = np.where(is_seen, OBSERVED_SCORE, PREDICTED_SCORE)
        detections = Detections(tracked.box_px[None], scores, np.array(["Misc"]))
        rows = kitti_rows(frame, np.array([object_id]), _UNKNOWN_BOX, detections, calibration)
    if tracked.status is TrackStatus.LOST:
        rows = rows[:0]
    return rows if kind is None else replace(rows, types=np.full(len(rows), kind))


def as_tracks(tracked: TrackedObject, object_id: int) -> Tracks:
    """Return the object as the only track of a frame; none without a 3D box."""
    if tracked.box_velo is None:
        return Tracks.empty()
    return Tracks.unclassified(
        np.array([object_id]),
        tracked.box_velo,
        tracked.velocity_m_s[None],
        np.array([tracked.status is TrackStatus.SEEN]),
    )
