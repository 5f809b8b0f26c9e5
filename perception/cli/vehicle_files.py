"""The files in which a run tells the vehicles that it detected, whole after every frame.

data/NNNNNN.txt    result rows of KITTI's object benchmark, named as the frame; empty where nothing is found
vehicles/NAME.txt  result rows of KITTI's tracking benchmark, of the vehicles that are followed
vehicles.jsonl     one line a frame, for all of them

NAME is the drive's. Where no detector looks at a drive, there is none of these files.
"""

import json
import math
from pathlib import Path
from typing import Any, TextIO

from data.atomic_file import write_atomically
from data.frames import file_number
from data.kitti.tracking_rows import format_result_rows
from data.kitti.vehicle_results import format_object_rows, to_vehicle_rows
from perception.geometry.angles import wrap
from perception.types import MODALITIES, Drive, Float64, Result, Vehicles


class VehicleFiles:
    """Writes the vehicles of one run, frame by frame."""

    def __init__(self, out: Path, drive: Drive) -> None:
        """Begin without a file.

        Args:
            out: folder of the results.
            drive: whose vehicles these are.
        """
        self._out, self._drive = out, drive
        self._lines: TextIO | None = None
        self._rows: TextIO | None = None

    def close(self) -> None:
        """Close what was opened."""
        for file in (self._lines, self._rows):
            if file is not None:
                file.close()

    def write(self, result: Result) -> None:
        """Write the vehicles of one frame, if a detector looked at it."""
        vehicles, calibration = result.vehicles, result.frame.calibration
        if vehicles is None or calibration is None:
            return
        number = file_number(self._drive, result.frame.index)
        rows = format_object_rows(vehicles, calibration)
        write_atomically(self._out / "data" / f"{number:06d}.txt", rows.encode())
        if self._lines is None:
            self._lines = (self._out / "vehicles.jsonl").open("w", buffering=1)
        self._lines.write(json.dumps(vehicle_line(result, vehicles)) + "\n")
        if self._drive.is_sequence:
            tracked = to_vehicle_rows(result.frame.index, vehicles, calibration)
            self._write_tracks(format_result_rows(tracked))

    def _write_tracks(self, rows: str) -> None:
        if self._rows is None:
            path = self._out / "vehicles" / f"{self._drive.name}.txt"
            path.parent.mkdir(exist_ok=True)
            self._rows = path.open("w")
        # All rows of a frame, or none.
        self._rows.write(rows)
        self._rows.flush()


def vehicle_line(result: Result, vehicles: Vehicles) -> dict[str, Any]:
    """Return what one line of vehicles.jsonl holds; null is what is not known.

    `velo` is the LiDAR frame of the scan; its position is the middle of the box' bottom, its size length,
    width and height. `scores` are those of each detector, `carrier` is the one that said most.
    """
    points = vehicles.point_counts.tolist()
    return {
        "frame": result.frame.index,
        "stamp_s": round(result.frame.stamp_s, 6),
        "vehicles": [_vehicle(result, vehicles, row, points[row]) for row in range(len(vehicles))],
    }


def _vehicle(result: Result, vehicles: Vehicles, row: int, points: int) -> dict[str, Any]:
    fused, track = vehicles.fused, int(vehicles.ids[row])
    return {
        "id": track if track >= 0 else None,
        "type": str(fused.detections.types[row]),
        "score": _rounded(fused.detections.scores[row]),
        "box_px": _numbers(fused.detections.boxes_px[row]),
        "carrier": MODALITIES[int(fused.dominant_modality[row])],
        "scores": {
            modality: _rounded(result.modality_detections[modality].scores[part])
            if part >= 0
            else None
            for modality, part in zip(MODALITIES, fused.source_indices[row].tolist(), strict=True)
        },
        "points": points,
        "distance_m": _rounded(vehicles.distances_m[row]),
        "velocity_m_s": _numbers(vehicles.velocities_m_s[row]),
        "velo": {
            "position_m": _numbers(vehicles.boxes.bottom_m[row]),
            "size_m": _numbers(vehicles.boxes.size_m[row]),
            "yaw_rad": _rounded(float(wrap(vehicles.boxes.yaw_rad[row]))),
        },
    }


def _numbers(values: Float64) -> list[float | None]:
    return [_rounded(value) for value in values.tolist()]


def _rounded(value: float) -> float | None:
    return round(float(value), 4) if math.isfinite(value) else None
