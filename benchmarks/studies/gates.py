"""Gates and planes of the piecewise ground, from the side (Figs 5.4, 5.5)."""

from pathlib import Path

import numpy as np

from benchmarks.studies.merged_frame import MergedFrame, MergedFrameFlags, read_merged_frame
from benchmarks.studies.report import RESULTS, publish
from perception.evaluation.report import format_table
from perception.obstacles.ground_planes import PiecewisePlanes, PlaneStep, plane_step
from perception.types import Bool, Float

_CLEARANCE_M = 0.2  # d_min of Table 7.1
_HEADER = ("slice", "points", "in gate", "gate z [m]", "δψ [deg]", "δZ [cm]", "accepted")


def gates(drive: str, *, window: MergedFrameFlags, out: Path = RESULTS / "gates.png") -> None:
    """Draw the gates and planes of the thesis' ground from the side (Figs 5.4, 5.5).

    Example: trifuse study gates synthetic

    Args:
        drive: Folder of a drive, or the word synthetic.
        out: Figure; a JSON file with the numbers is written beside it.
    """
    from perception.render.obstacle_plots import GatedCloud, plot_gates

    merged = read_merged_frame(window.open(drive), window)
    points_velo, planes = merged.cloud.points_velo, merged.planes
    is_inlier = passes_gate(points_velo, planes)
    title = f"Gates and planes, {merged.title}"
    plot_gates(out, title, GatedCloud(points_velo, is_inlier, planes, _CLEARANCE_M), merged.area)
    publish(
        out,
        "Figs 5.4, 5.5",
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
    edges = enumerate(planes.edges_m)
    return [plane_step(planes.planes[k], planes.proposed[k + 1], edge_m) for k, edge_m in edges]


def _rows(merged: MergedFrame, is_inlier: Bool) -> list[list[str]]:
    planes, area, rows = merged.planes, merged.area, []
    slices = planes.slice_of(merged.cloud.points_velo[:, 0])
    bounds = [-area.behind_m, *planes.edges_m, area.ahead_m]
    for k, step in enumerate([None, *plane_steps(planes)]):
        change = ("-", "-")
        if step is not None:
            change = (f"{np.degrees(step.angle_rad):.2f}", f"{1e2 * step.step_m:.1f}")
        rows.append(
            [
                f"S{k}  {bounds[k]:.1f} to {bounds[k + 1]:.1f} m",
                str(np.count_nonzero(slices == k)),
                str(np.count_nonzero((slices == k) & is_inlier)),
                "{:.2f} to {:.2f}".format(*planes.gates_m[k]),
                *change,
                "yes" if planes.is_valid[k] else "no",
            ]
        )
    return rows
