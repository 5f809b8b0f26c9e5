"""Fingerprints of frames and code: keys of cached data."""

import hashlib
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from data.array_store import entry_key
from data.recorded_drive import RecordedDrive
from perception.types import Drive


def frame_fingerprint(drive: Drive, index: int) -> dict[str, Any]:
    """Return what identifies a frame and the contents of its files."""
    files = drive.frame_files(index) if isinstance(drive, RecordedDrive) else ()
    stats = [path.stat() if path.is_file() else None for path in files]
    return {
        "files": [
            (path.resolve(), stat and (stat.st_size, stat.st_mtime_ns))
            for path, stat in zip(files, stats, strict=True)
        ],
        "drive": (drive.name, drive.root.resolve()),
        "lidar_height_m": drive.sensor.height_m,
        "camera": None if drive.calibration is None else drive.calibration.image_P_velo.tolist(),
        # A frame without files of its own is known by what it shows.
        "scan": None if files else hashlib.blake2b(drive[index].points_velo.tobytes()).hexdigest(),
    }


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
