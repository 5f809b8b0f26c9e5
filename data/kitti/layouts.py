"""KITTI's layouts as `Layout`s: what their folders look like, and how they are opened."""

from pathlib import Path

from data.kitti.objects import is_object_folder, open_objects
from data.kitti.raw import is_raw_drive, open_raw, raw_drives_in
from data.kitti.tracking import open_tracking, tracking_sequences_in
from data.layouts import Layout, OpenConfig
from data.recorded_drive import RecordedDrive


def _parts(path: Path) -> tuple[Path, ...]:
    """Return the folders that may hold a benchmark's data: the folder itself, training, then testing."""
    return path, path / "training", path / "testing"


def _tracking_sequences(path: Path) -> tuple[str, ...] | None:
    listed = (tuple(tracking_sequences_in(folder)) for folder in _parts(path))
    return next(filter(None, listed), None)


def _open_tracking(path: Path, sequence: str | None, config: OpenConfig) -> RecordedDrive:
    folder = next(filter(tracking_sequences_in, _parts(path)))
    return open_tracking(folder, sequence or "", config)


KITTI_RAW = Layout(
    "KITTI raw",
    "a KITTI raw drive (velodyne_points/data)",
    lambda path: () if is_raw_drive(path) else None,
    lambda path, _, config: open_raw(path, config),
)
KITTI_OBJECT = Layout(
    "KITTI object",
    "object frames (velodyne/NNNNNN.bin)",
    lambda path: () if any(map(is_object_folder, _parts(path))) else None,
    lambda path, _, config: open_objects(next(filter(is_object_folder, _parts(path))), config),
)
KITTI_TRACKING = Layout(
    "KITTI tracking", "tracking sequences (velodyne/SSSS)", _tracking_sequences, _open_tracking
)
KITTI_DATE = Layout(
    "KITTI raw date",
    "a folder of raw drives",
    lambda path: tuple(raw_drives_in(path)) or None,
    lambda path, sequence, config: open_raw(path / (sequence or ""), config),
)
