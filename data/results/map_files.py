"""Files of dense maps, as `trifuse maps` writes them."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import cv2

from data.frames import file_number
from data.further_cameras import FurtherCameras
from data.recorded_drive import RecordedDrive
from data.results.folder import ResultsFolder, started
from perception.atomic_file import write_atomically
from perception.errors import UsageError
from perception.evaluation.report import Column, Table
from perception.maps.densify import FILL_METHODS, DenseMaps, densify
from perception.maps.encoding import encode_depth, encode_reflectance
from perception.maps.projection import project_frame
from perception.render.map_plots import plot_maps
from perception.types import Drive, Frame, MapMethod

_COLUMNS = (
    Column[DenseMaps]("measured [%]", lambda dense: 100 * dense.is_measured.mean(), ".1f"),
    Column[DenseMaps]("filled [%]", lambda dense: 100 * dense.is_filled.mean(), ".1f"),
)


def without_unused_images(drive: RecordedDrive) -> RecordedDrive:
    """Return a drive without the images of further cameras, and of the main one where its calibration has their size."""
    calibration = drive.calibration
    is_size_known = calibration is not None and calibration.image_size_px is not None
    images = None if is_size_known else drive.images
    return replace(drive, images=images, further_cameras=FurtherCameras())


def write_all_maps(frames: Iterable[Frame], method: MapMethod, folder: ResultsFolder) -> str:
    """Write the maps of frames; return what is printed.

    Raises:
        PerceptionError: A frame cannot be read or used; the maps before it stay.
    """
    dense_maps = started((one.name, densify(project_frame(one), method)) for one in frames)
    out, written = folder.prepare(), 0
    for name, dense in dense_maps:
        write_maps(dense, out, f"{name}.png")
        written += 1
    return f"{written} depth and reflectance maps in {out}"


def compare_methods_on(drive: Drive, number: int, method: MapMethod, folder: ResultsFolder) -> str:
    """Write the maps of one frame by a method, and a figure of all methods; return the table that is printed.

    Args:
        drive: Drive of the frame.
        number: Number of the frame in KITTI's rows and file names.
        method: Method of the maps, and the first of the figure.
        folder: Folder of the results.

    Raises:
        UsageError: The drive has no such frame.
    """
    numbers = [file_number(drive, index) for index in range(len(drive))]
    if number not in numbers:
        raise UsageError(
            "--frame",
            expected=f"a frame of {drive.name}, {numbers[0]} to {numbers[-1]}",
            found=str(number),
        )
    frame = drive[numbers.index(number)]
    sparse = project_frame(frame)
    methods = sorted(FILL_METHODS, key=lambda name: name != method)
    by_method = {name: densify(sparse, name) for name in methods}
    rows = {str(name): dense for name, dense in by_method.items()}
    out = folder.prepare()
    write_maps(by_method[method], out, f"{frame.name}.png")
    title = f"{drive.name}, frame {number}"
    plot_maps(out / f"maps_{frame.name}.png", title, frame.image, sparse, by_method)
    return Table(title, _COLUMNS, rows, heading="method").text()


def write_maps(dense: DenseMaps, folder: Path, name: str) -> None:
    """Write both maps as 8-bit PNG into the folders `depth` and `reflectance`.

    Args:
        dense: Depth and reflectance map.
        folder: Folder of both.
        name: Name of the two files.
    """
    images = {
        "depth": encode_depth(dense.depth_m),
        "reflectance": encode_reflectance(dense.reflectance),
    }
    for kind, image in images.items():
        _, encoded = cv2.imencode(".png", image)
        write_atomically(folder / kind / name, encoded.tobytes())
