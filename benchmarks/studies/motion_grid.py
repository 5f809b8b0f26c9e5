"""The thesis' motion grids of one frame: subtraction, suppression, and objects (Fig. 5.10)."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from benchmarks.studies.merged_frame import existing_frame
from benchmarks.studies.report import RESULTS, DriveOfStudy, formatted_table, publish
from perception.cli.progress import progress_bar
from perception.datmo.config import AUTHOR, THESIS
from perception.pipeline import PipelineConfig
from perception.types import Boxes3D, Drive, Frame

if TYPE_CHECKING:
    from perception.datmo.grid_detector import MotionGrids
    from perception.geometry.footprints import Footprints
    from perception.render.motion_grid_plots import CameraView

Preset = Literal["thesis", "author"]
PRESETS = {"thesis": THESIS, "author": AUTHOR}
_SPECS = {
    **dict.fromkeys(("ahead [m]", "left [m]", "length [m]", "width [m]", "height [m]"), ".3f"),
    "points": ".0f",
}
SOURCES = {"thesis": "Table 7.4", "author": "the author's code"}


def motion_grid(
    drive: str,
    *,
    source: DriveOfStudy,
    frame: int | None = None,
    preset: Preset = "thesis",
    out: Path = RESULTS / "motion-grid.png",
) -> None:
    """Draw the 2.5D motion grids: subtraction, suppression, and the objects in them (Fig. 5.10).

    Example: trifuse study motion-grid kitti/tracking --sequence 0000 --frame 60

    Args:
        drive: Folder of a drive, with or without a camera, or the word synthetic.
        frame: Number of the newest scan; else the middle of the drive.
        preset: Values of the thesis' Table 7.4, or of its author's code.
        out: Figure; a JSON file with the numbers is written beside it.

    Raises:
        UsageError: The drive has no such frame.
    """
    from perception.datmo.grid_detector import MotionGridDetector
    from perception.pipeline.lidar_stages import LidarStages
    from perception.render.motion_grid_plots import MotionGridScene, plot_motion_grids

    opened, config = source.open(drive, images=True), PRESETS[preset]
    newest = existing_frame(opened, frame)
    detector = MotionGridDetector(opened.sensor, config)
    stages = LidarStages(opened.sensor, PipelineConfig.for_motion())
    first = max(newest - config.scans, 0)
    for index in progress_bar(range(first, newest + 1), "motion-grid", delay_s=2):
        last = opened[index]
        _, scan = stages.segment(last)
        footprints = detector.detect(scan).moving
    grids, boxes = detector.grids, axis_aligned_boxes(footprints)
    title = f"2.5D motion grids by {SOURCES[preset]}, {opened.name} frame {newest}"
    plot_motion_grids(out, title, MotionGridScene(grids, boxes, scan.ground, _camera(last, opened)))
    counts = {name: (count,) for name, count in _counts(grids).items()}
    values = np.column_stack([footprints.centroids_m, boxes.size_m, footprints.points])
    objects = {str(number): row for number, row in enumerate(values, start=1)}
    publish(
        out,
        "Fig. 5.10",
        {
            "cells": formatted_table(title, "", {"cells": "d"}, counts),
            "objects": formatted_table("Objects", "object", _SPECS, objects),
        },
        {"drive": opened.name, "frame": newest, "preset": preset, "config": config},
    )


def axis_aligned_boxes(footprints: "Footprints") -> Boxes3D:
    """Return the boxes around footprints, along the axes of their frame (5.2.2: no orientation)."""
    low_m, high_m = footprints.extents_m(np.zeros(len(footprints)))
    return Boxes3D(
        np.column_stack([(low_m + high_m) / 2, footprints.low_m]),
        np.column_stack([high_m - low_m, footprints.high_m - footprints.low_m]),
        np.zeros(len(footprints)),
    )


def _camera(frame: Frame, drive: Drive) -> "CameraView | None":
    from perception.render.motion_grid_plots import CameraView

    calibration = frame.calibration or drive.calibration
    if frame.image is None or calibration is None:
        return None
    return CameraView(frame.image, calibration.image_P_velo)


def _counts(grids: "MotionGrids") -> dict[str, int]:
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
