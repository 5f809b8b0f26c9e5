"""Fingerprints of frames and code: keys of cached data."""

import hashlib
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from data.array_store import entry_key
from data.kitti.drive import KittiDrive
from data.kitti.sequence import KittiSequence
from perception.types import Drive


def frame_fingerprint(drive: Drive, index: int) -> dict[str, Any]:
    """Return what identifies a frame and the contents of its files."""
    files = frame_files(drive, index)
    stats = [path.stat() if path.is_file() else None for path in files]
    return {
        "files": [
            (path.resolve(), stat and (stat.st_size, stat.st_mtime_ns))
            for path, stat in zip(files, stats, strict=True)
        ],
        "drive": (drive.name, drive.root.resolve()),
        "lidar_height_m": drive.sensor.height_m,
        "camera": None if drive.calibration is None else drive.calibration.image_P_velo.tolist(),
        # A drive that is not on disk is known by what it shows.
        "scan": None if files else hashlib.blake2b(drive[index].points_velo.tobytes()).hexdigest(),
    }


def frame_files(drive: Drive, index: int) -> list[Path]:
    """Return the files of a frame and its labels; none for a drive in memory."""
    if not isinstance(drive, KittiDrive):
        return []
    scan = drive.scans.paths[index]
    image = None if drive.images is None else drive.images.paths[index]
    if isinstance(drive, KittiSequence):
        texts = [drive.label_file]
    else:
        texts = [drive.root / folder / f"{scan.stem}.txt" for folder in ("calib", "label_2")]
    return [path for path in (scan, *texts, image) if path is not None]


@cache
def code_fingerprint(*sources: ModuleType | Path) -> str:
    """Return a hash of packages, modules and files, so that cached data of older code is not used."""
    files = [file for source in sources for file in _python_files(source)]
    return entry_key(code=[file.read_text() for file in sorted(files)])


def _python_files(source: ModuleType | Path) -> Sequence[Path]:
    if isinstance(source, Path):
        return [source]
    if not hasattr(source, "__path__"):
        return [Path(str(source.__file__))]
    return [file for folder in source.__path__ for file in Path(folder).glob("*.py")]
