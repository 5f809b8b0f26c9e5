"""A street small enough to know every candidate: a car, a van and a pole on a flat road, three frames."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from data.array_store import ArrayStore
from data.kitti.calibration import DriveCalibration, format_benchmark_calibration
from data.kitti.labels import format_object_labels
from data.open_drive import open_drive
from data.samples.crops.labelled_frames import CropConfig, LabelledFrames
from perception.geometry.boxes import corners
from perception.geometry.camera import project
from perception.types import Boxes3D, Calibration, Labels

CAMERA = Calibration(
    image_P_cam=np.array([[180.0, 0, 155, 0], [0, 180, 45, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0, -1, 0, 0.0], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]]),
    image_size_px=(310, 95),
)
ROAD_M = -1.73
# x, y, length, width, height
CAR, VAN, POLE = (
    (14.0, 2.0, 4.0, 1.8, 1.5),
    (20.0, -4.0, 5.0, 2.0, 2.1),
    (11.0, -2.0, 0.3, 0.3, 3.0),
)


def surface(x: float, y: float, length: float, width: float, height: float) -> np.ndarray:
    """Return (N, 4) points 15 cm apart on the sides of an upright box that stands on the road."""
    along, across = np.arange(-length / 2, length / 2, 0.15), np.arange(-width / 2, width / 2, 0.15)
    edges = [(s, side * width / 2) for s in along for side in (-1, 1)]
    edges += [(side * length / 2, s) for s in across for side in (-1, 1)]
    up = np.arange(0.1, height, 0.15)
    return np.array([[x + a, y + b, ROAD_M + z, 0.5] for a, b in edges for z in up], np.float32)


def road() -> np.ndarray:
    """Return (N, 4) points of a flat road ahead."""
    x, y = np.meshgrid(np.arange(4, 45, 0.25), np.arange(-12, 12, 0.25))
    z, grey = np.full_like(x, ROAD_M), np.full_like(x, 0.2)
    return np.stack([x, y, z, grey], axis=-1).reshape(-1, 4).astype(np.float32)


def labels_of(things: dict[str, tuple[float, ...]]) -> Labels:
    """Label things by their classes; the 2D boxes are those of the 3D boxes' corners."""
    rows = np.array(list(things.values())).reshape(-1, 5)
    bottom = np.column_stack([rows[:, :2], np.full(len(rows), ROAD_M)])
    boxes = Boxes3D(bottom, rows[:, 2:], np.zeros(len(rows)))
    pixels, _ = project(CAMERA.image_P_velo, corners(boxes).reshape(-1, 3))
    pixels = pixels.reshape(-1, 8, 2)
    return Labels(
        boxes_velo=boxes,
        boxes_px=np.concatenate([pixels.min(axis=1), pixels.max(axis=1)], axis=1),
        types=np.array(list(things), np.str_),
        track_ids=np.full(len(rows), -1),
        truncation=np.zeros(len(rows)),
        occlusion=np.zeros(len(rows), int),
        dont_care_px=np.zeros((0, 4)),
    )


def write_frame(training: Path, number: int, labels: Labels) -> None:
    """Write an object frame of the street."""
    scan = np.concatenate([road(), surface(*CAR), surface(*VAN), surface(*POLE)])
    texts = {
        "calib": format_benchmark_calibration(DriveCalibration(CAMERA, np.eye(4))),
        "label_2": format_object_labels(labels, CAMERA),
    }
    for folder, text in texts.items():
        path = training / folder / f"{number:06d}.txt"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    path = training / "velodyne" / f"{number:06d}.bin"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(scan.tobytes())


@pytest.fixture
def make_street(tmp_path: Path) -> Callable[..., Path]:
    """Write some frames with chosen labels; return their folder."""

    def make(name: str = "street", things: Sequence[str] = ("Car", "Van"), frames: int = 3) -> Path:
        labels = labels_of({"Car": CAR, "Van": VAN, "Pole": POLE})
        labels = labels[np.isin(labels.types, things)]
        for number in range(frames):
            write_frame(tmp_path / name / "training", number, labels)
        return tmp_path / name

    return make


@pytest.fixture
def street(make_street: Callable[..., Path], store: ArrayStore) -> LabelledFrames:
    return LabelledFrames([open_drive(make_street())], CropConfig(), store)
