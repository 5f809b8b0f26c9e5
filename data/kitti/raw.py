"""KITTI's raw recordings: one folder a drive, its calibration in the folder of the date.

2011_09_26/calib_cam_to_cam.txt  calib_velo_to_cam.txt  calib_imu_to_velo.txt
2011_09_26/2011_09_26_drive_0005_sync/
    velodyne_points/data/0000000000.bin   velodyne_points/timestamps.txt
    image_02/data/0000000000.png          oxts/data/0000000000.txt
    label_02.txt  labels/0000000000.label  sensor.json    (synthetic drives)
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from data.kitti.calibration import CAM_TO_CAM, IMU_TO_VELO, VELO_TO_CAM, read_raw_calibration
from data.kitti.drive import find_reflectance_scale
from data.kitti.image_joining import join_images
from data.kitti.oxts import InsPacket, parse_oxts_packet
from data.kitti.reading import read_text
from data.kitti.sensor_files import (
    IMAGE_SUFFIXES,
    POINT_LABEL_SUFFIXES,
    SKIP_ADVICE,
    FrameFiles,
    join_notes,
    list_folder,
    scans_in,
)
from data.kitti.sequence import CameraFiles, InsSource, KittiSequence, ScanClock
from data.kitti.timestamps import file_times
from data.layouts import OpenConfig
from perception.errors import PoseError

_CAMERAS = ("image_02", "image_03", "image_00", "image_01")  # colour before grey, left before right


def is_raw_drive(folder: Path) -> bool:
    """Return whether a folder is a raw drive."""
    return (folder / "velodyne_points" / "data").is_dir()


def raw_drives_in(folder: Path) -> list[str]:
    """List the raw drives in the folder of a date."""
    return sorted(entry.name for entry in list_folder(folder) if is_raw_drive(entry))


def open_raw(folder: Path, config: OpenConfig) -> KittiSequence:
    """Open a raw drive; its files are read frame by frame.

    Raises:
        DriveError: The drive holds no scan.
        CalibrationError: A calibration file cannot be used, or the INS has no calibration.
    """
    scans = scans_in(folder / "velodyne_points" / "data")
    timestamps = folder / "velodyne_points" / "timestamps.txt"
    sensor = config.lidar_model(folder)
    images = config.camera_among(_CAMERAS)
    number = images.removeprefix("image_")
    calibration = read_raw_calibration(_calibration_folder(folder), number)
    image_files = FrameFiles.within(folder / images / "data", IMAGE_SUFFIXES)
    joined = join_images(
        scans,
        image_files,
        file_times(timestamps, scans),
        file_times(folder / images / "timestamps.txt", image_files),
    )
    camera = CameraFiles.of(calibration.camera, image_files, joined, load=config.images)
    reflectance = find_reflectance_scale(scans, config)
    packet_files = FrameFiles.within(folder / "oxts" / "data", (".txt",))
    packets = packet_files.joined(scans)
    label_file = folder / f"label_{number}.txt"
    point_labels = FrameFiles.within(folder / "labels", POINT_LABEL_SUFFIXES)
    return KittiSequence(
        name=folder.resolve().name,
        root=folder,
        sensor=sensor,
        calibration=camera.calibration,
        scans=scans,
        clock=ScanClock.of(timestamps, scans, sensor.rate_hz),
        images=camera.images,
        ins=None if packets is None else OxtsFiles(packets),
        velo_SE3_imu=calibration.velo_SE3_imu,
        label_file=label_file if label_file.is_file() else None,
        point_labels=point_labels.joined(scans),
        reflectance_scale=reflectance.scale,
        notes=(
            *joined.notes,
            *join_notes(scans, {"INS packets": packet_files}),
            *reflectance.notes,
        ),
    )


def _calibration_folder(folder: Path) -> Path:
    """Return the drive's own folder if a calibration lies there, else the folder of its date."""
    is_own = any((folder / name).is_file() for name in (CAM_TO_CAM, VELO_TO_CAM, IMU_TO_VELO))
    return folder if is_own else folder.resolve().parent


@dataclass(frozen=True)
class OxtsFiles(InsSource):
    """INS packets, one file for each scan."""

    files: FrameFiles

    def packet(self, index: int) -> InsPacket:
        """Read the packet of a frame.

        Raises:
            PoseError: The packet is missing or malformed.
        """
        path = self.files.paths[index]
        expected = f"the INS packet of frame {index}"
        return parse_oxts_packet(read_text(path, PoseError, expected, SKIP_ADVICE), path)

    def select(self, indices: Sequence[int]) -> "OxtsFiles":
        """Return the packets of some frames."""
        return OxtsFiles(self.files.select(indices))
