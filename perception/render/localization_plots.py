"""Figures of how an object is located in a scan: the ground's removal (Fig. 5.14), and the mean shift (Fig. 5.15)."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from perception.geometry.boxes import corners, edges, points_inside
from perception.geometry.camera import project
from perception.render import palette
from perception.render.figure import new_figure, rgb, save_figure
from perception.render.perspective import chase_camera
from perception.tracking.single_object.config import PitchGroundConfig
from perception.tracking.single_object.localizer import Window
from perception.tracking.single_object.pitch_ground import PitchedPlane, angle_density, side_view
from perception.types import Boxes3D, Float, Float32, Float64, UInt8

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_POINT_COLOR = (0.25, 0.28, 0.33)
_GREEN = (0.10, 0.62, 0.25)
_SIDE_POINTS = 30_000
_VIEW_PX = (1000, 500)  # shape of the view in 3D
_SHOWN_DEG = 4.0  # angles on both sides of the pitch
_ELLIPSE_MARGIN = 1.35  # axes of an ellipse, in extents of the object
_AROUND_M = 3.0  # margin around the windows of a mean shift


@dataclass(frozen=True)
class GroundRemovalScene:
    """Ground of one scan as a plane that pitches, and the object above it.

    Attributes:
        points_velo: (N, 4) points of the scan.
        plane: Ground plane of the filter.
        gate_rad: Interval in which its pitch was searched.
        config: Points that the pitch is found from.
        min_height_m: Height below which points are ground (d_min).
        box_velo: Box of the object.
        image: (H, W, 3) RGB image, or None.
        image_P_velo: (3, 4) projection from the LiDAR frame to pixels, or None.
    """

    points_velo: Float32
    plane: PitchedPlane
    gate_rad: tuple[float, float]
    config: PitchGroundConfig
    min_height_m: float
    box_velo: Boxes3D
    image: UInt8 | None = None
    image_P_velo: Float64 | None = None


def plot_ground_removal(path: Path, title: str, scene: GroundRemovalScene) -> None:
    """Draw the angle of a point, the density of the angles, and the ground that is removed (Fig. 5.14)."""
    figure = new_figure(13.0, 7.4, title)
    grid = figure.add_gridspec(2, 2, height_ratios=(1, 1.25))
    side_m = side_view(scene.points_velo, scene.plane.sensor_height_m, scene.config)
    _draw_angle(figure.add_subplot(grid[0, 0]), side_m, scene)
    _draw_density(figure.add_subplot(grid[0, 1]), side_m, scene)
    has_image = scene.image is not None and scene.image_P_velo is not None
    _draw_removal(figure.add_subplot(grid[1, :1] if has_image else grid[1, :]), scene)
    if has_image:
        _draw_image(figure.add_subplot(grid[1, 1]), scene)
    save_figure(figure, path)


def _draw_angle(axes: "Axes", side_m: Float, scene: GroundRemovalScene) -> None:
    """Draw the points from the side, and the line from the origin to the object's highest point."""
    shown_m = side_m[:: max(len(side_m) // _SIDE_POINTS, 1)]
    _draw_points(axes, shown_m, _POINT_COLOR, 0.5)
    inside = scene.points_velo[points_inside(scene.box_velo, scene.points_velo)[0]]
    top = inside[inside[:, 2].argmax()] if len(inside) else corners(scene.box_velo)[0, 4]
    end_m = (float(top[0]), float(top[2]) + scene.plane.sensor_height_m)
    axes.plot((0, end_m[0]), (0, end_m[1]), color=rgb(palette.INSIDE), marker="o", markersize=4)
    axes.plot((end_m[0], end_m[0]), (0, end_m[1]), color=_POINT_COLOR, linestyle=":")
    angle_deg = np.degrees(np.arctan2(end_m[1], end_m[0]))
    axes.annotate(
        f"point i, θ = {angle_deg:.1f}°",
        end_m,
        xytext=(4, 4),
        textcoords="offset points",
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1},
    )
    reach_m = max(float(side_m[:, 0].max(initial=0.0)), end_m[0])
    rise_m = np.tan(scene.plane.pitch_rad) * reach_m
    axes.plot((0, reach_m), (0, rise_m), color=rgb(palette.STATIC), label="ground at the pitch θρ")
    axes.set(xlabel="x, ahead of the point below the sensor [m]", ylabel="z, stretched [m]")
    axes.set_title("(a) angle of a point seen from the ground below the sensor", loc="left")
    axes.legend(loc="upper right")


def _draw_density(axes: "Axes", side_m: Float, scene: GroundRemovalScene) -> None:
    angles_rad = np.arctan2(side_m[:, 1], side_m[:, 0])
    middles_rad, density = angle_density(angles_rad, scene.config)
    pitch_deg = float(np.degrees(scene.plane.pitch_rad))
    axes.plot(np.degrees(middles_rad), np.radians(density), color=rgb(palette.INSIDE))
    axes.axvline(
        pitch_deg, color=rgb(palette.STATIC), linestyle="--", label=f"pitch θρ = {pitch_deg:.2f}°"
    )
    gate_deg = np.clip(np.degrees(scene.gate_rad), *(pitch_deg + _SHOWN_DEG * np.array([-1, 1])))
    axes.axvspan(*gate_deg, color=_POINT_COLOR, alpha=0.12, label="gate around the prediction")
    axes.set(xlabel="angle [°]", ylabel="density [1/°]")
    axes.set(xlim=(pitch_deg - _SHOWN_DEG, pitch_deg + _SHOWN_DEG))
    axes.set_title(f"(b) density of {len(angles_rad)} angles", loc="left")
    axes.legend(loc="upper right")


def _draw_removal(axes: "Axes", scene: GroundRemovalScene) -> None:
    """Draw the points in 3D, those of the ground red, with an ellipse around the object."""
    view_P_velo = chase_camera(_VIEW_PX)
    pixels, depths_m = project(view_P_velo, scene.points_velo)
    is_ground = scene.plane.distance_m(scene.points_velo) < scene.min_height_m
    for mask, color in ((~is_ground, _POINT_COLOR), (is_ground, rgb(palette.STATIC))):
        _draw_points(axes, pixels[mask & (depths_m > 1)], color, 0.4)
    _draw_ellipse(axes, project(view_P_velo, corners(scene.box_velo)[0])[0], _GREEN)
    axes.set(xlim=(0, _VIEW_PX[0]), ylim=(_VIEW_PX[1], 0), aspect="equal", xticks=[], yticks=[])
    share = np.count_nonzero(is_ground) / max(len(is_ground), 1)
    axes.set_title(f"(c) {share:.0%} of the points are ground, red; the object green", loc="left")


def _draw_image(axes: "Axes", scene: GroundRemovalScene) -> None:
    assert scene.image is not None
    assert scene.image_P_velo is not None
    axes.imshow(scene.image)
    limits = axes.get_xlim(), axes.get_ylim()
    outline_px = project(scene.image_P_velo, corners(scene.box_velo)[0])[0]
    _draw_ellipse(axes, outline_px, rgb(palette.STATIC))
    axes.set(xlim=limits[0], ylim=limits[1], xticks=[], yticks=[])
    axes.set_title("the object in the image", loc="left")


def _draw_points(
    axes: "Axes", points: Float, color: tuple[float, float, float], size: float
) -> None:
    """Draw the first two columns of (N, 2+) points."""
    axes.scatter(points[:, 0], points[:, 1], s=size, color=color, linewidths=0)


def _draw_ellipse(axes: "Axes", pixels: Float64, color: tuple[float, float, float]) -> None:
    """Draw an ellipse around pixels; nothing where one of them is behind the camera."""
    from matplotlib.patches import Ellipse

    if not np.isfinite(pixels).all():
        return
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    width, height = _ELLIPSE_MARGIN * (high - low)
    middle = ((low + high) / 2).tolist()
    axes.add_patch(Ellipse(middle, width, height, fill=False, color=color, linewidth=2))


@dataclass(frozen=True)
class PointMeanShiftScene:
    """Mean shift of a window over the obstacle points of one scan.

    Attributes:
        points_world: (N, 3) obstacle points.
        windows: Windows from the predicted to the converged one, at least one.
        box_height_m: Height of the object's box.
    """

    points_world: Float64
    windows: Sequence[Window]
    box_height_m: float


def plot_point_mean_shift(path: Path, title: str, scene: PointMeanShiftScene) -> None:
    """Draw the windows of a mean shift in bird's-eye view and from above, the last one brightest (Fig. 5.15)."""
    figure = new_figure(13.0, 5.6, title)
    birds_eye: Any = figure.add_subplot(1, 2, 1, projection="3d")
    above = figure.add_subplot(1, 2, 2)
    origin_m, last = scene.windows[0].position_m, scene.windows[-1]
    around = last.scaled(1 + 2 * _AROUND_M / float(last.size_m.max()))
    near = scene.points_world[around.contains(scene.points_world)]
    bottom_m = float(near[:, 2].min()) if len(near) else 0.0
    points_m = near - (*origin_m[:2], bottom_m)
    is_inside = last.contains(near)
    for mask, color, size in ((~is_inside, _POINT_COLOR, 1.5), (is_inside, _GREEN, 4.0)):
        birds_eye.scatter(*points_m[mask].T, s=size, color=color, depthshade=False)
        _draw_points(above, points_m[mask], color, size)
    for number, window in enumerate(scene.windows, 1):
        color = _blue(number / len(scene.windows))
        segments_m = _box_edges(window, scene.box_height_m) - (*origin_m[:2], 0)
        for ends_m in segments_m:
            birds_eye.plot(*ends_m.T, color=color, linewidth=1.4)
        for ends_m in segments_m[:4]:
            above.plot(*ends_m[:, :2].T, color=color, linewidth=1.8)
    centers_m = np.array([window.position_m[:2] - origin_m[:2] for window in scene.windows])
    above.plot(*centers_m.T, color=rgb(palette.TRACKED_OBJECT), marker="o", markersize=4)
    shift_m = float(np.hypot(*centers_m[-1]))
    above.set_title(f"from above: {len(scene.windows) - 1} shifts, {shift_m:.2f} m in all")
    above.set(xlabel="x from the predicted position [m]", ylabel="y [m]", aspect="equal")
    _style_birds_eye(birds_eye, points_m, scene.box_height_m)
    save_figure(figure, path)


def _style_birds_eye(axes: Any, points_m: Float64, height_m: float) -> None:  # noqa: ANN401  (its type is known to few)
    spans_m = np.ptp(points_m[:, :2], axis=0) if len(points_m) else np.ones(2)
    axes.set_box_aspect((*np.maximum(spans_m, 1.0), height_m), zoom=1.1)
    axes.view_init(elev=35, azim=-125)
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title="bird's-eye view")


def _box_edges(window: Window, height_m: float) -> Float64:
    """Return (12, 2, 3) the edges of the box over a window, its bottom at 0 and first."""
    bottom_m = np.array([[*window.position_m[:2], 0.0]])
    size_m = np.array([[*window.size_m, height_m]])
    return np.asarray(edges(Boxes3D(bottom_m, size_m, np.array([window.yaw_rad])))[0])


def _blue(light: float) -> tuple[float, float, float]:
    """Return the blue of an iteration, from dark to bright."""
    red, green, blue = rgb(palette.INSIDE)
    share = 0.35 + 0.65 * light
    return share * red, share * green, share * blue
