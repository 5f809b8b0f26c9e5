"""Sensor files, one per frame: scans, images, and the exact truth of synthetic points."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from data.image_decoder import decode_image
from data.kitti.reading import read_bytes
from data.per_frame import PerFrame
from perception.errors import DriveError, ImageError, LabelError, ScanError
from perception.types import Float32, PointTruth, UInt8

SCAN_SUFFIXES = (".bin",)
IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg")
POINT_LABEL_SUFFIXES = (".label",)
SKIP_ADVICE = "pass --on-bad-frame skip to go on without this frame"

_POINT_CLOUD_SUFFIXES = {
    ".bag", ".csv", ".db3", ".feather", ".las", ".laz", ".mcap", ".npy", ".npz", ".parquet", ".pcap", ".pcd", ".ply",
    ".xyz",
}  # fmt: skip
_MAX_LISTED = 6  # entries of a folder in an error
_MAX_FRAMES = 1_000_000  # KITTI's frame numbers have six digits
_UNIX_DIGITS = {13, 16, 19}  # of today's Unix times in ms, us and ns
_MAX_TIME_NS = 2**63  # in the year 2262
# SemanticKITTI numbers the moving classes apart: car, bicyclist, person, motorcyclist, on rails,
# bus, truck, other vehicle.
_STATIC_CLASS = {252: 10, 253: 31, 254: 30, 255: 32, 256: 16, 257: 13, 258: 18, 259: 20}


@dataclass(frozen=True)
class FrameFiles(PerFrame):
    """Files of one folder, one a frame, in the natural order of their names.

    KITTI names a file by the number of its frame. Where the names are others, such as stamps in nanoseconds, frames
    are numbered by position, and results are named as the files are.

    Attributes:
        folder: Folder of the files.
        paths: Paths in order.
        positions: Position of each file in the folder where some are left out, else None.
    """

    folder: Path
    paths: tuple[Path, ...]
    positions: tuple[int, ...] | None = None

    @classmethod
    def within(cls, folder: Path, suffixes: tuple[str, ...]) -> "FrameFiles":
        """List a folder; one that does not exist holds no files."""
        found = [path for path in list_folder(folder) if path.suffix in suffixes]
        return cls(folder, tuple(sorted(found, key=_natural_key)))

    def __len__(self) -> int:
        return len(self.paths)

    @cached_property
    def _numbers_in_names(self) -> tuple[int, ...] | None:
        stems = [path.stem for path in self.paths]
        if not all(stem.isdecimal() for stem in stems):
            return None
        numbers = tuple(map(int, stems))
        is_kitti = len(set(numbers)) == len(numbers) and max(numbers, default=0) < _MAX_FRAMES
        return numbers if is_kitti else None

    @property
    def numbers(self) -> tuple[int, ...]:
        """Frame number of each file: that in its name, or its position where the names are not KITTI's."""
        return self._numbers_in_names or self.positions or tuple(range(len(self)))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Name of each frame in results: its number in six digits, or the name of its file without suffix."""
        if self._numbers_in_names is None:
            return tuple(path.stem for path in self.paths)
        return tuple(f"{number:06d}" for number in self._numbers_in_names)

    @cached_property
    def unix_times(self) -> NDArray[np.datetime64] | None:
        """(F,) times in ns where names are Unix times in ms, us or ns; else None."""
        stems = [path.stem for path in self.paths]
        digits = {len(stem) if stem.isdecimal() else 0 for stem in stems}
        if len(digits) != 1 or not digits <= _UNIX_DIGITS:
            return None
        to_ns = 10 ** (19 - digits.pop())
        times_ns = [int(stem) * to_ns for stem in stems]
        return np.array(times_ns, "datetime64[ns]") if max(times_ns) < _MAX_TIME_NS else None

    def select(self, indices: Sequence[int]) -> "FrameFiles":
        """Return some of the files, which keep their numbers and names."""
        positions = self.positions or tuple(range(len(self)))
        return FrameFiles(
            self.folder,
            tuple(self.paths[index] for index in indices),
            tuple(positions[index] for index in indices),
        )

    def is_joined_by_position(self, scans: "FrameFiles") -> bool:
        """Return whether no file has the name of a scan, but there is one for each scan."""
        return len(self) == len(scans) and not set(self.names) & set(scans.names)

    def joined(self, scans: "FrameFiles") -> "FrameFiles | None":
        """Return the file of each scan by name, or by position where `is_joined_by_position`.

        A scan whose file is missing gets the path that is expected.

        Returns:
            As many files as scans, or None where no scan has a file.
        """
        if self.is_joined_by_position(scans):
            return self
        by_name = dict(zip(self.names, self.paths, strict=True))
        if not by_name.keys() & set(scans.names):
            return None
        paths = (by_name.get(name, self._expected_path(name)) for name in scans.names)
        return FrameFiles(self.folder, tuple(paths))

    def _expected_path(self, name: str) -> Path:
        sample = self.paths[0]
        if self._numbers_in_names is not None and name.isdecimal():
            name = f"{int(name):0{len(sample.stem)}d}"
        return self.folder / f"{name}{sample.suffix}"


def join_notes(scans: FrameFiles, files_of: Mapping[str, FrameFiles]) -> tuple[str, ...]:
    """Return a sentence for each kind of files that is not joined to the scans by names."""
    notes = []
    for what, files in files_of.items():
        found = f"{files.folder}: {len(files)} {what}"
        if len(files) and files.is_joined_by_position(scans):
            notes.append(f"{found} are joined to the scans in order, as their names differ")
        elif len(files) and files.joined(scans) is None:
            sample = scans.paths[0].stem
            notes.append(
                f"{found} are not used, as none is named as one of the {len(scans)} scans is, such as {sample}"
            )
    return tuple(notes)


def list_folder(folder: Path) -> list[Path]:
    """Return the entries of a folder that are not hidden; none where there is no folder."""
    if not folder.is_dir():
        return []
    return [path for path in folder.iterdir() if not path.name.startswith(".")]


def describe_folder(folder: Path) -> str:
    """Return what a folder holds in a few words."""
    groups: dict[str, list[str]] = {}
    for path in sorted(list_folder(folder)):
        groups.setdefault("" if path.is_dir() else path.suffix, []).append(path.name)
    words = [
        f"{len(names)} {suffix} files"
        if suffix and len(names) > _MAX_LISTED
        else ", ".join(names[:_MAX_LISTED]) + (" ..." if len(names) > _MAX_LISTED else "")
        for suffix, names in groups.items()
    ]
    return ", ".join(words) or ("an empty folder" if folder.is_dir() else "no such folder")


def no_scans(folder: Path, expected: str = "scans named 000000.bin") -> DriveError:
    """Return the error of a folder without the scans that are expected there."""
    suffixes = {path.suffix for path in list_folder(folder)}
    advice = None
    if suffixes & _POINT_CLOUD_SUFFIXES:
        advice = "write each scan as a .bin file of float32 numbers: x, y, z in metres, reflectance 0 to 1"
    elif suffixes & set(SCAN_SUFFIXES):
        advice = "move the .bin files into velodyne_points/data within the folder of the drive"
    return DriveError(folder, expected=expected, found=describe_folder(folder), advice=advice)


def scans_in(folder: Path) -> FrameFiles:
    """List the scans of a folder.

    Raises:
        DriveError: There is none.
    """
    scans = FrameFiles.within(folder, SCAN_SUFFIXES)
    if not len(scans):
        raise no_scans(folder)
    return scans


def _natural_key(path: Path) -> list[int | str]:
    """Return text and numbers in turn, so that 2 comes before 10."""
    return [int(part) if part.isdecimal() else part for part in re.split(r"([0-9]+)", path.stem)]


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
    return read_float32_rows(path, ("x", "y", "z", "reflectance"))


def read_float32_rows(path: Path, columns: Sequence[str]) -> Float32:
    """Read the (N, C) points of a file of float32 numbers.

    Args:
        path: Scan.
        columns: Names of the C columns, for error messages.

    Raises:
        ScanError: The file is missing, or does not hold a whole number of points.
    """
    data, point_bytes = read_bytes(path, ScanError, "a scan", SKIP_ADVICE), 4 * len(columns)
    if len(data) % point_bytes:
        raise ScanError(
            path,
            expected=f"{point_bytes} bytes a point: {', '.join(columns)} as float32",
            found=f"{len(data)} bytes, {len(data) % point_bytes} too many for a whole number",
            advice=f"copy the file again, it may be cut off; or {SKIP_ADVICE}",
        )
    return np.frombuffer(bytearray(data), np.float32).reshape(-1, len(columns))


def read_image(path: Path, expected: ImageSize | None = None) -> UInt8:
    """Read an (H, W, 3) RGB image.

    Raises:
        ImageError: The image is missing, damaged, or of another size than expected.
    """
    data = read_bytes(path, ImageError, "an image", SKIP_ADVICE)
    decoded = decode_image(data, path, advice=f"copy the file again; or {SKIP_ADVICE}")
    height, width = decoded.shape[:2]
    if expected is not None and (width, height) != expected.size_px:
        raise ImageError(
            path,
            expected="{}x{} pixels".format(*expected.size_px) + f" as {expected.source} says",
            found=f"{width}x{height}",
        )
    return decoded


def read_point_truth(path: Path, points: int) -> PointTruth:
    """Read SemanticKITTI's labels of a scan: class in the low, instance in the high 16 bits.

    Raises:
        LabelError: The file is missing, or its length differs from that of the scan.
    """
    data = read_bytes(path, LabelError, "a label for each point")
    if len(data) != 4 * points:
        raise LabelError(
            path,
            expected=f"a label for each of {points} points, {4 * points} bytes",
            found=f"{len(data)} bytes",
        )
    words = np.frombuffer(data, np.uint32)
    classes, instances = (words & 0xFFFF).astype(np.int64), (words >> 16).astype(np.int64)
    is_moving = np.isin(classes, list(_STATIC_CLASS))
    still = np.arange(1 << 16)
    still[list(_STATIC_CLASS)] = list(_STATIC_CLASS.values())
    return PointTruth(still[classes], instances, np.asarray(is_moving))
