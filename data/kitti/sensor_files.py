"""Sensor files, one per frame: scans, images, and the exact truth of synthetic points."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from perception.errors import ImageError, LabelError, ScanError
from perception.types import Float32, PointTruth, UInt8

SCAN_SUFFIXES = (".bin",)
IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg")
POINT_LABEL_SUFFIXES = (".label",)
SKIP_ADVICE = "pass --on-bad-frame skip to go on without this frame"

_POINT_BYTES = 16  # x, y, z, reflectance as float32
# SemanticKITTI numbers the moving classes apart: car, bicyclist, person, motorcyclist, on rails,
# bus, truck, other vehicle.
_STATIC_CLASS = {252: 10, 253: 31, 254: 30, 255: 32, 256: 16, 257: 13, 258: 18, 259: 20}
_END_OF_IMAGE = {b"\x89PNG": b"IEND", b"\xff\xd8\xff": b"\xff\xd9"}  # by how the file begins


@dataclass(frozen=True)
class NumberedFiles:
    """Files of one folder, named by the number of their frame.

    Attributes:
        folder: Folder of the files.
        paths: Paths by frame number, in order.
    """

    folder: Path
    paths: Mapping[int, Path]

    @classmethod
    def within(cls, folder: Path, suffixes: tuple[str, ...]) -> "NumberedFiles":
        """List a folder; one that does not exist holds no files."""
        entries = folder.iterdir() if folder.is_dir() else ()
        found = [path for path in entries if path.suffix in suffixes and path.stem.isdigit()]
        return cls(folder, {int(path.stem): path for path in sorted(found)})

    def __len__(self) -> int:
        return len(self.paths)

    @property
    def numbers(self) -> range:
        """All numbers from the first to the last, those of missing files included."""
        return range(min(self.paths), max(self.paths) + 1) if self.paths else range(0)

    @property
    def missing(self) -> list[int]:
        """Numbers between the first and the last that have no file."""
        return [number for number in self.numbers if number not in self.paths]

    def path(self, number: int) -> Path:
        """Return the file of a frame, or its expected path."""
        if number in self.paths:
            return self.paths[number]
        sample = next(iter(self.paths.values()))
        return self.folder / f"{number:0{len(sample.stem)}d}{sample.suffix}"


@dataclass(frozen=True)
class ImageSize:
    """Size of a drive's images, and the file that states it."""

    size_px: tuple[int, int]
    source: str


def read_scan(path: Path) -> Float32:
    """Read (N, 4) points; `Frame` validates them.

    Raises:
        ScanError: The file is missing, or does not hold a whole number of points.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        found = "no file" if isinstance(error, FileNotFoundError) else str(error)
        raise ScanError(path, expected="a scan", found=found, advice=SKIP_ADVICE) from error
    if len(data) % _POINT_BYTES:
        raise ScanError(
            path,
            expected=f"{_POINT_BYTES} bytes a point: x, y, z, reflectance as float32",
            found=f"{len(data)} bytes, {len(data) % _POINT_BYTES} too many for a whole number",
            advice=f"copy the file again, it may be cut off; or {SKIP_ADVICE}",
        )
    return np.frombuffer(bytearray(data), np.float32).reshape(-1, 4)


def read_image(path: Path, expected: ImageSize | None = None) -> UInt8:
    """Read an (H, W, 3) RGB image.

    Raises:
        ImageError: The image is missing, damaged, or of another size than expected.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        found = "no file" if isinstance(error, FileNotFoundError) else str(error)
        raise ImageError(path, expected="an image", found=found, advice=SKIP_ADVICE) from error
    decoded = _decode(data)
    if decoded is None:
        raise ImageError(
            path,
            expected="a whole PNG or JPEG image",
            found=f"{len(data)} bytes that cannot be decoded",
            advice=f"copy the file again; or {SKIP_ADVICE}",
        )
    height, width = decoded.shape[:2]
    if expected is not None and (width, height) != expected.size_px:
        raise ImageError(
            path,
            expected="{}x{} pixels".format(*expected.size_px) + f" as {expected.source} says",
            found=f"{width}x{height}",
        )
    return decoded


def _decode(data: bytes) -> UInt8 | None:
    """Decode to RGB; OpenCV fills up an image that was cut off, so its end is looked for first."""
    end = next((end for start, end in _END_OF_IMAGE.items() if data.startswith(start)), b"")
    if not data or end not in data[-1024:]:
        return None
    decoded = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    return None if decoded is None else np.asarray(cv2.cvtColor(decoded, cv2.COLOR_BGR2RGB))


def read_point_truth(path: Path, points: int) -> PointTruth:
    """Read SemanticKITTI's labels of a scan: class in the low, instance in the high 16 bits.

    Raises:
        LabelError: The file is missing, or its length differs from that of the scan.
    """
    if not path.is_file():
        raise LabelError(path, expected="a label for each point", found="no file")
    if path.stat().st_size != 4 * points:
        raise LabelError(
            path,
            expected=f"a label for each of {points} points, {4 * points} bytes",
            found=f"{path.stat().st_size} bytes",
        )
    words = np.fromfile(path, np.uint32)
    classes, instances = (words & 0xFFFF).astype(np.int64), (words >> 16).astype(np.int64)
    is_moving = np.isin(classes, list(_STATIC_CLASS))
    still = np.arange(1 << 16)
    still[list(_STATIC_CLASS)] = list(_STATIC_CLASS.values())
    return PointTruth(still[classes], instances, np.asarray(is_moving))
