"""Open the drive at a path, in any layout."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from data.further_cameras import DriveCamera, FurtherCameras
from data.kitti.sensor_files import no_scans
from data.layout_registry import layouts
from data.layouts import Layout, OpenConfig
from data.recorded_drive import RecordedDrive
from perception.errors import CalibrationError, DriveError, UsageError

_DEFAULT = OpenConfig()


def open_drive(
    path: str | Path,
    *,
    sequence: str | None = None,
    sensor: str | Path | None = None,
    images: bool = True,
    config: OpenConfig = _DEFAULT,
) -> RecordedDrive:
    """Open a drive, whatever its layout.

    Args:
        path: Folder or file of any layout; of KITTI's benchmarks, the folder with or without training/.
        sequence: Sequence, where there are several: 0000, or the name or number of a raw drive.
        sensor: Name of a LiDAR model, or a file that describes one; else what the drive states, else HDL-64E.
        images: Whether frames carry images.
        config: How the drive is read; `sensor` and `images` come before it.

    Raises:
        DriveError: The path holds no drive, or several and no sequence is given, or it cannot be read.
        UsageError: It has no frame behind those that are left out.
    """
    path, sensor = Path(path), str(sensor) if sensor else config.sensor
    config = replace(config, sensor=sensor, images=images and config.images)
    with _readable(path):
        layout, sequences = _recognise(path)
        drive = _open(layout, path, _choose(path, sequences, sequence), config)
        drive = replace(drive, deskew=True) if config.deskew else drive
        is_whole = config.start == 0 and config.every == 1
        return drive if is_whole else _selected(drive, config.start, config.every)


def _open(layout: Layout, path: Path, sequence: str | None, config: OpenConfig) -> RecordedDrive:
    """Open a drive with its main camera, and with each further one for the images of that."""
    if len(config.cameras) <= 1:
        return layout.open(path, sequence, config)
    drive, *others = (
        layout.open(path, sequence, replace(config, camera=name)) for name in config.cameras
    )
    further = []
    for name, other in zip(config.cameras[1:], others, strict=True):
        if other.calibration is None:
            raise CalibrationError(path, expected=f"the calibration of {name}", found="none")
        further.append(DriveCamera(name, other.calibration, other.images))
    return replace(
        drive,
        camera=config.cameras[0],
        further_cameras=FurtherCameras(tuple(further)),
        notes=tuple(dict.fromkeys(note for one in (drive, *others) for note in one.notes)),
    )


def _selected(drive: RecordedDrive, start: int, every: int) -> RecordedDrive:
    if start >= len(drive):
        raise UsageError(
            "--start",
            expected=f"less than {len(drive)}, the frames of {drive.name}",
            found=str(start),
        )
    return drive.select(range(start, len(drive), every))


def open_drives(
    paths: Sequence[str | Path], *, images: bool = True, config: OpenConfig = _DEFAULT
) -> list[RecordedDrive]:
    """Open every drive of every path; arguments as of `open_drive`.

    Raises:
        DriveError: A path holds no drive, or it cannot be read.
    """
    return [
        open_drive(path, sequence=sequence, images=images, config=config)
        for path in paths
        for sequence in sequences_in(path)
    ]


def sequences_in(path: str | Path) -> list[str | None]:
    """Return the values of `sequence` with which `open_drive` opens each drive of a path in turn.

    Raises:
        DriveError: The path holds no drive, or cannot be read.
    """
    path = Path(path)
    with _readable(path):
        return list(_recognise(path)[1]) or [None]


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


def _recognise(path: Path) -> tuple[Layout, tuple[str, ...]]:
    """Return the first layout that a path is of, and the names of its drives."""
    descriptions = []
    for layout in layouts():
        sequences = layout.sequences(path)
        if sequences is not None:
            return layout, sequences
        descriptions.append(layout.description)
    expected = f"{', '.join(descriptions[:-1])} or {descriptions[-1]}"
    if path.is_file():
        advice = "name the folder of the drive"
        raise DriveError(path, expected=expected, found="a file of another kind", advice=advice)
    raise no_scans(path, expected)


def _choose(path: Path, sequences: Sequence[str], asked: str | None) -> str | None:
    """Return the sequence that is asked for, by its name or its number."""
    if not sequences:
        if asked is not None:
            raise UsageError(
                f"sequence {asked}",
                expected="none, as the path itself names the drive",
                found=str(path),
            )
        return None
    if asked is None and len(sequences) == 1:
        return sequences[0]
    names = [name for name in sequences if asked is not None and _is_named(name, asked)]
    if len(names) != 1:
        raise DriveError(
            path,
            expected=f"sequence {asked}" if asked else "one of several sequences to be named",
            found=", ".join(sequences),
            advice="choose one with --sequence",
        )
    return names[0]


def _is_named(name: str, asked: str) -> bool:
    is_number = name.isdecimal() and asked.isdecimal() and int(name) == int(asked)
    return name == asked or is_number or f"_drive_{asked.zfill(4)}_" in name
