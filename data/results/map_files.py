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
from perception.types import Calibration, Drive, Frame, MapMethod

_COLUMNS = (
    Column[DenseMaps]("measured [%]", lambda dense: 100 * dense.is_measured.mean(), ".1f"),
    Column[DenseMaps]("filled [%]", lambda dense: 100 * dense.is_filled.mean(), ".1f"),
)


def without_unused_images(drive: RecordedDrive) -> RecordedDrive:
    """Return a drive without the images of those cameras whose calibration has their size."""
    images = None if _is_size_known(drive.calibration) else drive.images
    further = (
        replace(one, images=None) if _is_size_known(one.calibration) else one
        for one in drive.further_cameras.cameras
    )
    return replace(drive, images=images, further_cameras=FurtherCameras(tuple(further)))


def _is_size_known(calibration: Calibration | None) -> bool:
    return calibration is not None and calibration.image_size_px is not None


def write_all_maps(frames: Iterable[Frame], method: MapMethod, folder: ResultsFolder) -> str:
    """Write the maps of frames as each camera sees them; return what is printed.

    Raises:
        PerceptionError: A frame cannot be read or used; the maps before it stay.
    """
    views = (view for frame in frames for view in _named_views(frame))
    dense_maps = started((name, densify(project_frame(one), method)) for name, one in views)
    out, written = folder.prepare(), 0
    for name, dense in dense_maps:
        write_maps(dense, out, f"{name}.png")
        written += 1
    return f"{written} depth and reflectance maps in {out}"


def compare_methods_on(drive: Drive, number: int, method: MapMethod, folder: ResultsFolder) -> str:
    """Write the maps of one frame by a method, and a figure of all methods, as each camera sees it.

    Return the tables that are printed.

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
    methods = sorted(FILL_METHODS, key=lambda name: name != method)
    views = _named_views(frame)
    projected = [project_frame(view) for _, view in views]
    out, tables = folder.prepare(), []
    for (name, view), sparse in zip(views, projected, strict=True):
        by_method = {one: densify(sparse, one) for one in methods}
        write_maps(by_method[method], out, f"{name}.png")
        title = f"{drive.name}, frame {number}" + f", {view.camera}" * (len(views) > 1)
        plot_maps(out / f"maps_{name}.png", title, view.image, sparse, by_method)
        rows = {str(one): dense for one, dense in by_method.items()}
        tables.append(Table(title, _COLUMNS, rows, heading="method").text())
    return "\n\n".join(tables)


def _named_views(frame: Frame) -> list[tuple[str, Frame]]:
    """Return the frame as each camera sees it, by the name of its files: with that of the camera where there are several."""
    if not frame.further_cameras:
        return [(frame.name, frame)]
    return [(f"{frame.name}_{_words_of(view.camera)}", view) for view in frame.views]


def _words_of(camera: str) -> str:
    """Return the name of a camera, which may be a topic, as a part of a file's name."""
    return camera.strip("/").replace("/", "_")


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
