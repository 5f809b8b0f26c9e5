"""The two files in which a run tells its tracks, whole after every frame.

tracks/NAME.txt  result rows of KITTI's tracking benchmark, for the tracks that the camera sees
tracks.jsonl     one line a frame, for all of them

NAME is the drive's, as of sequence 0000, so that `trifuse evaluate tracks` takes the folder as it is.
"""

import json
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from data.kitti.track_results import to_tracking_rows
from data.kitti.tracking_rows import format_result_rows
from perception.geometry.angles import wrap
from perception.geometry.boxes import transform_boxes
from perception.types import Calibration, Float64, Result


class TrackFiles:
    """Writes the tracks of one run, frame by frame."""

    def __init__(self, out: Path, name: str, calibration: Calibration | None) -> None:
        """Open the files; the rows only where there is a camera whose image size is known."""
        self._calibration = calibration
        self._lines: TextIO = (out / "tracks.jsonl").open("w", buffering=1)
        self._rows: TextIO | None = None
        rows = out / "tracks" / f"{name}.txt"
        rows.unlink(missing_ok=True)
        if calibration is not None and calibration.image_size_px is not None:
            rows.parent.mkdir(exist_ok=True)
            self._rows = rows.open("w")

    def close(self) -> None:
        """Close both."""
        self._lines.close()
        if self._rows is not None:
            self._rows.close()

    def write(self, result: Result) -> None:
        """Write the tracks of one frame."""
        self._lines.write(json.dumps(track_line(result)) + "\n")
        camera = self._calibration
        if self._rows is None or camera is None or camera.image_size_px is None:
            return
        rows = to_tracking_rows(result.frame.index, result.tracks, camera, camera.image_size_px)
        # All rows of a frame, or none.
        self._rows.write(format_result_rows(rows))
        self._rows.flush()


def track_line(result: Result) -> dict[str, Any]:
    """Return what one line of tracks.jsonl holds.

    `velo` is the LiDAR frame of the scan, `world` the one of poses.txt; positions are the middle of the
    box' bottom, sizes are length, width and height.
    """
    tracks = result.tracks
    boxes_world = transform_boxes(result.world_SE3_velo, tracks.boxes)
    velocities_world = tracks.velocities_m_s @ result.world_SE3_velo[:3, :2].T
    return {
        "frame": result.frame.index,
        "stamp_s": round(result.frame.stamp_s, 6),
        "tracks": [
            {
                "id": int(tracks.ids[row]),
                "is_observed": bool(tracks.is_observed[row]),
                "size_m": _rounded(tracks.boxes.size_m[row]),
                "speed_m_s": round(float(np.linalg.norm(tracks.velocities_m_s[row])), 4),
                "velo": {
                    "position_m": _rounded(tracks.boxes.bottom_m[row]),
                    "yaw_rad": _angle(tracks.boxes.yaw_rad[row]),
                },
                "world": {
                    "position_m": _rounded(boxes_world.bottom_m[row]),
                    "yaw_rad": _angle(boxes_world.yaw_rad[row]),
                    "velocity_m_s": _rounded(velocities_world[row]),
                },
            }
            for row in range(len(tracks))
        ],
    }


def _rounded(numbers: Float64) -> list[float]:
    return [round(float(number), 4) for number in numbers]


def _angle(angle_rad: float) -> float:
    """Return an angle from -pi to pi."""
    return round(float(wrap(angle_rad)), 6)
