"""Open the drive at a path, in any layout."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from data.kitti.drive import KittiDrive
from data.kitti.objects import is_object_folder, open_objects
from data.kitti.raw import is_raw_drive, open_raw, raw_drives_in
from data.kitti.sensor_files import no_scans
from data.kitti.tracking import open_tracking, tracking_sequences_in
from perception.errors import DriveError, UsageError
from perception.sensor import HDL_64E, LidarModel, load_sensor

_LAYOUTS = (
    "a KITTI raw drive (velodyne_points/data), a folder of raw drives, tracking sequences "
    "(velodyne/SSSS), or object frames (velodyne/NNNNNN.bin)"
)


@dataclass(frozen=True)
class _DriveLocation:
    """A recognised drive location.

    Attributes:
        folder: Raw drive, folder of raw drives, or training or testing folder.
        layout: Layout: raw, date, tracking or object.
        sequences: Names of the sequences in a date or tracking folder.
    """

    folder: Path
    layout: str
    sequences: tuple[str, ...] = ()


def open_drive(
    path: Path, *, sequence: str | None = None, sensor: str | None = None, images: bool = True
) -> KittiDrive:
    """Open a drive, whatever its layout.

    Args:
        path: Raw drive, date folder, or tracking or object folder with or without training/.
        sequence: Sequence, where there are several: 0000, or the name or number of a raw drive.
        sensor: Name of a LiDAR model, or a .json file; else the drive's sensor.json, else HDL-64E.
        images: Whether frames carry images.

    Raises:
        DriveError: The path holds no drive, or several and no sequence is given, or it cannot be read.
    """
    with _readable(path):
        place = _detect_layout(path)
        if place.layout in ("raw", "object"):
            _reject_sequence(path, sequence)
            chosen = ""
        else:
            chosen = _choose(place, sequence)
        folder = place.folder / chosen if place.layout == "date" else place.folder
        model = _sensor(folder, sensor)
        if place.layout == "tracking":
            return open_tracking(folder, chosen, model, images=images)
        if place.layout == "object":
            return open_objects(folder, model, images=images)
        return open_raw(folder, model, images=images)


def open_drives(
    paths: Sequence[Path], *, sensor: str | None = None, images: bool = True
) -> list[KittiDrive]:
    """Open every drive of every path; arguments as of `open_drive`.

    Raises:
        DriveError: A path holds no drive, or it cannot be read.
    """
    return [
        open_drive(path, sequence=sequence, sensor=sensor, images=images)
        for path in paths
        for sequence in sequences_in(path)
    ]


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise DriveError(
            error.filename or path,
            expected="files and folders that can be read",
            found=error.strerror or str(error),
            advice="give yourself the permission to read them",
        ) from error


def sequences_in(path: Path) -> list[str | None]:
    """Return the values of `sequence` with which `open_drive` opens each drive of a path in turn.

    Raises:
        DriveError: The path holds no drive, or cannot be read.
    """
    with _readable(path):
        return list(_detect_layout(path).sequences) or [None]


def _detect_layout(path: Path) -> _DriveLocation:
    """Return the layout of a path, looking into training/, then testing/."""
    if path.exists() and not path.is_dir():
        raise DriveError(
            path, expected="a folder", found="a file", advice="name the folder of the drive"
        )
    if is_raw_drive(path):
        return _DriveLocation(path, "raw")
    for folder in (path, path / "training", path / "testing"):
        if is_object_folder(folder):
            return _DriveLocation(folder, "object")
        if (folder / "velodyne").is_dir() and (sequences := tracking_sequences_in(folder)):
            return _DriveLocation(folder, "tracking", tuple(sequences))
    if drives := raw_drives_in(path):
        return _DriveLocation(path, "date", tuple(drives))
    raise no_scans(path, _LAYOUTS)


def _reject_sequence(path: Path, sequence: str | None) -> None:
    if sequence is not None:
        raise UsageError(
            f"sequence {sequence}",
            expected="none, as the path itself names the drive",
            found=str(path),
        )


def _choose(place: _DriveLocation, sequence: str | None) -> str:
    if sequence is None and len(place.sequences) == 1:
        return place.sequences[0]
    asked = (sequence or "").zfill(4)
    names = [n for n in place.sequences if n in (sequence, asked) or f"_drive_{asked}_" in n]
    if len(names) != 1:
        raise DriveError(
            place.folder,
            expected=f"sequence {sequence}" if sequence else "one of several sequences to be named",
            found=", ".join(place.sequences),
            advice="choose one with --sequence",
        )
    return names[0]


def _sensor(folder: Path, asked: str | None) -> LidarModel:
    if asked is not None:
        return load_sensor(asked)
    own = folder / "sensor.json"
    return load_sensor(str(own)) if own.is_file() else HDL_64E
