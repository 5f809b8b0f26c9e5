"""KITTI's tracking benchmark: sequences side by side, a folder a sensor.

training/velodyne/0000/000000.bin   training/image_02/0000/000000.png
training/oxts/0000.txt   training/calib/0000.txt   training/label_02/0000.txt
training/labels/0000/000000.label   training/sensor.json      (synthetic drives)
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from data.kitti.calibration import DriveCalibration, read_benchmark_calibration
from data.kitti.drive import find_reflectance_scale
from data.kitti.image_joining import join_images
from data.kitti.oxts import InsPacket, parse_oxts_packet
from data.kitti.reading import read_text
from data.kitti.sensor_files import (
    IMAGE_SUFFIXES,
    POINT_LABEL_SUFFIXES,
    SKIP_ADVICE,
    FrameFiles,
    list_folder,
    scans_in,
)
from data.kitti.sequence import CameraFiles, InsSource, KittiSequence, ScanClock
from data.layouts import OpenConfig
from perception.errors import PoseError


def tracking_sequences_in(folder: Path) -> list[str]:
    """List the sequences in a training or testing folder."""
    return sorted(entry.name for entry in list_folder(folder / "velodyne") if entry.is_dir())


def open_tracking(folder: Path, sequence: str, config: OpenConfig) -> KittiSequence:
    """Open a sequence of a training or testing folder; its files are read frame by frame.

    Raises:
        DriveError: The sequence has no scan.
        CalibrationError: The calibration file cannot be used, or the INS has no calibration.
    """
    scans = scans_in(folder / "velodyne" / sequence)
    sensor = config.lidar_model(folder)
    calibration_file = folder / "calib" / f"{sequence}.txt"
    calibration = DriveCalibration(None, None)
    if calibration_file.is_file():
        calibration = read_benchmark_calibration(calibration_file)
    images = config.camera_among(("image_02",))
    image_files = FrameFiles.within(folder / images / sequence, IMAGE_SUFFIXES)
    joined = join_images(scans, image_files, scans.unix_times, image_files.unix_times)
    reflectance = find_reflectance_scale(scans, config)
    camera = CameraFiles.of(calibration.camera, image_files, joined, load=config.images)
    packets = folder / "oxts" / f"{sequence}.txt"
    label_file = folder / "label_02" / f"{sequence}.txt"
    point_labels = FrameFiles.within(folder / "labels" / sequence, POINT_LABEL_SUFFIXES)
    return KittiSequence(
        name=sequence,
        root=folder,
        sensor=sensor,
        calibration=camera.calibration,
        scans=scans,
        clock=ScanClock.without_timestamps(scans, sensor.rate_hz),
        images=camera.images,
        ins=OxtsFile.read(packets, scans.numbers) if packets.is_file() else None,
        velo_SE3_imu=calibration.velo_SE3_imu,
        label_file=label_file if label_file.is_file() else None,
        point_labels=point_labels.joined(scans),
        reflectance_scale=reflectance.scale,
        notes=(*joined.notes, *reflectance.notes),
    )


@dataclass(frozen=True)
class OxtsFile(InsSource):
    """INS packets, one row for each frame number.

    Attributes:
        path: File of the packets.
        rows: Rows of the file.
        numbers: Frame number of each scan.
    """

    path: Path
    rows: tuple[str, ...]
    numbers: tuple[int, ...]

    @classmethod
    def read(cls, path: Path, numbers: tuple[int, ...]) -> "OxtsFile":
        """Split the file into rows, which are parsed on access.

        Raises:
            PoseError: The file is not text.
        """
        text = read_text(path, PoseError, "INS packets as text")
        return cls(path, tuple(text.splitlines()), numbers)

    def packet(self, index: int) -> InsPacket:
        """Read the packet of a frame.

        Raises:
            PoseError: The packet is missing or malformed.
        """
        number = self.numbers[index]
        where = f"{self.path} row {number + 1}"
        row = self.rows[number] if number < len(self.rows) else ""
        if not row.strip():
            raise PoseError(
                where,
                expected=f"the INS packet of frame {number}",
                found="an empty row" if number < len(self.rows) else f"only {len(self.rows)} rows",
                advice=SKIP_ADVICE,
            )
        return parse_oxts_packet(row, where)

    def select(self, indices: Sequence[int]) -> "OxtsFile":
        """Return the packets of some frames."""
        return OxtsFile(self.path, self.rows, tuple(self.numbers[index] for index in indices))
