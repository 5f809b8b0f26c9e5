"""`trifuse maps`."""

from pathlib import Path

from data.results.command_config import CommandConfig
from perception.cli.flags import PartOfDriveFlags, ResultsFlags
from perception.errors import UsageError
from perception.types import Drive, MapMethod


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
    """Write 8-bit depth and reflectance maps of LiDAR scans, as the camera sees them.

    Example: trifuse maps kitti/object --frame 1468 --out results/maps

    Args:
        root: KITTI raw drive, tracking folder, object folder, or synthetic drive.
        frame: Number of the frame; a figure compares all methods on it.
        all: Write the maps of all frames, without a figure.
        method: Interpolation; thesis is the nearest vertex of the Delaunay triangle.
    """
    from data.frames import frame_count, read_frames
    from data.open_drive import open_drive
    from data.results.folder import started
    from data.results.map_files import write_maps
    from perception.cli.progress import progress_bar
    from perception.evaluation.report import Column, Table
    from perception.maps.densify import FILL_METHODS, DenseMaps, densify
    from perception.maps.projection import project_frame
    from perception.render.map_plots import plot_maps

    opened = open_drive(root, sequence=drive.sequence, config=drive.reading)
    chosen = results.folder(config)
    if all:
        count = frame_count(opened, drive.frames)
        frames = read_frames(opened, on_bad_frame=drive.on_bad_frame, limit=drive.frames)
        dense_maps = started(
            (one.name, densify(project_frame(one), method))
            for one in progress_bar(frames, "frames", count)
        )
        folder, written = chosen.prepare(), 0
        for name, dense in dense_maps:
            write_maps(dense, folder, f"{name}.png")
            written += 1
        print(f"{written} depth and reflectance maps in {folder}")
        return
    one = opened[_index_of(frame, opened)]
    sparse = project_frame(one)
    methods = sorted(FILL_METHODS, key=lambda name: name != method)
    by_method = {name: densify(sparse, name) for name in methods}
    rows = {str(name): dense for name, dense in by_method.items()}
    folder = chosen.prepare()
    write_maps(by_method[method], folder, f"{one.name}.png")
    title = f"{opened.name}, frame {frame}"
    plot_maps(folder / f"maps_{one.name}.png", title, one.image, sparse, by_method)
    columns = (
        Column[DenseMaps]("measured [%]", lambda dense: 100 * dense.is_measured.mean(), ".1f"),
        Column[DenseMaps]("filled [%]", lambda dense: 100 * dense.is_filled.mean(), ".1f"),
    )
    print(Table(title, columns, rows, heading="method").text())


def _index_of(number: int, drive: Drive) -> int:
    from data.frames import file_number

    numbers = [file_number(drive, index) for index in range(len(drive))]
    if number not in numbers:
        raise UsageError(
            "--frame",
            expected=f"a frame of {drive.name}, {numbers[0]} to {numbers[-1]}",
            found=str(number),
        )
    return numbers.index(number)
