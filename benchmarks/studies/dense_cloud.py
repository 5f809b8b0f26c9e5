"""A pole in the merged cloud, by INS alone and after registration (Fig. 5.2)."""

from pathlib import Path

import numpy as np

from benchmarks.studies.report import Study
from benchmarks.studies.thin_objects import cut_out, find_pole
from benchmarks.studies.windows import read_windows, require_ins, thesis_ground
from perception.cli.table import Cell, format_table
from perception.geometry.grids import LocalArea
from perception.obstacles.dense_cloud import merge, register_window
from perception.render.scene_plots import AgedPoints, plot_aged_points
from perception.types import Drive, Float64


def study_dense_cloud(
    drive: Drive,
    plot_path: Path,
    *,
    frame: int | None,
    previous_scans: int,
    place_m: Float64 | None,
) -> Study:
    """Draw the pole three times, and measure how far the scans disagree on where it stands."""
    area = LocalArea()
    windows = read_windows(drive, frame, previous_scans)
    by_ins = require_ins(drive, windows)
    ground = thesis_ground(drive, windows.refined, area, np.random.default_rng(0)).planes
    clouds = {
        "INS alone": merge(by_ins, area),
        "thesis: BGF and ICP": merge(register_window(by_ins), area),
        "default: GICP to a keyframe": merge(windows.refined, area),
    }
    place_m = find_pole(merge(windows.refined, area), ground, area) if place_m is None else place_m
    cutouts = {name: cut_out(cloud, ground, place_m) for name, cloud in clouds.items()}

    disagreement_m = {name: cutout.disagreement_m for name, cutout in cutouts.items()}
    panels = {
        f"{name}\nscans {1e2 * disagreement_m[name]:.1f} cm apart": AgedPoints(
            cutout.points_m, cutout.age
        )
        for name, cutout in cutouts.items()
    }
    title = f"Merged cloud of a thin object, {drive.name} frame {windows.frame.index}"
    plot_aged_points(plot_path, title, panels)
    rows: list[list[Cell]] = [
        [name, len(cutout.age), f"{1e2 * disagreement_m[name]:.1f}"]
        for name, cutout in cutouts.items()
    ]
    heading = f"{title}, at x {place_m[0]:.1f} m, y {place_m[1]:.1f} m"
    return Study(
        name="dense-cloud",
        repeats="Fig. 5.2",
        table=format_table(heading, ("", "points", "scans apart [cm]"), rows),
        numbers={"disagreement_m": disagreement_m, "place_m": place_m},
        conditions={
            "drive": drive.name,
            "frame": windows.frame.index,
            "previous_scans": previous_scans,
            "disagreement": "RMS over the earlier scans of the distance between the median position "
            "of their points within 0.5 m of the place and that of the newest scan's",
        },
    )
