"""Gates and planes of the piecewise ground, from the side (Figs 5.4, 5.5)."""

from pathlib import Path

import numpy as np

from benchmarks.studies.merged_frame import MergedFrame, MergedFrameFlags, read_merged_frame
from benchmarks.studies.report import RESULTS, Study, publish
from perception.evaluation.report import format_table
from perception.obstacles.ground_planes import PiecewisePlanes, PlaneStep, plane_step
from perception.render.obstacle_plots import GatedCloud, plot_gates
from perception.types import Bool, Drive, Float

_CLEARANCE_M = 0.2  # d_min of Table 7.1
_HEADER = ("slice", "points", "in gate", "gate z [m]", "δψ [deg]", "δZ [cm]", "accepted")


def gates(drive: str, *, window: MergedFrameFlags, out: Path = RESULTS / "gates.png") -> None:
    """Draw the gates and planes of the thesis' ground from the side (Figs 5.4, 5.5).

    Example: trifuse study gates synthetic

    Args:
        drive: Folder of a drive, or the word synthetic.
        out: Figure; a JSON file with the numbers is written beside it.
    """
    publish(study_gates(window.open(drive), out, window), out)


def study_gates(drive: Drive, plot_path: Path, flags: MergedFrameFlags) -> Study:
    """Draw one frame's merged cloud with the thesis' gates and planes, and list them."""
    merged = read_merged_frame(drive, flags)
    points_velo, planes = merged.cloud.points_velo, merged.planes
    title = f"Gates and planes, {merged.title}"
    is_inlier = passes_gate(points_velo, planes)
    plot_gates(
        plot_path, title, GatedCloud(points_velo, is_inlier, planes, _CLEARANCE_M), merged.area
    )
    return Study(
        name="gates",
        repeats="Figs 5.4, 5.5",
        table=format_table(title, _HEADER, _rows(merged, is_inlier)),
        numbers={"planes": planes, "steps": plane_steps(planes)},
        conditions=merged.conditions,
    )


def passes_gate(points_velo: Float, planes: PiecewisePlanes) -> Bool:
    """Return which (N, 3+) points lie between the quartile limits of their slice."""
    gates_m = planes.gates_m[planes.slice_of(points_velo[:, 0])]
    return np.asarray((points_velo[:, 2] >= gates_m[:, 0]) & (points_velo[:, 2] <= gates_m[:, 1]))


def plane_steps(planes: PiecewisePlanes) -> list[PlaneStep]:
    """Compare the plane found in each slice after the first with the accepted one before it."""
    return [
        plane_step(planes.planes[k], planes.proposed[k + 1], edge_m)
        for k, edge_m in enumerate(planes.edges_m)
    ]


def _rows(merged: MergedFrame, is_inlier: Bool) -> list[list[str]]:
    planes, area = merged.planes, merged.area
    slices = planes.slice_of(merged.cloud.points_velo[:, 0])
    bounds = [-area.behind_m, *planes.edges_m, area.ahead_m]
    rows = []
    for k, step in enumerate([None, *plane_steps(planes)]):
        low_m, high_m = planes.gates_m[k]
        is_inside = slices == k
        rows.append(
            [
                f"S{k}  {bounds[k]:.1f} to {bounds[k + 1]:.1f} m",
                str(int(is_inside.sum())),
                str(int((is_inside & is_inlier).sum())),
                f"{low_m:.2f} to {high_m:.2f}",
                f"{np.degrees(step.angle_rad):.2f}" if step else "-",
                f"{1e2 * step.step_m:.1f}" if step else "-",
                "yes" if planes.is_valid[k] else "no",
            ]
        )
    return rows
