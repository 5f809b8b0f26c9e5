"""What the layouts of KITTI have in common: files for each frame, read on access."""

from abc import ABC
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Self

import numpy as np

from data.kitti.reading import read_bytes
from data.kitti.sensor_files import (
    FrameFiles,
    ImageSize,
    read_image,
    read_point_truth,
    read_scan,
)
from data.recorded_drive import RecordedDrive, hash_scan
from perception.errors import ScanError
from perception.types import Float32, PointTruth, UInt8


@dataclass(frozen=True, kw_only=True)
class KittiDrive(RecordedDrive, ABC):
    """Frames that have a scan, in the order of the names of the scans.

    Attributes:
        scans: Scans, one per frame.
        images: (F) image of the left colour camera of each scan, None for a scan without one; None without images.
        image_size: Size that every image must have, or None.
        point_labels: Truth of the points, one file per scan, or None.
        reflectance_scale: Full scale of the reflectance in the files, which becomes 1.
    """

    scans: FrameFiles
    images: tuple[Path | None, ...] | None = None
    image_size: ImageSize | None = None
    point_labels: FrameFiles | None = None
    reflectance_scale: float = 1.0

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Name of each frame in results."""
        return self.scans.names

    @property
    def frame_numbers(self) -> tuple[int, ...]:
        """Number of each frame in KITTI's rows."""
        return self.scans.numbers

    @property
    def has_images(self) -> bool:
        """Whether frames carry images."""
        return self.images is not None

    @property
    def has_point_truth(self) -> bool:
        """Whether the class of every point is known."""
        return self.point_labels is not None

    def select(self, indices: Sequence[int]) -> Self:
        """Return a drive of some frames alone, which keep their numbers and names."""
        images, labels = self.images, self.point_labels
        return replace(
            self,
            scans=self.scans.select(indices),
            images=None if images is None else tuple(images[index] for index in indices),
            point_labels=None if labels is None else labels.select(indices),
        )

    def source(self, index: int) -> str:
        """Return the file of a scan."""
        return str(self.scans.paths[index])

    def points_velo(self, index: int) -> Float32:
        """Read the (N, 4) points of one frame."""
        points_velo = read_scan(self.scans.paths[index])
        if self.reflectance_scale != 1:
            points_velo[:, 3] /= np.float32(self.reflectance_scale)
        return points_velo

    def image(self, index: int) -> UInt8 | None:
        """Read the (H, W, 3) image of one frame."""
        path = None if self.images is None else self.images[index]
        return None if path is None else read_image(path, self.image_size)

    def point_truth(self, index: int) -> PointTruth | None:
        """Read the truth of every point of one frame."""
        if self.point_labels is None:
            return None
        points = len(read_scan(self.scans.paths[index]))
        return read_point_truth(self.point_labels.paths[index], points)

    def frame_files(self, index: int) -> tuple[Path, ...]:
        """Return the scan, the texts and the image of one frame."""
        image = None if self.images is None else self.images[index]
        return self.scans.paths[index], *self._texts(index), *(() if image is None else (image,))

    def _texts(self, index: int) -> tuple[Path, ...]:
        """Return the label and calibration files of one frame."""
        raise NotImplementedError

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
