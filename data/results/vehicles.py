"""Detected vehicles of a run: `vehicles.jsonl`, and rows of KITTI's object and tracking benchmarks.

    vehicles.jsonl     one `FrameVehicles` a line
    data/NNNNNN.txt    result rows of KITTI's object benchmark (16 columns), named as the frame; empty without a detection
    vehicles/NAME.txt  result rows of KITTI's tracking benchmark (18 columns), for the vehicles that are tracked

None of these files is written where no detector runs.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from data.frames import file_number
from data.kitti.tracking_rows import TrackingRows, format_result_rows
from data.results.records import LineFiles
from data.results.tracks import kitti_rows
from perception.atomic_file import write_atomically
from perception.geometry.se3 import wrap
from perception.types import MODALITIES, Calibration, Drive, Float64, Result, Vehicles

Number = float | None


@dataclass(frozen=True)
class VehiclePlace:
    """Box of a vehicle in the LiDAR frame of the scan; null where the LiDAR does not locate it.

    Attributes:
        position_m: Centre of the bottom face x, y, z.
        size_m: Length, width and height.
        yaw_rad: Heading from -pi to pi.
    """

    position_m: list[Number]
    size_m: list[Number]
    yaw_rad: Number


@dataclass(frozen=True)
class VehicleRecord:
    """One detected vehicle in one frame; null where a value is not known.

    Attributes:
        id: Track id; null before the vehicle is tracked.
        type: KITTI type.
        score: Fused score.
        box_px: Rectangle x1 y1 x2 y2 in the image.
        dominant_modality: Modality of the detector with the largest weight in the fused score.
        scores: Score of each detector by modality; null where it has no detection.
        points: Number of LiDAR points on the vehicle.
        distance_m: Distance from the LiDAR to the nearest return.
        velocity_m_s: Velocity over the ground along x and y of the LiDAR frame.
        velo: Box in the LiDAR frame.
    """

    id: int | None
    type: str
    score: Number
    box_px: list[Number]
    dominant_modality: str
    scores: dict[str, Number]
    points: int
    distance_m: Number
    velocity_m_s: list[Number]
    velo: VehiclePlace


@dataclass(frozen=True)
class FrameVehicles:
    """One line of `vehicles.jsonl`.

    Attributes:
        frame: Index of the frame.
        stamp_s: Time of the scan.
        vehicles: Detected vehicles of the frame.
    """

    frame: int
    stamp_s: float
    vehicles: list[VehicleRecord]

    @classmethod
    def of(cls, result: Result, vehicles: Vehicles) -> Self:
        """Return the vehicles of one result."""
        points = vehicles.point_counts.tolist()
        records = [_record(result, vehicles, row, points[row]) for row in range(len(vehicles))]
        return cls(result.frame.index, round(result.frame.stamp_s, 6), records)


def append_vehicles(files: LineFiles, out: Path, drive: Drive, result: Result) -> None:
    """Append the vehicles of one frame, if a detector ran on it.

    Args:
        files: Files of the results.
        out: Folder of the results.
        drive: Drive of the run.
        result: Result of the frame.
    """
    vehicles, calibration = result.vehicles, result.frame.calibration
    if vehicles is None or calibration is None:
        return
    frame = result.frame.index
    file = out / "data" / f"{file_number(drive, frame):06d}.txt"
    write_atomically(file, format_object_rows(vehicles, calibration).encode())
    files.append_record("vehicles.jsonl", FrameVehicles.of(result, vehicles))
    if drive.is_sequence:
        rows = to_vehicle_rows(frame, vehicles, calibration)
        files.append(f"vehicles/{drive.name}.txt", format_result_rows(rows))


def to_vehicle_rows(
    frame: int, vehicles: Vehicles, calibration: Calibration, min_score: float = 0.0
) -> TrackingRows:
    """Return a row for each vehicle that has an id; without a 3D box, only the rectangle is known.

    Args:
        frame: Index of the frame.
        vehicles: Vehicles of the frame.
        calibration: Camera calibration.
        min_score: Lowest score of a row.
    """
    detections = vehicles.fused.detections
    rows = kitti_rows(frame, vehicles.ids, vehicles.boxes, detections, calibration)
    return rows[(rows.ids >= 0) & (rows.scores >= min_score)]


def format_object_rows(vehicles: Vehicles, calibration: Calibration) -> str:
    """Return the rows of one frame for the object benchmark, 16 columns each.

    Every vehicle has a row, tracked or not: average precision needs the whole range of scores.
    """
    # The columns of the tracking benchmark without frame and id.
    detections = vehicles.fused.detections
    rows = kitti_rows(0, vehicles.ids, vehicles.boxes, detections, calibration)
    lines = format_result_rows(rows).splitlines()
    return "".join(f"{line.split(' ', 2)[2]}\n" for line in lines)


def _record(result: Result, vehicles: Vehicles, row: int, points: int) -> VehicleRecord:
    fused, track = vehicles.fused, int(vehicles.ids[row])
    sources = zip(MODALITIES, fused.source_indices[row].tolist(), strict=True)
    return VehicleRecord(
        id=track if track >= 0 else None,
        type=str(fused.detections.types[row]),
        score=_rounded(fused.detections.scores[row]),
        box_px=_numbers(fused.detections.boxes_px[row]),
        dominant_modality=MODALITIES[int(fused.dominant_modality[row])],
        scores={
            modality: _rounded(result.modality_detections[modality].scores[index])
            if index >= 0
            else None
            for modality, index in sources
        },
        points=points,
        distance_m=_rounded(vehicles.distances_m[row]),
        velocity_m_s=_numbers(vehicles.velocities_m_s[row]),
        velo=VehiclePlace(
            position_m=_numbers(vehicles.boxes.bottom_m[row]),
            size_m=_numbers(vehicles.boxes.size_m[row]),
            yaw_rad=_rounded(float(wrap(vehicles.boxes.yaw_rad[row]))),
        ),
    )


def _numbers(values: Float64) -> list[Number]:
    return [_rounded(value) for value in values.tolist()]


def _rounded(value: float) -> Number:
    return round(float(value), 4) if math.isfinite(value) else None
