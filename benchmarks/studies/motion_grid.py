"""The thesis' motion grids of one frame: subtraction, suppression, and things (Fig. 5.10)."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Literal

import numpy as np

from benchmarks.studies.report import Study
from perception.cli.table import Cell, format_table
from perception.datmo.config import AUTHOR, THESIS
from perception.datmo.grid_detector import MotionGridDetector, MotionGrids
from perception.errors import UsageError
from perception.geometry.footprints import Footprints
from perception.pipeline import PipelineConfig
from perception.pipeline.obstacle_chain import ObstacleChain
from perception.render.motion_grid_plots import CameraView, MotionGridScene, plot_motion_grids
from perception.types import Boxes3D, Drive, Frame

Preset = Literal["thesis", "author"]
_CONFIG = {"thesis": THESIS, "author": AUTHOR}
_SOURCES = {"thesis": "Table 7.4", "author": "the author's code"}


def study_motion_grid(
    drive: Drive,
    plot_path: Path,
    progress: Callable[[Iterable[Frame]], Iterable[Frame]],
    *,
    frame: int | None,
    preset: Preset,
) -> Study:
    """Follow the drive up to a frame, draw its grids, and count cells and list things.

    Args:
        drive: with or without a camera.
        plot_path: where it goes.
        progress: shows how far the scans before the frame are.
        frame: which one, else the middle one.
        preset: whose values.
    """
    config = _CONFIG[preset]
    newest = _existing(drive, frame)
    detector = MotionGridDetector(drive.sensor, config)
    chain = ObstacleChain(drive.sensor, PipelineConfig.for_motion())
    first = max(newest - config.background.scans, 0)
    for seen in progress(drive[index] for index in range(first, newest + 1)):
        _, scan = chain.segment(seen)
        found = detector.detect(scan)
    grids = detector.grids
    boxes = axis_aligned_boxes(found.moving)
    title = f"2.5D motion grids by {_SOURCES[preset]}, {drive.name} frame {newest}"
    plot_motion_grids(
        plot_path, title, MotionGridScene(grids, boxes, scan.ground, _camera(seen, drive))
    )
    counts = _counts(grids)
    rows: list[list[Cell]] = [[name, count] for name, count in counts.items()]
    return Study(
        name="motion-grid",
        repeats="Fig. 5.10",
        table=format_table(title, ("", "cells"), rows)
        + "\n\n"
        + _object_table(found.moving, boxes),
        numbers={"cells": counts, "things": _objects(found.moving, boxes)},
        conditions={"drive": drive.name, "frame": newest, "preset": preset, "rules": config},
    )


def axis_aligned_boxes(footprints: Footprints) -> Boxes3D:
    """Return the boxes around things, along the axes of their frame (thesis 5.2.2: no orientation)."""
    low_m, high_m = footprints.extents_m(np.zeros(len(footprints)))
    return Boxes3D(
        np.column_stack([(low_m + high_m) / 2, footprints.low_m]),
        np.column_stack([high_m - low_m, footprints.high_m - footprints.low_m]),
        np.zeros(len(footprints)),
    )


def _existing(drive: Drive, frame: int | None) -> int:
    newest = len(drive) // 2 if frame is None else frame
    if not 0 <= newest < len(drive):
        raise UsageError(
            f"frame {newest}",
            expected=f"a frame from 0 to {len(drive) - 1} of {drive.name}",
            found="none such",
        )
    return newest


def _camera(frame: Frame, drive: Drive) -> CameraView | None:
    calibration = frame.calibration or drive.calibration
    if frame.image is None or calibration is None:
        return None
    return CameraView(frame.image, calibration.image_P_velo)


def _counts(grids: MotionGrids) -> dict[str, int]:
    """Return how many cells each step leaves in the area of objects."""
    part = grids.work_cells.part(grids.config.area)
    steps = {
        "seen": grids.elevation.points[part],
        "standing, E": grids.elevation.height_m[part],
        "in the map, S": grids.background_m[part],
        "(a) subtraction alone": grids.subtracted_m,
        "(b) after suppression, M": grids.motion_m,
        "after morphology": grids.found.joined,
        "(c) of things": grids.found.labels,
    }
    return {name: int(np.count_nonzero(step)) for name, step in steps.items()}


def _objects(footprints: Footprints, boxes: Boxes3D) -> list[dict[str, Any]]:
    return [
        {"centroid_m": centroid_m, "size_m": size_m, "points": points}
        for centroid_m, size_m, points in zip(
            footprints.centroids_m, boxes.size_m, footprints.points, strict=True
        )
    ]


def _object_table(footprints: Footprints, boxes: Boxes3D) -> str:
    header = ("thing", "ahead", "left", "length", "width", "height", "points")
    rows: list[list[Cell]] = [
        [str(number), *map(float, (*centroid_m, *size_m)), int(points)]
        for number, (centroid_m, size_m, points) in enumerate(
            zip(footprints.centroids_m, boxes.size_m, footprints.points, strict=True), start=1
        )
    ]
    return format_table("Things [m]", header, rows)
