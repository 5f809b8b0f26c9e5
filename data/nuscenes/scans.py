"""Scans of nuScenes and the labels of their points."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from data.kitti.reading import read_bytes
from data.kitti.sensor_files import read_float32_rows
from data.nuscenes.boxes import LIDARSEG_NAMES, category
from perception.errors import LabelError
from perception.types import Float32, Float64, Int

_COLUMNS = ("x", "y", "z", "intensity", "ring")
_FULL_SCALE = np.float32(255)
# The sensor has x to the right and y forward.
SENSOR_R_VELO = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def read_points(path: Path) -> Float32:
    """Read (N, 4) points with x forward and y left, reflectance 0..1; `Frame` validates them.

    Raises:
        ScanError: The file is missing, or does not hold a whole number of points.
    """
    right, forward, up, intensity, _ = read_float32_rows(path, _COLUMNS).T
    return np.stack([forward, -right, up, intensity / _FULL_SCALE], axis=1)


def read_point_classes(path: Path, points: int, names: Mapping[int, str]) -> Int:
    """Read (N,) SemanticKITTI's classes of the points of a scan.

    Args:
        path: File of nuScenes-lidarseg, one byte a point.
        points: Number of points of the scan.
        names: Category of each number, where the tables state them.

    Raises:
        LabelError: The file is missing, or its length differs from that of the scan, or a number has no category.
    """
    numbers = np.frombuffer(read_bytes(path, LabelError, "a label for each point"), np.uint8)
    if len(numbers) != points:
        raise LabelError(
            path,
            expected=f"a label for each of {points} points, {points} bytes",
            found=f"{len(numbers)} bytes",
        )
    known = names or dict(enumerate(LIDARSEG_NAMES))
    unknown = set(np.unique(numbers).tolist()) - known.keys()
    if unknown:
        raise LabelError(
            path,
            expected=f"numbers of {len(known)} categories",
            found=f"{min(unknown)}, which has none",
        )
    classes = np.zeros(256, np.int64)
    for number, name in known.items():
        classes[number] = category(name).point_class
    return np.asarray(classes[numbers])


def ego_SE3_velo(ego_SE3_sensor: Float64) -> Float64:
    """Return the (4, 4) place of the LiDAR with x forward and y left."""
    place = ego_SE3_sensor.copy()
    place[:3, :3] = ego_SE3_sensor[:3, :3] @ SENSOR_R_VELO
    return place
