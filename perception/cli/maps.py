"""`trifuse maps`."""

from pathlib import Path
from typing import TYPE_CHECKING

from data.results.command_config import CommandConfig
from perception.cli.flags import SourceFlags
from perception.errors import DriveError, UsageError
from perception.types import Drive, MapMethod

if TYPE_CHECKING:
    from perception.maps.densify import DenseMaps


def maps(  # noqa: PLR0913 - flags of a command
    drive: Path,
    *,
    source: SourceFlags,
    config: CommandConfig,
    frame: int = 0,
    all: bool = False,
    method: MapMethod = "default",
    out: Path | None = None,
) -> None:
    """Write 8-bit depth and reflectance maps of LiDAR scans, as the camera sees them.

    Example: trifuse maps kitti/object --frame 1468 --out results/maps

    Args:
        drive: KITTI raw drive, tracking folder, object folder, or synthetic drive.
        frame: Number of the frame; a figure compares all methods on it.
        all: Write the maps of all frames, without a figure.
        method: Interpolation; thesis is the nearest vertex of the Delaunay triangle.
        out: Folder for the maps; else results/<time>.
    """
    from data.frames import file_number, read_frames
    from data.open_drive import open_drive
    from data.results.run_folder import make_results_folder
    from perception.cli.progress import progress_bar
    from perception.evaluation.report import Column, Table
    from perception.maps.densify import FILL_METHODS, DenseMaps, densify
    from perception.maps.projection import project_frame
    from perception.render.map_plots import plot_maps

    opened = open_drive(drive, sequence=source.sequence, sensor=source.sensor)
    if all:
        folder = out or make_results_folder()
        config.write(folder)
        for one in progress_bar(read_frames(opened), "frames", len(opened)):
            name = f"{file_number(opened, one.index):06d}.png"
            write_maps(densify(project_frame(one), method), folder, name)
        print(f"{len(opened)} depth and reflectance maps in {folder}")
        return
    numbers = [file_number(opened, index) for index in range(len(opened))]
    chosen = opened[_index_of(frame, numbers, opened)]
    folder = out or make_results_folder()
    config.write(folder)
    sparse = project_frame(chosen)
    methods = sorted(FILL_METHODS, key=lambda name: name != method)
    by_method = {name: densify(sparse, name) for name in methods}
    rows = {str(name): dense for name, dense in by_method.items()}
    write_maps(by_method[method], folder, f"{frame:06d}.png")
    title = f"{opened.name}, frame {frame}"
    plot_maps(folder / f"maps_{frame:06d}.png", title, chosen.image, sparse, by_method)
    columns = (
        Column[DenseMaps]("measured [%]", lambda dense: 100 * dense.is_measured.mean(), ".1f"),
        Column[DenseMaps]("filled [%]", lambda dense: 100 * dense.is_filled.mean(), ".1f"),
    )
    print(Table(title, columns, rows, heading="method").text())


def write_maps(dense: "DenseMaps", folder: Path, name: str) -> None:
    """Write both maps as 8-bit PNG into the folders `depth` and `reflectance`.

    Args:
        dense: Depth and reflectance map.
        folder: Folder of both.
        name: Name of the two files.
    """
    import cv2

    from perception.maps.encoding import encode_depth, encode_reflectance

    images = {
        "depth": encode_depth(dense.depth_m),
        "reflectance": encode_reflectance(dense.reflectance),
    }
    for kind, image in images.items():
        (folder / kind).mkdir(parents=True, exist_ok=True)
        if not cv2.imwrite(str(folder / kind / name), image):
            raise DriveError(folder / kind, expected="a folder to write to", found="none")


def _index_of(number: int, numbers: list[int], drive: Drive) -> int:
    if number not in numbers:
        raise UsageError(
            "--frame",
            expected=f"a frame of {drive.name}, {numbers[0]} to {numbers[-1]}",
            found=str(number),
        )
    return numbers.index(number)
