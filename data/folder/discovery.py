"""Where the parts of a drive lie in a folder, by their names."""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal

from data.clouds.read_cloud import CLOUD_SUFFIXES
from data.folder.config import FILE_NAME
from data.kitti.sensor_files import FrameFiles, list_folder

PoseFormat = Literal["kitti", "tum", "csv", "ins"]
IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".ppm", ".pgm")
RECORDING_SUFFIXES = (".pcap", ".pcapng", ".cap")
_DEPTH = 2  # folders below that of the drive
_TABLE = re.compile(r".*(pose|odom|traject|ins|gps|gnss|imu|oxts|time|stamp|label|calib).*", re.I)
_TIMES = re.compile(r".*(time|stamp).*\.(txt|csv)$", re.I)
_POSES = re.compile(r".*(pose|odom|traject|tum).*\.(txt|csv|tum)$", re.I)
_INS = re.compile(r".*(ins|gps|gnss|oxts|navsat).*\.csv$", re.I)
_LEFT = re.compile(
    r"left|front|center|centre|cam(era)?_?0|image_?2|image_?02|rgb|color|colour", re.I
)


def cloud_files(folder: Path) -> FrameFiles:
    """List the clouds of one folder and of one format, that which most of its files have."""
    files = [path for path in list_folder(folder) if _is_cloud(path) and path.is_file()]
    suffixes = [path.suffix for path in files]
    if not files:
        return FrameFiles(folder, ())
    usual = max(sorted(set(suffixes)), key=suffixes.count)
    found = FrameFiles.within(folder, (usual,))
    if usual == ".csv":
        return FrameFiles(folder, tuple(path for path in found.paths if _is_cloud(path)))
    return found


def _is_cloud(path: Path) -> bool:
    suffix = path.suffix.lower()
    return suffix in CLOUD_SUFFIXES and not (
        suffix in (".csv", ".npy", ".npz") and _TABLE.match(path.stem)
    )


def find_scans(root: Path) -> Path | None:
    """Return the folder with the most clouds of a format, the first of those nearest to the root; None without any."""
    found = [(len(cloud_files(folder)), folder) for folder in folders_below(root)]
    count, folder = max(found, key=lambda one: one[0], default=(0, root))
    return folder if count else None


def image_files(folder: Path) -> FrameFiles:
    """List the images of one folder."""
    return FrameFiles.within(folder, (*IMAGE_SUFFIXES, *(one.upper() for one in IMAGE_SUFFIXES)))


def find_images(root: Path, scans: int) -> list[Path]:
    """Return the folders with images, those first that have as many as there are scans, then those of a front camera."""
    found = [(folder, len(image_files(folder))) for folder in folders_below(root)]
    used = [(folder, count) for folder, count in found if count > 1 or (count and scans == 1)]
    used.sort(key=lambda one: (one[1] != scans, not _LEFT.search(one[0].name)))
    return [folder for folder, _ in used]


def find_times(root: Path, scans_folder: Path) -> Path | None:
    """Return a file of timestamps beside or above the scans."""
    return next(_matching((scans_folder, scans_folder.parent, root), _TIMES), None)


def find_poses(root: Path) -> tuple[Path, PoseFormat] | None:
    """Return a file of poses, or one of an INS, with its format by name and number of columns; None without any."""
    for path in _matching((root, *_subfolders(root)), _INS):
        return path, "ins"
    for path in _matching((root, *_subfolders(root)), _POSES):
        if path.suffix.lower() == ".csv":
            return path, "csv"
        columns = _columns_in(path)
        if columns in (8, 12):
            return path, "tum" if columns == 8 else "kitti"
    return None


def is_described(folder: Path) -> bool:
    """Return whether a folder has a drive.yaml."""
    return (folder / FILE_NAME).is_file()


def drives_below(root: Path) -> tuple[str, ...]:
    """Return the names of the folders that hold a drive.yaml each."""
    return tuple(sorted(path.name for path in _subfolders(root) if is_described(path)))


def _columns_in(path: Path) -> int:
    with path.open("rb") as file:
        lines = [line for line in file.read(1 << 14).splitlines() if line[:1] not in (b"#", b"")]
    return len(lines[0].split()) if lines else 0


def _matching(folders: Sequence[Path], pattern: re.Pattern[str]) -> Iterator[Path]:
    files = (path for folder in folders for path in sorted(list_folder(folder)) if path.is_file())
    return (path for path in files if pattern.match(path.name))


def folders_below(root: Path) -> Iterator[Path]:
    """Yield the folder and those below it, the nearest first."""
    level = [root]
    for _ in range(_DEPTH + 1):
        yield from level
        level = [below for folder in level for below in _subfolders(folder)]


def _subfolders(folder: Path) -> list[Path]:
    return sorted(path for path in list_folder(folder) if path.is_dir())
