"""Drives with a few objects on a road, whose labels a test writes in a form of its own."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from perception.types import Boxes3D
from tests.data.folder.conftest import road_scan

LIDAR = "lidar: {scans: lidar, sensor: HDL-32E, height_m: 2.0, rate_hz: 10}\n"
# Type, track, x y z of the centre, length, width, height, heading.
OBJECTS = (
    ("Car", "7", 10.0, 3.0, -1.2, 4.4, 1.8, 1.6, 0.3),
    ("Truck", "8", -12.0, -2.5, -0.5, 8.0, 2.5, 3.0, -0.2),
    ("Pedestrian", "9", 6.0, -4.5, -1.15, 0.6, 0.7, 1.7, 1.5),
    ("Cyclist", "11", 14.0, -3.0, -1.1, 1.8, 0.6, 1.8, -2.0),
)


@dataclass(frozen=True)
class ObjectRow:
    """One labelled object of a frame."""

    kind: str
    track: str
    center_m: tuple[float, float, float]
    size_m: tuple[float, float, float]
    yaw_rad: float


def objects_of(frame: int) -> list[ObjectRow]:
    """Return the objects of a frame, of which those with a track move ahead half a metre a frame."""
    return [
        ObjectRow(kind, track, (x + 0.5 * frame, y, z), (length, width, height), yaw)
        for kind, track, x, y, z, length, width, height, yaw in OBJECTS
    ]


def surface(one: ObjectRow) -> np.ndarray:
    """Return (N, 4) points on the sides of an object."""
    steps = np.linspace(-0.5, 0.5, 12)
    grid = np.array([(a, b) for a in steps for b in steps])
    sides = [np.column_stack([np.full(len(grid), s), grid]) for s in (-0.5, 0.5)]
    sides += [np.column_stack([grid[:, 0], np.full(len(grid), s), grid[:, 1]]) for s in (-0.5, 0.5)]
    local = np.concatenate(sides) * one.size_m
    cos, sin = np.cos(one.yaw_rad), np.sin(one.yaw_rad)
    x = cos * local[:, 0] - sin * local[:, 1]
    y = sin * local[:, 0] + cos * local[:, 1]
    places = np.column_stack([x, y, local[:, 2]]) + one.center_m
    return np.column_stack([places, np.full(len(places), 0.5)]).astype(np.float32)


def true_boxes(frame: int) -> Boxes3D:
    """Return the boxes of a frame."""
    rows = objects_of(frame)
    sizes = np.array([one.size_m for one in rows])
    centres = np.array([one.center_m for one in rows])
    return Boxes3D(centres - sizes * (0, 0, 0.5), sizes, np.array([one.yaw_rad for one in rows]))


@pytest.fixture
def drive_folder(tmp_path: Path) -> Callable[..., Path]:
    """Return a function that writes a drive of some frames, and a drive.yaml with more rows."""

    def write(more: str = "labels: labels\n", frames: int = 2) -> Path:
        root = tmp_path / "drive"
        (root / "lidar").mkdir(parents=True)
        for frame in range(frames):
            parts = [road_scan(frame, columns=360), *map(surface, objects_of(frame))]
            np.save(root / "lidar" / f"{frame:06d}.npy", np.concatenate(parts))
        (root / "drive.yaml").write_text(LIDAR + more)
        return root

    return write
