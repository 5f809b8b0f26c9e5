"""Drives of a few small frames, written where a test wants to break them."""

import os
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from data.array_store import ArrayStore
from data.kitti.calibration import (
    DriveCalibration,
    format_benchmark_calibration,
    format_raw_calibration,
)
from data.kitti.labels import format_object_labels, format_tracking_labels
from data.kitti.oxts import Mercator, format_oxts_packet
from perception.geometry.se3 import from_euler
from perception.types import Boxes3D, Calibration, Labels

_PACKETS = Path(__file__).parents[3] / "shared" / "packets"
FRAMES = 6
SPEED_M_S = 10.0
SIZE_PX = (62, 19)
CALIBRATION = DriveCalibration(
    camera=Calibration(
        image_P_cam=np.array([[36.0, 0, 30.5, 0], [0, 36, 8.6, 0], [0, 0, 1, 0]]),
        cam_SE3_velo=np.array([[0, -1, 0, 0.0], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]]),
        image_size_px=SIZE_PX,
    ),
    velo_SE3_imu=from_euler(0, 0, 0, np.array([-0.8, 0.3, -0.8])),
)
LABELS = Labels(
    boxes_velo=Boxes3D(np.array([[12.0, 1.0, -1.73]]), np.array([[4.0, 1.8, 1.5]]), np.zeros(1)),
    boxes_px=np.array([[20.0, 5.0, 40.0, 15.0]]),
    types=np.array(["Car"]),
    track_ids=np.array([7]),
    truncation=np.zeros(1),
    occlusion=np.zeros(1, int),
    dont_care_px=np.zeros((0, 4)),
)


def scan() -> np.ndarray:
    """Return (N, 4) points on rings of a flat road, 1.73 m below."""
    radius_m, azimuth = np.meshgrid(np.geomspace(3, 40, 40), np.linspace(-np.pi, np.pi, 90))
    x, y = radius_m * np.cos(azimuth), radius_m * np.sin(azimuth)
    return np.stack(
        [x, y, np.full_like(x, -1.73), np.full_like(x, 0.3)], axis=-1, dtype=np.float32
    ).reshape(-1, 4)


def packet_rows(frames: int = FRAMES) -> list[str]:
    """Return INS packets of a steady way to the north-east."""
    world = Mercator(49.0, 8.4, 110.0)
    heading = from_euler(0, 0, np.pi / 4)[:3, 0]
    return [
        format_oxts_packet(
            world.packet(
                from_euler(0, 0, np.pi / 4, heading * SPEED_M_S * 0.1 * index),
                heading * SPEED_M_S,
                np.array([0, 0, 9.81]),
                np.zeros(3),
            )
        )
        for index in range(frames)
    ]


def write_image(path: Path, size_px: tuple[int, int] = SIZE_PX) -> None:
    """Write a picture that is red on its left and blue on its right."""
    image = np.zeros((size_px[1], size_px[0], 3), np.uint8)
    image[:, : size_px[0] // 2, 2] = 255  # OpenCV: blue, green, red
    image[:, size_px[0] // 2 :, 0] = 255
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), image)


def _write(path: Path, content: str | bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content.encode() if isinstance(content, str) else content)


@pytest.fixture
def raw_drive(tmp_path: Path) -> Path:
    """Return a whole raw drive of six frames."""
    drive = tmp_path / "2011_09_26" / "2011_09_26_drive_0042_sync"
    for name, text in format_raw_calibration(CALIBRATION).items():
        _write(drive.parent / name, text)
    stamps = [f"2011-09-26 13:04:32.{index}00000000" for index in range(FRAMES)]
    _write(drive / "velodyne_points/timestamps.txt", "\n".join(stamps) + "\n")
    for index, row in enumerate(packet_rows()):
        _write(drive / f"velodyne_points/data/{index:010d}.bin", scan().tobytes())
        _write(drive / f"oxts/data/{index:010d}.txt", row + "\n")
        write_image(drive / f"image_02/data/{index:010d}.png")
    return drive


@pytest.fixture
def tracking_root(tmp_path: Path) -> Path:
    """Return a tracking folder with two sequences."""
    training = tmp_path / "tracking" / "training"
    for sequence in ("0001", "0004"):
        _write(training / f"calib/{sequence}.txt", format_benchmark_calibration(CALIBRATION))
        _write(training / f"oxts/{sequence}.txt", "\n".join(packet_rows()) + "\n")
        labels = [
            format_tracking_labels(index, LABELS, CALIBRATION.camera) for index in range(FRAMES)
        ]
        _write(training / f"label_02/{sequence}.txt", "".join(labels))
        for index in range(FRAMES):
            _write(training / f"velodyne/{sequence}/{index:06d}.bin", scan().tobytes())
            write_image(training / f"image_02/{sequence}/{index:06d}.png")
    return tmp_path / "tracking"


@pytest.fixture
def object_root(tmp_path: Path) -> Path:
    """Return an object folder whose frame numbers have gaps."""
    training = tmp_path / "object" / "training"
    for number, width in ((0, 62), (3, 60)):
        _write(training / f"velodyne/{number:06d}.bin", scan().tobytes())
        _write(training / f"calib/{number:06d}.txt", format_benchmark_calibration(CALIBRATION))
        text = format_object_labels(LABELS, CALIBRATION.camera)
        _write(training / f"label_2/{number:06d}.txt", text)
        write_image(training / f"image_2/{number:06d}.png", (width, 19))
    return tmp_path / "object"


@pytest.fixture
def store(tmp_path: Path) -> ArrayStore:
    return ArrayStore(tmp_path / "cache")


@pytest.fixture
def ousters(tmp_path) -> Path:
    """Return a copy of the real packets with their metadata."""
    found = Path(os.environ.get("PACKETS_ROOT", _PACKETS))
    if not found.is_dir():
        pytest.skip(f"{found} is not here: set PACKETS_ROOT")
    pytest.importorskip("ouster.sdk.core", reason="ouster-sdk is not installed")
    for path in found.glob("OS-*"):
        shutil.copyfile(path, tmp_path / path.name)
    return tmp_path
