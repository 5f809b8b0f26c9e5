"""`trifuse maps`: the dense depth and reflectance map of a frame as pictures, or of all frames."""

from pathlib import Path

import cv2

from data.frames import file_number, read_frames
from data.open_drive import open_drive
from data.results.run_folder import make_results_folder
from perception.cli.progress import progress_bar
from perception.cli.table import format_table
from perception.errors import DriveError, UsageError
from perception.maps.densify import FILL_METHODS, DenseMaps, MapMethod, densify
from perception.maps.encoding import encode_depth, encode_reflectance
from perception.maps.projection import project_frame
from perception.render.map_plots import plot_maps
from perception.types import Drive


def maps(
    drive: Path,
    *,
    sequence: str | None = None,
    frame: int = 0,
    all: bool = False,
    method: MapMethod = "default",
    out: Path | None = None,
) -> None:
    """Make 8-bit depth and reflectance maps from LiDAR scans, as the camera sees them.

    Example: trifuse maps kitti/object --frame 1468 --out results/maps

    Args:
        drive: a KITTI raw drive, tracking folder, object folder, or synthetic drive.
        sequence: which one, where there are several.
        frame: number of the frame; also draws a figure with every method.
        all: write the maps of all frames, and no figure.
        method: default, thesis (nearest vertex of the triangle), nearest, linear or natural.
        out: folder for the pictures; else results/<time>.
    """
    opened = open_drive(drive, sequence=sequence)
    folder = out or make_results_folder()
    if all:
        for one in progress_bar(read_frames(opened), "frames", len(opened)):
            name = f"{file_number(opened, one.index):06d}.png"
            write_maps(densify(project_frame(one), method), folder, name)
        print(f"{len(opened)} depth and reflectance maps in {folder}")
        return
    chosen = opened[_index(opened, frame)]
    sparse = project_frame(chosen)
    by_method = {
        name: densify(sparse, name) for name in sorted(FILL_METHODS, key=lambda m: m != method)
    }
    write_maps(by_method[method], folder, f"{frame:06d}.png")
    title = f"{opened.name}, frame {frame}"
    plot_maps(folder / f"maps_{frame:06d}.png", title, chosen.image, sparse, by_method)
    print(_table(title, by_method))


def write_maps(dense: DenseMaps, folder: Path, name: str) -> None:
    """Write both maps as 8-bit PNG into `depth` and `reflectance`."""
    images = {
        "depth": encode_depth(dense.depth_m),
        "reflectance": encode_reflectance(dense.reflectance),
    }
    for kind, image in images.items():
        (folder / kind).mkdir(parents=True, exist_ok=True)
        if not cv2.imwrite(str(folder / kind / name), image):
            raise DriveError(folder / kind, expected="a folder to write to", found="none")


def _index(drive: Drive, number: int) -> int:
    """Return where in a drive the frame of that number is."""
    numbers = [file_number(drive, index) for index in range(len(drive))]
    if number not in numbers:
        raise UsageError(
            "--frame",
            expected=f"a frame of {drive.name}, {numbers[0]} to {numbers[-1]}",
            found=str(number),
        )
    return numbers.index(number)


def _table(title: str, by_method: dict[MapMethod, DenseMaps]) -> str:
    rows = [
        [name, f"{100 * dense.is_measured.mean():.1f}", f"{100 * dense.is_filled.mean():.1f}"]
        for name, dense in by_method.items()
    ]
    return format_table(title, ("method", "measured %", "filled %"), rows)
