"""`trifuse maps`."""

from pathlib import Path

from data.results.command_config import CommandConfig
from perception.cli.flags import PartOfDriveFlags, ResultsFlags
from perception.types import MapMethod


def maps(
    root: Path,
    *,
    drive: PartOfDriveFlags,
    results: ResultsFlags,
    config: CommandConfig,
    frame: int = 0,
    all: bool = False,
    method: MapMethod = "default",
) -> None:
    """Write 8-bit depth and reflectance maps of LiDAR scans, as each camera sees them.

    Example: trifuse maps kitti/object --frame 1468 --out results/maps

    Args:
        root: KITTI raw drive, tracking folder, object folder, or synthetic drive.
        frame: Number of the frame; a figure compares all methods on it.
        all: Write the maps of all frames, without a figure.
        method: Interpolation; thesis is the nearest vertex of the Delaunay triangle.
    """
    from data.frames import frame_count, read_frames
    from data.open_drive import open_drive
    from data.results.map_files import compare_methods_on, without_unused_images, write_all_maps
    from perception.cli.progress import progress_bar

    opened = open_drive(root, sequence=drive.sequence, config=drive.reading)
    if all:
        count = frame_count(opened, drive.frames)
        seen = without_unused_images(opened)
        frames = read_frames(seen, on_bad_frame=drive.on_bad_frame, limit=drive.frames)
        print(write_all_maps(progress_bar(frames, "frames", count), method, results.folder(config)))
    else:
        print(compare_methods_on(opened, frame, method, results.folder(config)))
