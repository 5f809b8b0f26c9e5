"""Trajectory of one tracked object: `trajectory.jsonl` and KITTI's tracking rows.

trajectory.jsonl  one `TrajectoryRecord` a line
trajectory.txt    result rows of KITTI's tracking benchmark (18 columns) while the object is in the image and not lost
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np

from data.kitti.tracking_rows import TrackingRows
from data.results.records import RecordWriter, read_records
from data.results.tracks import (
    FrameTracks,
    RowWriter,
    VeloPlace,
    WorldPlace,
    has_camera,
    to_tracking_rows,
)
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.types import Calibration, Result, Tracks

# Values of KITTI's columns that are not known.
_NO_ANGLE_RAD, _NO_POSITION_M, _UNKNOWN = -10.0, -1000.0, -1.0


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
        if not line.tracks:
            return cls(line.frame, line.stamp_s, str(tracked.state), None, None, None, None, box_px)
        (track,) = line.tracks
        return cls(
            frame=line.frame,
            stamp_s=line.stamp_s,
            state=str(tracked.state),
            size_m=track.size_m,
            speed_m_s=track.speed_m_s,
            velo=track.velo,
            world=track.world,
            box_px=box_px,
        )


def read_trajectory(path: Path) -> list[TrajectoryRecord]:
    """Read `trajectory.jsonl`.

    Raises:
        LabelError: the file or one of its lines cannot be read.
    """
    return read_records(path, TrajectoryRecord)


class TrajectoryRows:
    """Writes KITTI's tracking rows of one object."""

    def __init__(
        self, path: Path, calibration: Calibration | None, object_id: int, kind: str | None
    ) -> None:
        """Open the file; it is not made without a camera.

        Args:
            path: File to write.
            calibration: Camera calibration, or None.
            object_id: Track id of every row.
            kind: KITTI type of every row; None to classify by the size of the box.
        """
        self._camera, self._object_id, self._kind = calibration, object_id, kind
        self._rows = RowWriter(path, has_camera(calibration))

    def close(self) -> None:
        """Close the file."""
        self._rows.close()

    def write(self, result: Result, tracked: TrackedObject) -> None:
        """Write the row of one frame, or none where the object is lost or not in the image."""
        camera = self._camera
        if camera is None or camera.image_size_px is None or tracked.state is TrackStatus.LOST:
            return
        frame = result.frame.index
        rows = to_tracking_rows(
            frame, as_tracks(tracked, self._object_id), camera, camera.image_size_px
        )
        if tracked.box_velo is None and tracked.box_px is not None:
            rows = _image_row(frame, tracked, self._object_id)
        if self._kind is not None:
            rows = replace(rows, types=np.full(len(rows.frames), self._kind))
        self._rows.write(rows)


def as_tracks(tracked: TrackedObject, object_id: int) -> Tracks:
    """Return the object as the only track of a frame; none without a 3D box."""
    if tracked.box_velo is None:
        return Tracks.empty()
    return Tracks(
        ids=np.array([object_id]),
        boxes=tracked.box_velo,
        velocities_m_s=tracked.velocity_m_s[None],
        is_observed=np.array([tracked.state is TrackStatus.SEEN]),
    )


def trajectory_writer(folder: Path) -> RecordWriter:
    """Open `trajectory.jsonl` in a folder of results."""
    return RecordWriter(folder / "trajectory.jsonl")


def _image_row(frame: int, tracked: TrackedObject, object_id: int) -> TrackingRows:
    """Return the row of an object of which only the rectangle in the image is known."""
    unknown = np.full(1, _UNKNOWN)
    assert tracked.box_px is not None
    return TrackingRows(
        frames=np.array([frame]),
        ids=np.array([object_id]),
        types=np.array(["Misc"]),
        truncation=unknown,
        occlusion=unknown,
        alphas_rad=np.full(1, _NO_ANGLE_RAD),
        boxes_px=tracked.box_px[None],
        sizes_hwl_m=np.full((1, 3), _UNKNOWN),
        bottoms_cam_m=np.full((1, 3), _NO_POSITION_M),
        headings_rad=np.full(1, _NO_ANGLE_RAD),
        scores=np.full(1, 1.0 if tracked.state is TrackStatus.SEEN else 0.5),
    )
