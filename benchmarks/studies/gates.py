"""The gates and planes of the piecewise ground, from the side (Figs 5.4, 5.5)."""

from pathlib import Path

import numpy as np

from benchmarks.studies.report import Study
from benchmarks.studies.windows import read_windows, thesis_ground
from perception.cli.table import Cell, format_table
from perception.geometry.grids import LocalArea
from perception.obstacles.ground_planes import PiecewisePlanes, PlaneStep, plane_step
from perception.render.scene_plots import GatedCloud, plot_gates
from perception.types import Bool, Drive, Float

_CLEARANCE_M = 0.2  # d_min of Table 7.1


def study_gates(
    drive: Drive, plot_path: Path, *, frame: int | None, previous_scans: int, seed: int
) -> Study:
    """Draw one frame's merged cloud with the thesis' gates and planes, and list them."""
    area = LocalArea()
    windows = read_windows(drive, frame, previous_scans)
    ground = thesis_ground(drive, windows.refined, area, np.random.default_rng(seed))
    is_inlier = passes_gate(ground.points_velo, ground.planes)
    title = f"Gates and planes, {drive.name} frame {windows.frame.index}"
    cloud = GatedCloud(ground.points_velo, is_inlier, ground.planes, _CLEARANCE_M)
    plot_gates(plot_path, title, cloud, area)
    return Study(
        name="gates",
        repeats="Figs 5.4, 5.5",
        table=_table(title, cloud, area),
        numbers={"planes": ground.planes, "steps": plane_steps(ground.planes)},
        conditions={
            "drive": drive.name,
            "frame": windows.frame.index,
            "previous_scans": previous_scans,
            "seed": seed,
            "area": area,
        },
    )


def passes_gate(points_velo: Float, planes: PiecewisePlanes) -> Bool:
    """Tell which (N, 3+) points lie between the quartile limits of their slice."""
    gates_m = planes.gates_m[planes.slice_of(points_velo[:, 0])]
    return np.asarray((points_velo[:, 2] >= gates_m[:, 0]) & (points_velo[:, 2] <= gates_m[:, 1]))


def plane_steps(planes: PiecewisePlanes) -> list[PlaneStep]:
    """Compare the plane found in each slice after the first with the accepted one before it."""
    return [
        plane_step(planes.planes[k], planes.proposed[k + 1], edge_m)
        for k, edge_m in enumerate(planes.edges_m)
    ]


def _table(title: str, cloud: GatedCloud, area: LocalArea) -> str:
    planes = cloud.planes
    slices = planes.slice_of(cloud.points_velo[:, 0])
    bounds = [-area.behind_m, *planes.edges_m, area.ahead_m]
    steps = [None, *plane_steps(planes)]
    rows: list[list[Cell]] = []
    for k, step in enumerate(steps):
        low_m, high_m = planes.gates_m[k]
        inside = slices == k
        rows.append(
            [
                f"S{k}  {bounds[k]:.1f} to {bounds[k + 1]:.1f} m",
                int(inside.sum()),
                int((inside & cloud.is_inlier).sum()),
                f"{low_m:.2f} to {high_m:.2f}",
                f"{np.degrees(step.angle_rad):.2f}" if step else None,
                f"{1e2 * step.step_m:.1f}" if step else None,
                "yes" if planes.is_valid[k] else "no",
            ]
        )
    header = ("slice", "points", "in gate", "gate z [m]", "δψ [deg]", "δZ [cm]", "accepted")
    return format_table(title, header, rows)
