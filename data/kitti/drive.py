"""What the layouts of KITTI have in common: files for each frame, read on access."""

from abc import ABC
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from data.file_drive import FileDrive
from data.kitti.reading import read_bytes
from data.kitti.sensor_files import FrameFiles, read_scan
from data.layouts import OpenConfig
from data.recorded_drive import hash_scan
from data.reflectance import full_scale, largest_reflectance, sample_indices, scale_note
from perception.errors import ScanError
from perception.types import Float32


@dataclass(frozen=True)
class ReflectanceScale:
    """Full scale of the reflectance of a drive.

    Attributes:
        scale: Full scale, 1 where reflectance is from 0 to 1.
        notes: Sentence that says so, where it was found and is not 1.
    """

    scale: float = 1.0
    notes: tuple[str, ...] = ()


def find_reflectance_scale(scans: FrameFiles, config: OpenConfig) -> ReflectanceScale:
    """Return the full scale that was asked for, else that of some scans of the drive."""
    if config.reflectance_scale is not None:
        return ReflectanceScale(config.reflectance_scale)
    readable = []
    for index in sample_indices(len(scans)):
        try:
            readable.append(read_scan(scans.paths[index]))
        except ScanError:
            continue  # reported when the frame is read
    largest = largest_reflectance(readable)
    scale = full_scale(largest)
    notes = () if scale == 1 else (scale_note(str(scans.folder), largest, scale),)
    return ReflectanceScale(scale, notes)


@dataclass(frozen=True, kw_only=True)
class KittiDrive(FileDrive, ABC):
    """Frames of KITTI's sensors.

    Attributes:
        reflectance_scale: Full scale of the reflectance in the files, which becomes 1.
    """

    reflectance_scale: float = 1.0

    @property
    def has_forward_camera(self) -> bool:
        """Whether the camera is known to face forward: the left colour camera does."""
        return True

    def points_velo(self, index: int) -> Float32:
        """Read the (N, 4) points of one frame."""
        points_velo = read_scan(self.scans.paths[index])
        if self.reflectance_scale != 1:
            points_velo[:, 3] /= np.float32(self.reflectance_scale)
        return points_velo

    def fingerprint(self, index: int) -> bytes:
        """Return the hash of the file of a scan, which is read once."""
        path = self.scans.paths[index]
        if not path.is_file():  # it is met where it is used
            return hash_scan(str(path).encode())
        stat = path.stat()
        return _hash_file(path, stat.st_size, stat.st_mtime_ns)


@cache
def _hash_file(path: Path, size: int, modified_ns: int) -> bytes:
    """Return the hash of a file, read once as long as it has this size and time: scans are large."""
    return hash_scan(read_bytes(path, ScanError, "a scan"))
