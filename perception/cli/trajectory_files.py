"""The files in which one followed object is told, whole after every frame.

NAME.jsonl  one line a frame: state, speed, size, place and heading in the LiDAR frame and in the world, and
            the rectangle in the image; null where the tracker gives none
NAME.txt    result rows of KITTI's tracking benchmark: what the camera sees, while it is not lost; only
            where it is asked for and there is a camera whose image size is known
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from data.kitti.track_results import to_tracking_rows
from data.kitti.tracking_rows import TrackingRows, format_result_rows
from perception.cli.track_files import track_line
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.types import Calibration, Result, Tracks

# What a result row says of a place that is not known.
_NO_ANGLE_RAD, _NO_POSITION_M, _UNKNOWN = -10.0, -1000.0, -1.0


class TrajectoryFile:
    """Writes a line of JSON a frame."""

    def __init__(self, path: Path) -> None:
        """Open the file, making its folder."""
        path.parent.mkdir(parents=True, exist_ok=True)
        self._lines: TextIO = path.open("w", buffering=1)

    def close(self) -> None:
        """Close it."""
        self._lines.close()

    def write(self, result: Result, tracked: TrackedObject) -> None:
        """Write one frame."""
        self._lines.write(json.dumps(trajectory_line(result, tracked)) + "\n")


class TrajectoryRows:
    """Writes KITTI's result rows."""

    def __init__(
        self, path: Path, calibration: Calibration | None, object_id: int, kind: str | None
    ) -> None:
        """Open the file; it is not made without a camera.

        Args:
            path: of the file.
            calibration: of the camera.
            object_id: in every row.
            kind: KITTI's type; None to tell it from the box' size.
        """
        self._camera, self._object_id, self._kind = calibration, object_id, kind
        self._rows: TextIO | None = None
        path.unlink(missing_ok=True)
        if calibration is not None and calibration.image_size_px is not None:
            self._rows = path.open("w", buffering=1)

    def close(self) -> None:
        """Close it."""
        if self._rows is not None:
            self._rows.close()

    def write(self, result: Result, tracked: TrackedObject) -> None:
        """Write the row of one frame, or none where the image does not show the object."""
        camera = self._camera
        if self._rows is None or camera is None or camera.image_size_px is None:
            return
        if tracked.state is TrackStatus.LOST:
            return
        tracks = as_tracks(tracked, self._object_id)
        rows = to_tracking_rows(result.frame.index, tracks, camera, camera.image_size_px)
        if tracked.box_velo is None and tracked.box_px is not None:
            rows = _image_row(result.frame.index, tracked, self._object_id)
        if self._kind is not None:
            rows = replace(rows, types=np.full(len(rows.frames), self._kind))
        self._rows.write(format_result_rows(rows))


def trajectory_line(result: Result, tracked: TrackedObject) -> dict[str, Any]:
    """Return what one line says; positions are the middle of the box' bottom."""
    line = track_line(replace(result, tracks=as_tracks(tracked, 0)))
    reported = line["tracks"][0] if line["tracks"] else dict.fromkeys(_REPORTED_FIELDS)
    box_px = tracked.box_px
    return {
        "frame": line["frame"],
        "stamp_s": line["stamp_s"],
        "state": str(tracked.state),
        **{name: reported[name] for name in _REPORTED_FIELDS},
        "box_px": None if box_px is None else [round(float(x), 2) for x in box_px],
    }


_REPORTED_FIELDS = ("size_m", "speed_m_s", "velo", "world")


def as_tracks(tracked: TrackedObject, object_id: int) -> Tracks:
    """Return the object as the only track of a frame; none without a box in space."""
    if tracked.box_velo is None:
        return Tracks.empty()
    return Tracks(
        ids=np.array([object_id]),
        boxes=tracked.box_velo,
        velocities_m_s=tracked.velocity_m_s[None],
        is_observed=np.array([tracked.state is TrackStatus.SEEN]),
    )


def _image_row(frame: int, tracked: TrackedObject, object_id: int) -> TrackingRows:
    """Return the row of an object of which only its rectangle in the image is known."""
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
