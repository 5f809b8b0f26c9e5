"""Gates and planes of the piecewise ground, from the side (Figs 5.4, 5.5)."""

from pathlib import Path

import numpy as np

from benchmarks.studies.merged_frame import MergedFrame, MergedFrameFlags, read_merged_frame
from benchmarks.studies.report import RESULTS, formatted_table, publish
from perception.evaluation.report import Value
from perception.obstacles.ground_planes import PiecewisePlanes, PlaneStep, plane_step
from perception.types import Bool, Float

_CLEARANCE_M = 0.2  # d_min of Table 7.1
_SPECS = {
    "from [m]": ".1f",
    "to [m]": ".1f",
    "points": "d",
    "in gate": "d",
    "gate low [m]": ".2f",
    "gate high [m]": ".2f",
    "δψ [deg]": ".2f",
    "δZ [cm]": ".1f",
    "accepted": "",
}


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
    rows = _rows(merged, is_inlier)
    publish(
        out,
        "Figs 5.4, 5.5",
        {"slices": formatted_table(title, "slice", _SPECS, rows)},
        merged.conditions,
        planes=planes.planes,
    )


def passes_gate(points_velo: Float, planes: PiecewisePlanes) -> Bool:
    """Return which (N, 3+) points lie between the quartile limits of their slice."""
    gates_m = planes.gates_m[planes.slice_of(points_velo[:, 0])]
    return np.asarray((points_velo[:, 2] >= gates_m[:, 0]) & (points_velo[:, 2] <= gates_m[:, 1]))


def plane_steps(planes: PiecewisePlanes) -> list[PlaneStep]:
    """Compare the plane found in each slice after the first with the accepted one before it."""
    edges = enumerate(planes.edges_m)
    return [plane_step(planes.planes[k], planes.proposed[k + 1], edge_m) for k, edge_m in edges]


def _rows(merged: MergedFrame, is_inlier: Bool) -> dict[str, tuple[Value, ...]]:
    planes, area, rows = merged.planes, merged.area, {}
    slices = planes.slice_of(merged.cloud.points_velo[:, 0])
    bounds_m = [-area.behind_m, *planes.edges_m, area.ahead_m]
    for k, step in enumerate([None, *plane_steps(planes)]):
        change = (None, None) if step is None else (np.degrees(step.angle_rad), 1e2 * step.step_m)
        rows[f"S{k}"] = (
            *bounds_m[k : k + 2],
            np.count_nonzero(slices == k),
            np.count_nonzero((slices == k) & is_inlier),
            *planes.gates_m[k],
            *change,
            "yes" if planes.is_valid[k] else "no",
        )
    return rows
