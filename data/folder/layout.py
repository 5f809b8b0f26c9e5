"""The layouts of folders of scans: those with a drive.yaml, recorded packets, and scans alone, which are asked last."""

from pathlib import Path

from data.folder.discovery import RECORDING_SUFFIXES, drives_below, find_scans, is_described
from data.kitti.sensor_files import list_folder
from data.layouts import Layout, OpenConfig
from data.recorded_drive import RecordedDrive


def _open(path: Path, sequence: str | None, config: OpenConfig) -> RecordedDrive:
    from data.folder.open_folder import open_folder

    return open_folder(path / sequence if sequence else path, config)


def _recordings_in(path: Path) -> tuple[str, ...] | None:
    """Return the names of the recordings in a folder without scans; none where the path is one."""
    if path.suffix.lower() in RECORDING_SUFFIXES and path.is_file():
        return ()
    found = [
        one.name for one in sorted(list_folder(path)) if one.suffix.lower() in RECORDING_SUFFIXES
    ]
    return tuple(found) if found and find_scans(path) is None else None


FOLDER = Layout(
    "folder",
    "a folder with a drive.yaml",
    lambda path: () if is_described(path) else drives_below(path) or None,
    _open,
)
RECORDING = Layout(
    "packets",
    "recorded packets of a LiDAR (.pcap, .pcapng)",
    _recordings_in,
    _open,
)
LOOSE_SCANS = Layout(
    "scans",
    "scans as .bin, .npy, .npz, .pcd, .ply or .csv",
    lambda path: () if path.is_dir() and find_scans(path) is not None else None,
    _open,
)
