"""Synthetic drives on disk, in KITTI's raw, tracking and object layouts, with exact truth beside them.

raw        DATE/calib_*.txt   DATE/DATE_drive_NNNN_sync/{velodyne_points,image_02,oxts,labels}/
           label_02.txt  truth_labels.txt  truth_poses.txt  sensor.json in the drive's folder
tracking   training/{velodyne,image_02,labels}/SSSS/NNNNNN.*  training/{calib,oxts,label_02}/SSSS.txt
           training/{truth_labels,truth_poses}/SSSS.txt  training/sensor.json
object     training/{velodyne,image_2,labels,calib,label_2}/NNNNNN.*  training/sensor.json

`truth_poses.txt` holds the exact world_SE3_velo of each frame as KITTI's 12 numbers a row, in the world
of the INS packets; `truth_labels.txt` the boxes of everyone around, in the camera's view or not, as
tracking labels. `.label` files hold SemanticKITTI's words: class below, track id plus one above.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

import cv2
import numpy as np

from data.kitti.calibration import format_benchmark_calibration, format_raw_calibration
from data.kitti.labels import format_object_labels, format_tracking_labels
from data.kitti.oxts import format_oxts_packet
from data.synthetic.drive import SyntheticDrive
from data.synthetic.materials import MOVING_CLASS
from perception.atomic_file import write_atomically
from perception.sensor import sensor_to_json
from perception.types import Float64, Labels, PointTruth, UInt8

DATE = "2025_06_01"
_NOON = datetime(2025, 6, 1, 12, 0, 0)
_THREADS = 2  # ray casting and array arithmetic let go of the interpreter


@dataclass(frozen=True)
class EncodedFrame:
    """Encoded files of one frame.

    Attributes:
        scan: Scan: x, y, z, reflectance as float32.
        truth: SemanticKITTI label of each point.
        image: Image as PNG, or None without a camera.
        packet: INS packet as a row of text.
        labels: Labels by KITTI's rules.
    """

    scan: bytes
    truth: bytes
    image: bytes | None
    packet: str
    labels: Labels


@dataclass(frozen=True)
class FrameFolders:
    """Folders of the files of all frames."""

    scans: Path
    truth: Path
    images: Path


def write_raw(drive: SyntheticDrive, out: Path, number: int, done: Callable[[], object]) -> Path:
    """Write a drive as a KITTI raw recording; return its folder.

    Args:
        drive: Drive to write.
        out: Folder in which the folder of the date is made.
        number: Number of the drive.
        done: Function called after each frame.
    """
    folder = out / DATE / f"{DATE}_drive_{number:04d}_sync"
    for name, text in format_raw_calibration(drive.rig).items():
        write_atomically(folder.parent / name, text.encode())
    write_atomically(folder / "sensor.json", sensor_to_json(drive.sensor).encode())

    folders = FrameFolders(
        folder / "velodyne_points" / "data", folder / "labels", folder / "image_02" / "data"
    )
    stems = {index: f"{index:010d}" for index in range(len(drive))}
    labels = []
    for index, frame in _write_frames(drive, stems, folders, is_tracking=True):
        packet = f"{frame.packet}\n".encode()
        write_atomically(folder / "oxts" / "data" / f"{stems[index]}.txt", packet)
        labels.append(format_tracking_labels(index, frame.labels, drive.calibration))
        done()
    write_atomically(folder / "label_02.txt", "".join(labels).encode())
    write_atomically(folder / "truth_labels.txt", _truth_labels(drive))
    write_atomically(folder / "truth_poses.txt", _truth_poses(drive))
    _write_stamps(drive, folder)
    return folder


def write_tracking(
    drive: SyntheticDrive, out: Path, number: int, done: Callable[[], object]
) -> Path:
    """Write a drive as a sequence of KITTI's tracking benchmark; return the training folder.

    Args:
        drive: Drive to write.
        out: Folder in which the folder training is made.
        number: Number of the sequence.
        done: Function called after each frame.
    """
    folder, name = out / "training", f"{number:04d}"
    write_atomically(folder / "sensor.json", sensor_to_json(drive.sensor).encode())
    calibration = format_benchmark_calibration(drive.rig).encode()
    write_atomically(folder / "calib" / f"{name}.txt", calibration)

    folders = FrameFolders(
        folder / "velodyne" / name, folder / "labels" / name, folder / "image_02" / name
    )
    stems = {index: f"{index:06d}" for index in range(len(drive))}
    labels, packets = [], []
    for index, frame in _write_frames(drive, stems, folders, is_tracking=True):
        packets.append(f"{frame.packet}\n")
        labels.append(format_tracking_labels(index, frame.labels, drive.calibration))
        done()
    write_atomically(folder / "oxts" / f"{name}.txt", "".join(packets).encode())
    write_atomically(folder / "label_02" / f"{name}.txt", "".join(labels).encode())
    write_atomically(folder / "truth_labels" / f"{name}.txt", _truth_labels(drive))
    write_atomically(folder / "truth_poses" / f"{name}.txt", _truth_poses(drive))
    return folder


def write_objects(
    drive: SyntheticDrive,
    out: Path,
    first_number: int,
    frames: Sequence[int],
    done: Callable[[], object],
) -> Path:
    """Write some frames of a drive as frames of KITTI's object benchmark; return the training folder.

    Args:
        drive: Drive of which frames are written.
        out: Folder in which the folder training is made.
        first_number: Number of the first written frame; the others follow.
        frames: Indices of the frames of the drive.
        done: Function called after each frame.
    """
    folder = out / "training"
    write_atomically(folder / "sensor.json", sensor_to_json(drive.sensor).encode())
    folders = FrameFolders(folder / "velodyne", folder / "labels", folder / "image_2")
    stems = {index: f"{first_number + row:06d}" for row, index in enumerate(frames)}
    calibration = format_benchmark_calibration(drive.rig).encode()
    for index, frame in _write_frames(drive, stems, folders, is_tracking=False):
        text = format_object_labels(frame.labels, drive.calibration)
        write_atomically(folder / "calib" / f"{stems[index]}.txt", calibration)
        write_atomically(folder / "label_2" / f"{stems[index]}.txt", text.encode())
        done()
    return folder


def semantic_kitti_labels(truth: PointTruth) -> np.ndarray:
    """Return (N,) SemanticKITTI words: class, moving ones apart, and object number times 65536."""
    classes = truth.classes.astype(np.uint32)
    for still, moving in MOVING_CLASS.items():
        classes[truth.is_moving & (truth.classes == still)] = moving
    return np.asarray(classes | truth.instances.astype(np.uint32) << 16)


def _write_frames(
    drive: SyntheticDrive, stems: Mapping[int, str], folders: FrameFolders, *, is_tracking: bool
) -> Iterator[tuple[int, EncodedFrame]]:
    """Write scans, truth and images of the frames that have a file name; yield them in order."""

    def write(index: int) -> EncodedFrame:
        frame, stem = encode_frame(drive, index, is_tracking=is_tracking), stems[index]
        if frame.image is not None:
            write_atomically(folders.images / f"{stem}.png", frame.image)
        write_atomically(folders.truth / f"{stem}.label", frame.truth)
        write_atomically(folders.scans / f"{stem}.bin", frame.scan)
        return frame

    with ThreadPoolExecutor(_THREADS, thread_name_prefix="synth") as pool:
        try:
            yield from zip(stems, pool.map(write, stems), strict=True)
        finally:
            pool.shutdown(cancel_futures=True)


def encode_frame(drive: SyntheticDrive, index: int, *, is_tracking: bool) -> EncodedFrame:
    """Render one frame and encode it."""
    scan = drive.scan(index)
    return EncodedFrame(
        scan=scan.points_velo.tobytes(),
        truth=semantic_kitti_labels(scan.truth).tobytes(),
        image=_png(drive.image(index)) if drive.has_images else None,
        packet=format_oxts_packet(drive.ins_packet(index)),
        labels=drive.labels(index, is_tracking=is_tracking),
    )


def _png(image: UInt8) -> bytes:
    swapped = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    _, data = cv2.imencode(".png", swapped, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    return data.tobytes()


def _truth_labels(drive: SyntheticDrive) -> bytes:
    rows = (
        format_tracking_labels(index, drive.labels_around(index), drive.calibration)
        for index in range(len(drive))
    )
    return "".join(rows).encode()


def _truth_poses(drive: SyntheticDrive) -> bytes:
    poses = np.stack([drive.true_world_SE3_velo(index)[:3] for index in range(len(drive))])
    return format_poses(poses).encode()


def format_poses(poses: Float64) -> str:
    """Return (F, 3, 4) poses as KITTI's 12 numbers a row."""
    rows = poses.reshape(len(poses), 12)
    return "".join(" ".join(f"{number:.9e}" for number in row) + "\n" for row in rows)


def _write_stamps(drive: SyntheticDrive, folder: Path) -> None:
    """Write when each turn began, faced forward and ended, and when camera and INS measured."""
    half_turn = 0.5 / drive.sensor.rate_hz
    shifts_s = {
        "velodyne_points/timestamps_start.txt": -half_turn,
        "velodyne_points/timestamps.txt": 0.0,
        "velodyne_points/timestamps_end.txt": half_turn,
        "oxts/timestamps.txt": 0.0,
    }
    if drive.has_images:
        shifts_s["image_02/timestamps.txt"] = 0.0
    for name, shift_s in shifts_s.items():
        stamps = [drive.stamp_s(index) + shift_s for index in range(len(drive))]
        write_atomically(folder / name, "".join(f"{_clock(stamp)}\n" for stamp in stamps).encode())


def _clock(stamp_s: float) -> str:
    time = _NOON + timedelta(seconds=stamp_s)
    return f"{time:%Y-%m-%d %H:%M:%S}.{time.microsecond * 1000:09d}"
