"""Counters, log-likelihood ratio and masks of the thesis' static-moving segmentation (Fig. 5.6)."""

from pathlib import Path

import numpy as np

from benchmarks.studies.report import Study
from benchmarks.studies.windows import read_windows, thesis_ground
from perception.cli.table import Cell, format_table
from perception.geometry.grids import LocalArea
from perception.obstacles.motion_counters import CounterSegmenter, MotionCounters
from perception.render.scene_plots import plot_masks
from perception.types import Drive, PointState


def study_masks(
    drive: Drive, plot_path: Path, *, frame: int | None, previous_scans: int, seed: int
) -> Study:
    """Draw every step from the counters to the masks of one frame, and count cells and points."""
    area = LocalArea()
    windows = read_windows(drive, frame, previous_scans)
    planes = thesis_ground(drive, windows.refined, area, np.random.default_rng(seed)).planes
    segmenter = CounterSegmenter(area)
    counters = segmenter.counters(windows.refined, planes)
    states = segmenter.update(windows.refined, planes).point_states
    static_points = windows.frame.points_velo[states >= PointState.STATIC]
    title = f"From counters to masks, {drive.name} frame {windows.frame.index}"
    plot_masks(plot_path, title, counters, static_points)
    counts = _counts(counters)
    rows: list[list[Cell]] = [[name, cells, points] for name, (cells, points) in counts.items()]
    return Study(
        name="masks",
        repeats="Fig. 5.6",
        table=format_table(title, ("", "columns", "points in them"), rows),
        numbers={name: {"columns": c, "points": p} for name, (c, p) in counts.items()},
        conditions={
            "drive": drive.name,
            "frame": windows.frame.index,
            "previous_scans": previous_scans,
            "seed": seed,
            "area": area,
        },
    )


def _counts(counters: MotionCounters) -> dict[str, tuple[int, int]]:
    """Return for each step the columns that are not empty and the points in them."""
    masks = counters.masks
    steps = {
        "(b) merged": counters.static_before,
        "(c) static after subtraction": counters.static,
        "(d) newest after subtraction": counters.moving,
        "(f) static": counters.static * masks.is_static,
        "(f) moving": counters.moving * masks.is_moving,
    }
    return {name: (int(np.count_nonzero(c)), int(c.sum())) for name, c in steps.items()}
