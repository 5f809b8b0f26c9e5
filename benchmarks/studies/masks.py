"""Counters, log-likelihood ratio and masks of the thesis' static-moving segmentation (Fig. 5.6)."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.studies.merged_frame import MergedFrameFlags, read_merged_frame
from benchmarks.studies.report import RESULTS, formatted_table, publish
from perception.types import PointState

if TYPE_CHECKING:
    from perception.obstacles.motion_counters import MotionCounters


def masks(drive: str, *, window: MergedFrameFlags, out: Path = RESULTS / "masks.png") -> None:
    """Draw the counters, their ratio, and the static and moving masks (Fig. 5.6).

    Example: trifuse study masks synthetic --frame 30

    Args:
        drive: Folder of a drive, or the word synthetic.
        out: Figure; a JSON file with the numbers is written beside it.
    """
    from perception.obstacles.motion_counters import CounterSegmenter
    from perception.render.obstacle_plots import plot_masks

    merged = read_merged_frame(window.open(drive), window)
    segmenter = CounterSegmenter(merged.area)
    voxelized = segmenter.voxelize(merged.window, merged.planes)
    counters, states = segmenter.counters(voxelized), segmenter.segment(voxelized).point_states
    title = f"From counters to masks, {merged.title}"
    plot_masks(out, title, counters, merged.frame.points_velo[states >= PointState.STATIC])
    specs = {"columns": "d", "points in them": "d"}
    publish(
        out,
        "Fig. 5.6",
        {"steps": formatted_table(title, "", specs, _counts(counters))},
        merged.conditions,
    )


def _counts(counters: "MotionCounters") -> dict[str, tuple[int, int]]:
    """Return for each step the number of columns that are not empty, and of the points in them."""
    masks = counters.masks
    steps = {
        "(b) merged": counters.static_before,
        "(c) static after subtraction": counters.static,
        "(d) newest after subtraction": counters.moving,
        "(f) static": counters.static * masks.is_static,
        "(f) moving": counters.moving * masks.is_moving,
    }
    return {name: (int(np.count_nonzero(c)), int(c.sum())) for name, c in steps.items()}
