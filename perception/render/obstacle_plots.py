"""Figures of the obstacle stages in one frame: merged cloud, ground gates, motion counters and masks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from perception.geometry.grids import LocalArea
from perception.obstacles.ground_planes import PiecewisePlanes
from perception.obstacles.motion_counters import MotionCounters
from perception.render import palette
from perception.render.figure import new_figure, rgb, save_figure
from perception.types import Bool, Float, Float64, Int, UInt8

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SIDE_POINTS = 60_000


@dataclass(frozen=True)
class AgedPoints:
    """One panel of the merged cloud.

    Attributes:
        points_m: (P, 3) points relative to the object in metres.
        age: (P,) number of scans before the newest, shown as colour.
    """

    points_m: Float
    age: UInt8


def plot_aged_points(path: Path, title: str, panels: Mapping[str, AgedPoints]) -> None:
    """Draw each cloud from the side and from above, with a colour for each scan (Fig. 5.2)."""
    from matplotlib import colormaps
    from matplotlib.colors import BoundaryNorm

    figure = new_figure(3.1 * len(panels) + 0.8, 7.2, title)
    grid = figure.add_gridspec(2, len(panels), height_ratios=(2, 1))
    scans = 1 + max(int(panel.age.max()) for panel in panels.values())
    colors = colormaps["turbo"].resampled(scans)
    norm = BoundaryNorm(np.arange(scans + 1) - 0.5, scans)
    all_axes = []
    for number, (name, panel) in enumerate(panels.items()):
        x, y, z = panel.points_m.T
        side, above = figure.add_subplot(grid[0, number]), figure.add_subplot(grid[1, number])
        dots = side.scatter(x, z, c=panel.age, s=4, cmap=colors, norm=norm)
        above.scatter(x, y, c=panel.age, s=4, cmap=colors, norm=norm)
        side.set_title(name)
        side.set_ylabel("height above ground [m]" if number == 0 else "")
        above.set(
            xlabel="ahead of the object [m]", ylabel="left of the object [m]" if number == 0 else ""
        )
        side.set(xlim=(-0.6, 0.6), ylim=(0, 2.1))
        above.set(xlim=(-0.6, 0.6), ylim=(-0.6, 0.6), aspect="equal")
        all_axes += [side, above]
    bar = figure.colorbar(dots, ax=all_axes, shrink=0.6, ticks=range(scans))
    bar.set_label("scans before the newest")
    save_figure(figure, path)


@dataclass(frozen=True)
class GatedCloud:
    """A merged cloud and its ground.

    Attributes:
        points_velo: (K, 3+) points in the LiDAR frame.
        is_inlier: (K,) mask of the points within the gate of their slice.
        planes: Ground planes of the slices.
        clearance_m: Distance from the ground below which points belong to it in metres, d_min.
    """

    points_velo: Float
    is_inlier: Bool
    planes: PiecewisePlanes
    clearance_m: float


def plot_gates(path: Path, title: str, cloud: GatedCloud, area: LocalArea) -> None:
    """Draw the slices from above and the gates and planes from the side (Figs 5.4, 5.5)."""
    figure = new_figure(11.0, 7.6, title)
    above, side = figure.subplots(2, 1, sharex=True, height_ratios=(1.25, 1))
    points = cloud.points_velo[:: max(len(cloud.points_velo) // _SIDE_POINTS, 1)]
    is_inlier = cloud.is_inlier[:: max(len(cloud.points_velo) // _SIDE_POINTS, 1)]
    outliers, inliers = points[~is_inlier], points[is_inlier]
    slices = cloud.planes.slice_of(inliers[:, 0])
    for axes, vertical in ((above, 1), (side, 2)):
        axes.scatter(*outliers[:, [0, vertical]].T, s=0.4, color=rgb(palette.STATIC), alpha=0.5)
        axes.scatter(*inliers[:, [0, vertical]].T, s=0.6, c=slices, cmap="tab10", vmin=0, vmax=9)
        for edge_m in cloud.planes.edges_m:
            axes.axvline(edge_m, color="black", linewidth=0.6, linestyle=":")
    above.set(ylabel="left [m]", ylim=(-area.side_m, area.side_m))
    above.set_title("merged cloud from above: inliers coloured by slice, outliers red", loc="left")
    _draw_planes(side, cloud, area)
    level = float(np.median(cloud.planes.height_m(np.zeros((1, 2)))))
    side.set(xlabel="ahead [m]", ylabel="z [m], stretched", ylim=(level - 0.6, level + 1.4))
    side.set_title("from the side, planes at y = 0", loc="left")
    side.legend(loc="upper left", ncols=4)
    save_figure(figure, path)


def _draw_planes(axes: "Axes", cloud: GatedCloud, area: LocalArea) -> None:
    """Draw gate, plane, rejected plane and ground threshold of each slice."""
    from matplotlib.patches import Rectangle

    planes = cloud.planes
    bounds = [-area.behind_m, *planes.edges_m, area.ahead_m]
    for number in range(len(planes.planes)):
        start, stop = bounds[number], bounds[number + 1]
        low_m, high_m = planes.gates_m[number]
        label = number == 0
        gate = Rectangle((start, low_m), stop - start, high_m - low_m, fill=False, zorder=3)
        gate.set(edgecolor="black", linewidth=1.1, label="gate" if label else None)
        axes.add_patch(gate)
        x = np.array([start, stop])
        height_m = plane_height_m(planes.planes[number], x)
        axes.plot(x, height_m, color="limegreen", linewidth=2, label="plane" if label else None)
        axes.plot(
            x,
            height_m + cloud.clearance_m,
            color="magenta",
            linestyle="--",
            linewidth=1,
            label="ground threshold" if label else None,
        )
        if not planes.is_valid[number] and np.isfinite(planes.proposed[number]).all():
            rejected = plane_height_m(planes.proposed[number], x)
            axes.plot(x, rejected, color="gray", linestyle="--", label="rejected plane")


def plane_height_m(plane: Float64, x_m: Float64) -> Float64:
    """Return z of the plane a x + b y + c z + d = 0 at y = 0."""
    return np.asarray(-(plane[0] * x_m + plane[3]) / plane[2])


def plot_masks(path: Path, title: str, counters: MotionCounters, points_velo: Float) -> None:
    """Draw the counters, their ratio and the two masks from above (Fig. 5.6)."""
    figure = new_figure(11.0, 10.0, title)
    panels: Sequence[Axes] = figure.subplots(2, 3, sharex=True, sharey=True).ravel()
    panels[0].scatter(points_velo[:, 1], points_velo[:, 0], s=0.3, color="black")
    panels[0].set_title("(a) newest scan above ground")
    _map(
        panels[1], counters, _logarithm(counters.static_before), "(b) log $C_s$ before subtraction"
    )
    _map(panels[2], counters, _logarithm(counters.static), "(c) log $C_s$ after it")
    _map(panels[3], counters, _logarithm(counters.moving), "(d) log $C_d$")
    ratio = np.where((counters.static + counters.moving) > 0, counters.log_ratio, np.nan)
    _map(panels[4], counters, ratio, "(e) log-likelihood ratio R", symmetric=True)
    colors = np.ones((*counters.static.shape, 3))
    colors[counters.masks.is_static] = rgb(palette.STATIC)
    colors[counters.masks.is_moving] = rgb(palette.MOVING)
    _map(panels[5], counters, colors, "(f) static red, moving green")
    for number, axes in enumerate(panels):
        axes.set_aspect("equal")
        axes.set_xlabel("left [m]" if number >= 3 else "")
        axes.set_ylabel("ahead [m]" if number % 3 == 0 else "")
    panels[0].invert_xaxis()
    save_figure(figure, path)


def _map(
    axes: "Axes", counters: MotionCounters, values: Float64, title: str, *, symmetric: bool = False
) -> None:
    low = counters.grid.corner_m[:2]
    high = low + np.array(counters.grid.shape[:2]) * counters.grid.size_m
    limit = float(np.nanmax(np.abs(values), initial=1.0)) if symmetric else None
    image = axes.imshow(
        values,
        origin="lower",
        extent=(low[1], high[1], low[0], high[0]),
        cmap="RdYlGn" if symmetric else "magma_r",
        vmin=-limit if limit else None,
        vmax=limit,
        interpolation="nearest",
    )
    axes.set_title(title)
    if values.ndim == 2:
        axes.figure.colorbar(image, ax=axes, shrink=0.5, location="bottom", pad=0.02)


def _logarithm(counts: Int) -> Float64:
    """Return log10 of the counts, NaN for 0."""
    return np.where(counts > 0, np.log10(np.maximum(counts, 1)), np.nan)
