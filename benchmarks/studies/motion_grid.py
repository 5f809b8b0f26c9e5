"""The thesis' motion grids of one frame: subtraction, suppression, and objects (Fig. 5.10)."""

from pathlib import Path
from typing import Any, Literal

import numpy as np

from benchmarks.studies.report import RESULTS, Study, open_study_drive, publish, value_table
from perception.cli.progress import progress_bar
from perception.datmo.config import AUTHOR, THESIS
from perception.datmo.grid_detector import MotionGridDetector, MotionGrids
from perception.errors import UsageError
from perception.geometry.footprints import Footprints
from perception.pipeline import PipelineConfig
from perception.pipeline.lidar_stages import LidarStages
from perception.render.motion_grid_plots import CameraView, MotionGridScene, plot_motion_grids
from perception.types import Boxes3D, Drive, Frame

Preset = Literal["thesis", "author"]
PRESETS = {"thesis": THESIS, "author": AUTHOR}
_SOURCES = {"thesis": "Table 7.4", "author": "the author's code"}


def motion_grid(
    drive: str,
    *,
    sequence: str | None = None,
    frame: int | None = None,
    preset: Preset = "thesis",
    out: Path = RESULTS / "motion-grid.png",
) -> None:
    """Draw the 2.5D motion grids: subtraction, suppression, and the objects in them (Fig. 5.10).

    Example: trifuse study motion-grid kitti/tracking --sequence 0000 --frame 60

    Args:
        drive: Folder of a drive, with or without a camera, or the word synthetic.
        sequence: Sequence of a tracking folder, such as 0000.
        frame: Number of the newest scan; else the middle of the drive.
        preset: Values of the thesis' Table 7.4, or of its author's code.
        out: Figure; a JSON file with the numbers is written beside it.
    """
    opened = open_study_drive(drive, sequence, images=True)
    publish(study_motion_grid(opened, out, frame=frame, preset=preset), out)


def study_motion_grid(drive: Drive, plot_path: Path, *, frame: int | None, preset: Preset) -> Study:
    """Run the detector up to a frame, draw its grids, and count cells and list objects.

    Raises:
        UsageError: The drive has no such frame.
    """
    config = PRESETS[preset]
    newest = len(drive) // 2 if frame is None else frame
    if not 0 <= newest < len(drive):
        raise UsageError(
            f"frame {newest}",
            expected=f"a frame from 0 to {len(drive) - 1} of {drive.name}",
            found="no such frame",
        )
    detector = MotionGridDetector(drive.sensor, config)
    chain = LidarStages(drive.sensor, PipelineConfig.for_motion())
    first = max(newest - config.background.scans, 0)
    for index in progress_bar(range(first, newest + 1), "motion-grid", delay_s=2):
        last = drive[index]
        _, scan = chain.segment(last)
        found = detector.detect(scan)
    grids, footprints = detector.grids, found.moving
    boxes = axis_aligned_boxes(footprints)
    title = f"2.5D motion grids by {_SOURCES[preset]}, {drive.name} frame {newest}"
    scene = MotionGridScene(grids, boxes, scan.ground, _camera(last, drive))
    plot_motion_grids(plot_path, title, scene)
    counts = _counts(grids)
    cells = value_table(title, "", ("cells",), {name: (n,) for name, n in counts.items()}, "d")
    return Study(
        name="motion-grid",
        repeats="Fig. 5.10",
        table=f"{cells}\n\n{_object_table(footprints, boxes)}",
        numbers={"cells": counts, "objects": _objects(footprints, boxes)},
        conditions={"drive": drive.name, "frame": newest, "preset": preset, "config": config},
    )


def axis_aligned_boxes(footprints: Footprints) -> Boxes3D:
    """Return the boxes around footprints, along the axes of their frame (5.2.2: no orientation)."""
    low_m, high_m = footprints.extents_m(np.zeros(len(footprints)))
    return Boxes3D(
        np.column_stack([(low_m + high_m) / 2, footprints.low_m]),
        np.column_stack([high_m - low_m, footprints.high_m - footprints.low_m]),
        np.zeros(len(footprints)),
    )


def _camera(frame: Frame, drive: Drive) -> CameraView | None:
    calibration = frame.calibration or drive.calibration
    if frame.image is None or calibration is None:
        return None
    return CameraView(frame.image, calibration.image_P_velo)


def _counts(grids: MotionGrids) -> dict[str, int]:
    """Return the number of cells that each step leaves in the area of objects."""
    part = grids.work_cells.part(grids.config.area)
    steps = {
        "occupied": grids.elevation.points[part],
        "above ground, E": grids.elevation.height_m[part],
        "in the map, S": grids.background_m[part],
        "(a) subtraction alone": grids.subtracted_m,
        "(b) after suppression, M": grids.motion_m,
        "after morphology": grids.found.joined,
        "(c) of objects": grids.found.labels,
    }
    return {name: int(np.count_nonzero(step)) for name, step in steps.items()}


def _objects(footprints: Footprints, boxes: Boxes3D) -> list[dict[str, Any]]:
    columns = zip(footprints.centroids_m, boxes.size_m, footprints.points, strict=True)
    return [dict(zip(("centroid_m", "size_m", "points"), row, strict=True)) for row in columns]


def _object_table(footprints: Footprints, boxes: Boxes3D) -> str:
    values = np.column_stack([footprints.centroids_m, boxes.size_m, footprints.points])
    rows = {str(number): row.tolist() for number, row in enumerate(values, start=1)}
    columns = ("ahead [m]", "left [m]", "length [m]", "width [m]", "height [m]", "points")
    return value_table("Objects", "object", columns, rows, ".6g")
