"""Edges of a drive's frames for its calibration, and the file of a calibration in the drive's own format."""

from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import yaml

from data.folder.config import FILE_NAME
from data.folder.drive import FolderDrive
from data.kitti.calibration import (
    CAM_TO_CAM,
    VELO_TO_CAM,
    CalibrationText,
    DriveCalibration,
    format_benchmark_calibration,
)
from data.recorded_drive import RecordedDrive
from data.sweep_motion import SweepMotions
from perception.calibration.frame_edges import FrameEdges
from perception.calibration.observed_corners import USUAL_TRAVEL_M, ObservedCorners
from perception.calibration.recalibration import Recalibration
from perception.calibration.surface_corners import CornerTracks, SweepVelocity
from perception.errors import CalibrationError
from perception.evaluation.report import Column, Table
from perception.geometry.se3 import from_rotation_translation, inverse
from perception.localization.frame_registration import FrameRegistration
from perception.types import Calibration, Float64, Frame, Progress, UInt8
from perception.yaml_text import read_yaml

_NEW_FILE = "calib.txt"
_LATER_FRAMES, _MAX_LATER_S = 3, 1.0  # within which a vehicle comes nearer
_VELO_TO_CAM_KEYS = ("Tr_velo_to_cam", "Tr_velo_cam", "Tr")
_RECTIFICATION_KEYS = ("R0_rect", "R_rect")


