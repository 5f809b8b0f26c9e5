"""Synthetic drives on disk, in KITTI's raw, tracking and object layouts, with exact truth beside them.

raw        DATE/calib_*.txt   DATE/DATE_drive_NNNN_sync/{velodyne_points,image_02,oxts,labels}/
           label_02.txt  truth_labels.txt  truth_poses.txt  sensor.json in the drive's folder
tracking   training/{velodyne,image_02,labels}/SSSS/NNNNNN.*  training/{calib,oxts,label_02}/SSSS.txt
           training/{truth_labels,truth_poses}/SSSS.txt  training/sensor.json
object     training/{velodyne,image_2,labels,calib,label_2}/NNNNNN.*  training/sensor.json
           training/truth_labels/NNNNNN.txt  in which buses, trailers and two-wheelers are classes

`truth_poses.txt` holds the exact world_SE3_velo of each frame as KITTI's 12 numbers a row, in the world
of the INS packets; `truth_labels.txt` the boxes of everyone around, in the camera's view or not, as
tracking labels. `.label` files hold SemanticKITTI's words: class below, track id plus one above.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path
from queue import SimpleQueue

import cv2
import numpy as np

from data.kitti.calibration import format_benchmark_calibration, format_raw_calibration
from data.kitti.labels import format_object_labels, format_tracking_labels
from data.kitti.oxts import format_oxts_packet
from data.synthetic.drive import SyntheticDrive
from data.synthetic.materials import MOVING_CLASS
from data.synthetic.remote_object import RemoteObject
from perception.atomic_file import write_atomically
from perception.sensor import sensor_to_json
from perception.types import Calibration, Float64, Labels, PointTruth, UInt8

DATE = "2025_06_01"
# Noisy images hardly repeat themselves: without a search for repetitions, files are smaller, and made in less time.
_PNG = (
    cv2.IMWRITE_PNG_COMPRESSION,
    1,
    cv2.IMWRITE_PNG_STRATEGY,
    cv2.IMWRITE_PNG_STRATEGY_HUFFMAN_ONLY,
)
_NOON = datetime(2025, 6, 1, 12, 0, 0)
# From this number of images on, every second frame is written by a process of its own, which first has to build the
# world again. Two threads alone keep 1.5 cores busy.
MIN_FRAMES_OF_A_PROCESS = 16


@dataclass(frozen=True)
class WrittenFrame:
    """What is written of one frame together with all others.

    Attributes:
        packet: INS packet as a row of text.
        labels: Labels by KITTI's rules.
    """

    packet: str
    labels: Labels


@dataclass(frozen=True)
class FrameFolders:
    """Folders of the files of all frames, with a folder of images for each camera of the drive."""

    scans: Path
    truth: Path
    images: tuple[Path, ...]


# Writes the frame of an index under a name.
Writer = Callable[[int, str], WrittenFrame]


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
        folder / "velodyne_points" / "data", folder / "labels", (folder / "image_02" / "data",)
    )
    stems = {index: f"{index:010d}" for index in range(len(drive))}
    labels = []
    for index, frame in write_frames(drive, stems, folders, is_tracking=True):
        packet = f"{frame.packet}\n".encode()
        write_atomically(folder / "oxts" / "data" / f"{stems[index]}.txt", packet)
        labels.append(format_tracking_labels(index, frame.labels, drive.calibration))
        done()
    write_atomically(folder / "label_02.txt", "".join(labels).encode())
    write_atomically(folder / "truth_labels.txt", truth_labels(drive, drive.calibration))
    write_atomically(folder / "truth_poses.txt", truth_poses(drive))
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
        folder / "velodyne" / name, folder / "labels" / name, (folder / "image_02" / name,)
    )
    stems = {index: f"{index:06d}" for index in range(len(drive))}
    labels, packets = [], []
    for index, frame in write_frames(drive, stems, folders, is_tracking=True):
        packets.append(f"{frame.packet}\n")
        labels.append(format_tracking_labels(index, frame.labels, drive.calibration))
        done()
    write_atomically(folder / "oxts" / f"{name}.txt", "".join(packets).encode())
    write_atomically(folder / "label_02" / f"{name}.txt", "".join(labels).encode())
    write_atomically(
        folder / "truth_labels" / f"{name}.txt", truth_labels(drive, drive.calibration)
    )
    write_atomically(folder / "truth_poses" / f"{name}.txt", truth_poses(drive))
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
    folders = FrameFolders(folder / "velodyne", folder / "labels", (folder / "image_2",))
    stems = {index: f"{first_number + row:06d}" for row, index in enumerate(frames)}
    calibration = format_benchmark_calibration(drive.rig).encode()
    for index, frame in write_frames(drive, stems, folders, is_tracking=False):
        text = format_object_labels(frame.labels, drive.calibration)
        write_atomically(folder / "calib" / f"{stems[index]}.txt", calibration)
        write_atomically(folder / "label_2" / f"{stems[index]}.txt", text.encode())
        around = format_object_labels(
            drive.labels_around(index, by_category=True), drive.calibration
        )
        write_atomically(folder / "truth_labels" / f"{stems[index]}.txt", around.encode())
        done()
    return folder


def semantic_kitti_labels(truth: PointTruth) -> np.ndarray:
    """Return (N,) SemanticKITTI words: class, moving ones apart, and object number times 65536."""
    classes = truth.classes.astype(np.uint32)
    for still, moving in MOVING_CLASS.items():
        classes[truth.is_moving & (truth.classes == still)] = moving
    return np.asarray(classes | truth.instances.astype(np.uint32) << 16)


def write_frames(
    drive: SyntheticDrive, stems: Mapping[int, str], folders: FrameFolders, *, is_tracking: bool
) -> Iterator[tuple[int, WrittenFrame]]:
    """Write scans, truth and images of the frames that have a file name; yield them in order."""
    here = FrameWriter(drive, folders, is_tracking=is_tracking)
    with ExitStack() as on_exit:
        write_there: Writer = here.write
        if drive.has_images and len(stems) >= MIN_FRAMES_OF_A_PROCESS:
            make = partial(_make_writer, drive.make, folders, is_tracking=is_tracking)
            remote = RemoteObject("the frame writer", make, "write fewer frames at a time")
            on_exit.callback(remote.close)
            write_there = partial(_write_remotely, remote)
        # Each frame goes to the writer that is free.
        writers: SimpleQueue[Writer] = SimpleQueue()
        for writer in (here.write, write_there):
            writers.put(writer)

        def write(index: int) -> WrittenFrame:
            writer = writers.get()
            try:
                return writer(index, stems[index])
            finally:
                writers.put(writer)

        pool = on_exit.enter_context(ThreadPoolExecutor(2, thread_name_prefix="synth"))
        on_exit.callback(pool.shutdown, cancel_futures=True)
        yield from zip(stems, pool.map(write, stems), strict=True)


@dataclass(frozen=True)
class FrameWriter:
    """Renders frames of a drive, and writes their scans, truth and images.

    Attributes:
        drive: Drive of the frames.
        folders: Folders of the files.
        is_tracking: Whether labels are those of tracking.
    """

    drive: SyntheticDrive
    folders: FrameFolders
    is_tracking: bool

    def write(self, index: int, stem: str) -> WrittenFrame:
        """Write a frame under a name; return what is written with all frames together."""
        drive, folders = self.drive, self.folders
        scan = drive.scan(index)
        if drive.has_images:
            for camera, images in zip(drive.cameras, folders.images, strict=True):
                write_atomically(images / f"{stem}.png", _png(drive.image(index, camera)))
        labels = semantic_kitti_labels(scan.truth)
        write_atomically(folders.truth / f"{stem}.label", labels.tobytes())
        write_atomically(folders.scans / f"{stem}.bin", scan.points_velo.tobytes())
        packet = format_oxts_packet(drive.ins_packet(index))
        return WrittenFrame(packet, drive.labels(index, is_tracking=self.is_tracking))


def _write_remotely(remote: RemoteObject[FrameWriter], index: int, stem: str) -> WrittenFrame:
    return remote.call(FrameWriter.write, index, stem)


def _make_writer(
    make_drive: Callable[[], SyntheticDrive], folders: FrameFolders, *, is_tracking: bool
) -> FrameWriter:
    return FrameWriter(make_drive(), folders, is_tracking)


def _png(image: UInt8) -> bytes:
    swapped = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    _, data = cv2.imencode(".png", swapped, _PNG)
    return data.tobytes()


def truth_labels(drive: SyntheticDrive, calibration: Calibration) -> bytes:
    """Return the labels of everyone around as tracking labels, in the frame of a camera."""
    rows = (
        format_tracking_labels(index, drive.labels_around(index), calibration)
        for index in range(len(drive))
    )
    return "".join(rows).encode()


def truth_poses(drive: SyntheticDrive) -> bytes:
    """Return the exact poses of the LiDAR as KITTI's 12 numbers a row."""
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
