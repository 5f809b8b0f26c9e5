"""The layouts of folders of scans: those with a drive.yaml, and those with scans alone, which are asked last."""

from pathlib import Path

from data.folder.discovery import drives_below, find_scans, is_described
from data.layouts import Layout, OpenConfig
from data.recorded_drive import RecordedDrive


def _open(path: Path, sequence: str | None, config: OpenConfig) -> RecordedDrive:
    from data.folder.open_folder import open_folder

    return open_folder(path / sequence if sequence else path, config)


FOLDER = Layout(
    "folder",
    "a folder with a drive.yaml",
    lambda path: () if is_described(path) else drives_below(path) or None,
    _open,
)
LOOSE_SCANS = Layout(
    "scans",
    "scans as .bin, .npy, .npz, .pcd, .ply or .csv",
    lambda path: () if path.is_dir() and find_scans(path) is not None else None,
    _open,
)