@dataclass(frozen=True)
class CalibratedFrames:
    """Edges of the frames of a drive that have one calibration.

    Attributes:
        calibration: Calibration of the frames.
        edges: Edges of each frame.
        tracks: Corners of those frames of a drive from which the vehicle moves on, tracked into the next ones.
        image: (H, W, 3) image of the frame in the middle, as an example.
        left_out: Number of frames of another calibration, which are not used.
    """

    calibration: Calibration
    edges: tuple[FrameEdges, ...]
    tracks: tuple[CornerTracks, ...]
    image: UInt8
    left_out: int

    @property
    def example(self) -> FrameEdges:
        """Edges of the frame in the middle."""
        return self.edges[len(self.edges) // 2]


def read_calibrated_frames(
    drive: RecordedDrive, count: int, progress: Progress
) -> CalibratedFrames:
    """Read frames that are spread evenly over a drive; of several calibrations, those of the most common one.

    Args:
        drive: Drive with a camera.
        count: Number of frames at most.
        progress: Shows progress over the frames.

    Raises:
        PerceptionError: A frame cannot be read, or has no image or no calibration.
    """
    spread = np.linspace(0, len(drive) - 1, min(count, len(drive))).round().astype(int)
    calibrations = {index: drive.frame_calibration(index) for index in map(int, spread)}
    keys = {index: _key(calibration) for index, calibration in calibrations.items()}
    common, used = Counter(keys.values()).most_common(1)[0]
    indices = [index for index in calibrations if keys[index] == common]
    motions, half_s = SweepMotions(), 0.5 / drive.sensor.rate_hz
    edges, tracks, example = [], [], None
    for index in progress(indices):
        frame = drive[index]
        motion = None
        if drive.is_sequence and not drive.deskew:
            motion = motions.motion(drive, index, (-half_s, half_s))
        edges.append(FrameEdges.of(frame, drive.sensor, motion))
        if drive.is_sequence:
            tracks += _tracked_corners(drive, index, frame)
        if index == indices[len(indices) // 2]:
            example = frame
    assert example is not None  # drives have frames
    assert example.calibration is not None  # or its edges are refused
    assert example.image is not None
    return CalibratedFrames(
        example.calibration,
        tuple(edges),
        tuple(tracks),
        example.image,
        len(calibrations) - used,
    )


def _tracked_corners(drive: RecordedDrive, index: int, frame: Frame) -> list[CornerTracks]:
    """Return the corners of a frame in one of the next, once the vehicle has come nearer; none where it does not."""
    registration = FrameRegistration()
    start, observed = registration.update(frame), None
    for number in range(index + 1, min(index + 1 + _LATER_FRAMES, len(drive))):
        later = drive[number]
        gap_s = later.stamp_s - frame.stamp_s
        if later.image is None or later.calibration is None or not 0 < gap_s <= _MAX_LATER_S:
            break
        pose = registration.update(later)
        if observed is None:
            sweep = SweepVelocity.between(inverse(start) @ pose, gap_s, 1 / drive.sensor.rate_hz)
            observed = ObservedCorners.of(frame, start, sweep, np.eye(4))
        if observed.travelled_m(pose) >= USUAL_TRAVEL_M:
            tracks = observed.tracked(later, pose)
            return [] if tracks is None else [tracks]
    return []


def _key(calibration: Calibration | None) -> bytes:
    if calibration is None:
        return b""
    return calibration.image_P_cam.tobytes() + calibration.cam_SE3_velo.tobytes()


def write_calibration(
    folder: Path, drive: RecordedDrive, calibration: Calibration, cam_SE3_velo: Float64
) -> tuple[Path, Path | None]:
    """Write another pose of the LiDAR into a copy of the drive's calibration file.

    Args:
        folder: Folder for the copy; the drive's own file stays as it is.
        drive: Drive of the calibration.
        calibration: Calibration that the drive has.
        cam_SE3_velo: (4, 4) transform from the LiDAR to the rectified camera.

    Returns:
        The copy, and the file of the drive that it can replace: None where its layout has none, and the copy is a file in
        the format of KITTI's benchmarks.

    Raises:
        CalibrationError: The drive's calibration file cannot be read any more.
    """
    own = Path(calibration.source)
    if own.name == CAM_TO_CAM:
        rectification = CalibrationText.read(own).matrix(("R_rect_00",), (3, 3))
        own = own.with_name(VELO_TO_CAM)
        cam0_SE3_velo = _unrectified(cam_SE3_velo, rectification)
        rows = {"R": cam0_SE3_velo[:3, :3], "T": cam0_SE3_velo[:3, 3]}
        text = _with_rows(own, rows)
    elif own.name == FILE_NAME and isinstance(drive, FolderDrive):
        text = _with_extrinsics(own, cam_SE3_velo @ drive.velo_SE3_lidar)
    elif own.suffix == ".txt" and own.is_file():
        stated = CalibrationText.read(own)
        has_rectification = stated.has(_RECTIFICATION_KEYS)
        rectification = (
            stated.matrix(_RECTIFICATION_KEYS, (3, 3)) if has_rectification else np.eye(3)
        )
        key = next(key for key in _VELO_TO_CAM_KEYS if stated.has((key,)))
        text = _with_rows(own, {key: _unrectified(cam_SE3_velo, rectification)[:3]})
    else:
        camera = replace(calibration, cam_SE3_velo=cam_SE3_velo)
        path = folder / _NEW_FILE
        path.write_text(format_benchmark_calibration(DriveCalibration(camera, None)))
        return path, None
    path = folder / own.name
    path.write_text(text)
    return path, own


def _unrectified(cam_SE3_velo: Float64, rectification: Float64) -> Float64:
    return inverse(from_rotation_translation(rectification, np.zeros(3))) @ cam_SE3_velo


def _with_rows(path: Path, rows: dict[str, Float64]) -> str:
    """Return the text of a KITTI calibration file with other numbers of some keys."""
    lines = []
    for line in path.read_text().splitlines():
        word = line.split(maxsplit=1)[0] if line.strip() else ""
        values = rows.get(word.rstrip(":"))
        numbers = "" if values is None else " ".join(f"{value:.12e}" for value in values.ravel())
        lines.append(line if values is None else f"{word} {numbers}")
    return "\n".join(lines) + "\n"


def _with_extrinsics(path: Path, cam_SE3_lidar: Float64) -> str:
    """Return the text of a drive.yaml with another transform from the LiDAR to the camera; comments are lost."""
    document = read_yaml(path.read_text())
    if not isinstance(document, dict) or not isinstance(document.get("camera"), dict):
        raise CalibrationError(path, expected="a section camera", found="none")
    document["camera"]["lidar_to_camera"] = {"matrix": cam_SE3_lidar[:3].tolist()}
    text: str = yaml.safe_dump(document, sort_keys=False, default_flow_style=None)
    return text


def recalibration_table(
    title: str, found: Recalibration, left_out: int
) -> Table[tuple[float, float]]:
    """Return the change of the calibration along each axis, and how sure it is."""
    scale = np.array([np.degrees(1)] * 3 + [100] * 3)
    values = np.column_stack([found.offset, found.deviations]) * scale[:, None]
    names = (
        "pitch, about the axis to the right [deg]", "yaw, about the axis down [deg]",
        "roll, about the optical axis [deg]", "to the right [cm]", "down [cm]", "ahead [cm]",
    )  # fmt: skip
    columns = (
        Column[tuple[float, float]]("change", lambda row: row[0], "+.2f"),
        Column[tuple[float, float]]("standard deviation", lambda row: row[1], ".2f"),
    )
    notes = [
        f"{found.edges} edges in {found.frames} frames; score {found.given_score:.3f} as stated, {found.score:.3f} as found",
        *([f"{left_out} frames of another calibration are left out"] if left_out else []),
    ]
    rows = {name: (float(row[0]), float(row[1])) for name, row in zip(names, values, strict=True)}
    return Table(
        f"{title}: calibration of LiDAR and camera",
        columns,
        rows,
        "LiDAR in the camera's frame",
        notes,
    )
