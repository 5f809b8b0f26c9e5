"""KITTI's raw recordings: one folder a drive, its calibration in the folder of the date.

2011_09_26/calib_cam_to_cam.txt  calib_velo_to_cam.txt  calib_imu_to_velo.txt
2011_09_26/2011_09_26_drive_0005_sync/
    velodyne_points/data/0000000000.bin   velodyne_points/timestamps.txt
    image_02/data/0000000000.png          oxts/data/0000000000.txt
    label_02.txt  labels/0000000000.label  sensor.json    (synthetic drives)
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from data.kitti.calibration import CAM_TO_CAM, IMU_TO_VELO, VELO_TO_CAM, read_raw_calibration
from data.kitti.oxts import InsPacket, parse_oxts_packet
from data.kitti.sensor_files import (
    IMAGE_SUFFIXES,
    POINT_LABEL_SUFFIXES,
    SCAN_SUFFIXES,
    SKIP_ADVICE,
    NumberedFiles,
)
from data.kitti.sequence import CameraFiles, Clock, FixedRateClock, KittiSequence
from perception.errors import DriveError, PoseError
from perception.sensor import LidarModel
from perception.types import Float64


def is_raw_drive(folder: Path) -> bool:
    """Return whether a folder is a raw drive."""
    return (folder / "velodyne_points" / "data").is_dir()


def raw_drives_in(folder: Path) -> list[str]:
    """List the raw drives in the folder of a date."""
    return sorted(entry.name for entry in folder.iterdir() if is_raw_drive(entry))


def open_raw(folder: Path, sensor: LidarModel, *, images: bool = True) -> KittiSequence:
    """Open a raw drive; its files are read frame by frame.

    Raises:
        DriveError: The drive holds no scan.
        CalibrationError: A calibration file cannot be used, or the INS has no calibration.
    """
    scans = NumberedFiles.within(folder / "velodyne_points" / "data", SCAN_SUFFIXES)
    if not len(scans):
        raise DriveError(scans.folder, expected="scans named 0000000000.bin", found="none")
    calibration = read_raw_calibration(_calibration_folder(folder))
    image_files = NumberedFiles.within(folder / "image_02" / "data", IMAGE_SUFFIXES)
    camera = CameraFiles.of(calibration, image_files, load_images=images)
    packets = NumberedFiles.within(folder / "oxts" / "data", (".txt",))
    label_file = folder / "label_02.txt"
    point_labels = NumberedFiles.within(folder / "labels", POINT_LABEL_SUFFIXES)
    return KittiSequence(
        name=folder.resolve().name,
        root=folder,
        sensor=sensor,
        calibration=camera.calibration,
        scans=scans,
        clock=_clock(folder / "velodyne_points" / "timestamps.txt", scans, sensor),
        images=camera.images,
        image_size=camera.image_size,
        ins=OxtsFiles(packets) if len(packets) else None,
        velo_SE3_imu=calibration.velo_SE3_imu,
        label_file=label_file if label_file.is_file() else None,
        point_labels=point_labels if len(point_labels) else None,
    )


def _calibration_folder(folder: Path) -> Path:
    """Return the drive's own folder if a calibration lies there, else the folder of its date."""
    is_own = any((folder / name).is_file() for name in (CAM_TO_CAM, VELO_TO_CAM, IMU_TO_VELO))
    return folder if is_own else folder.resolve().parent


@dataclass(frozen=True)
class OxtsFiles:
    """INS packets, one file each."""

    files: NumberedFiles

    def packet(self, number: int) -> InsPacket:
        """Read the packet of a frame.

        Raises:
            PoseError: The packet is missing or malformed.
        """
        path = self.files.path(number)
        try:
            return parse_oxts_packet(path.read_text(), path)
        except (OSError, UnicodeDecodeError) as error:
            found = "no file" if isinstance(error, FileNotFoundError) else str(error)
            raise PoseError(
                path, expected=f"the INS packet of frame {number}", found=found, advice=SKIP_ADVICE
            ) from error


@dataclass(frozen=True)
class TimestampFile:
    """Timestamps as read, seconds since the drive's first, NaN where a row is no time.

    Attributes:
        path: File of timestamps.
        stamps_s: Seconds since the first timestamp of the drive, by row.
        row_of_number: Row of each frame, by frame number.
    """

    path: Path
    stamps_s: Float64
    row_of_number: dict[int, int]

    def stamp_s(self, number: int) -> float:
        """Return the time of a frame's scan since the drive's first.

        Raises:
            DriveError: The row is missing, or is not a time.
        """
        row = self.row_of_number[number]
        if row >= len(self.stamps_s) or np.isnan(self.stamps_s[row]):
            raise DriveError(
                f"{self.path} row {row + 1}",
                expected="a time such as 2011-09-26 13:04:32.335337762",
                found="no such row" if row >= len(self.stamps_s) else "another text",
                advice="correct the row, or remove the file for a steady clock",
            )
        return float(self.stamps_s[row])


def _clock(path: Path, scans: NumberedFiles, sensor: LidarModel) -> Clock:
    if not path.is_file():
        return FixedRateClock(sensor.rate_hz, scans.numbers[0])
    timestamps = np.array(
        [_parse_timestamp(line) for line in path.read_text().splitlines()], "datetime64[ns]"
    )
    # A row a frame; or, where frames are missing, a row for each of those that are there.
    is_row_a_scan = len(timestamps) == len(scans)
    rows = enumerate(scans.paths) if is_row_a_scan else ((n, n) for n in scans.numbers)
    row_of_number = {number: row for row, number in rows}
    known = timestamps[~np.isnat(timestamps)]
    origin = known[0] if len(known) else np.datetime64("1970-01-01", "ns")
    return TimestampFile(path, (timestamps - origin) / np.timedelta64(1, "s"), row_of_number)


def _parse_timestamp(line: str) -> np.datetime64:
    try:
        return np.datetime64(line.strip() or "NaT", "ns")
    except ValueError:
        return np.datetime64("NaT", "ns")
