"""Drives of which only the names of the files exist."""

from collections.abc import Callable
from pathlib import Path

import pytest

from data.kitti.objects import ObjectFrames
from data.kitti.sensor_files import FrameFiles
from perception.sensor import HDL_64E


@pytest.fixture
def make_drive(tmp_path: Path) -> Callable[..., ObjectFrames]:
    """Return a function that names the frames of a drive."""

    def make(frames: int, name: str = "training", root: Path | None = None) -> ObjectFrames:
        folder = root or tmp_path / name
        files = tuple(folder / "velodyne" / f"{number:06d}.bin" for number in range(frames))
        scans = FrameFiles(folder / "velodyne", files)
        return ObjectFrames(name=name, root=folder, sensor=HDL_64E, scans=scans)

    return make
