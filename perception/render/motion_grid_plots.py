"""Figure of the thesis' motion grids: each step on the camera's image, and the grids from above."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from perception.datmo.grid_detector import MotionGrids
from perception.geometry.boxes import corners
from perception.geometry.camera import project
from perception.render import palette
from perception.render.camera_grid import aspect_of
from perception.render.ego_vehicle import vehicle_outline_m
from perception.render.figure import new_figure, rgb, save_figure
from perception.render.overlay import render_cubes
from perception.types import Boxes3D, Float, Float32, Float64, GroundModel, UInt8, Voxels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage

# Width of the figure, and margins for labels beside and above the panels.
_WIDTH_IN, _BESIDE_IN, _ABOVE_IN = 15.6, 2.0, 1.6
_OPACITY = 0.75
_FACE_LIGHT = np.array([0.82, 0.62, 1.0])
_HIGHEST_M = 2.0
_UNSEEN: palette.Color = (20, 23, 31)
_SEEN_GROUND: palette.Color = (46, 52, 66)
_EXPLAINED: palette.Color = (104, 112, 130)
_DROPPED: palette.Color = (198, 150, 96)
# Corner numbers of a path along the edges of a box that contains each edge.
_BOX_WALK = np.array([0, 1, 2, 3, 0, 4, 5, 1, 5, 6, 2, 6, 7, 3, 7, 4])


@dataclass(frozen=True)
class CameraView:
    """Camera image of the scan.

    Attributes:
        image: (H, W, 3) RGB image.
        image_P_velo: (3, 4) projection from the LiDAR frame.
    """

    image: UInt8
    image_P_velo: Float64


@dataclass(frozen=True)
class MotionGridScene:
    """Motion grids of one scan with its ground and camera.

    Attributes:
        grids: Motion grids of the scan.
        boxes: (T) boxes of the objects, along the axes of the LiDAR frame.
        ground: Ground surface in the LiDAR frame.
        camera: Camera image, or None.
    """

    grids: MotionGrids
    boxes: Boxes3D
    ground: GroundModel
    camera: CameraView | None = None


@dataclass(frozen=True)
class _Step:
    """One step of the method in the region of interest.

    Attributes:
        title: Title of the panel.
        height_m: (X, Y) heights of the remaining cells, 0 elsewhere.
        colors: (X, Y, 3) RGB colours of these cells.
        boxes: (T) boxes of the objects, where the step has them.
    """

    title: str
    height_m: Float32
    colors: UInt8
    boxes: Boxes3D


def plot_motion_grids(path: Path, title: str, scene: MotionGridScene) -> None:
    """Draw subtraction, suppression and objects beside elevation grid, short-term map and motion grid.

    The figure repeats Fig. 5.10 with the grids on the camera's image; without a camera, from above.
    """
    from_above = scene.grids.cells.shape[0] / scene.grids.cells.shape[1]
    shares = (aspect_of(scene.camera.image) if scene.camera else from_above, from_above)
    row_in = (_WIDTH_IN - _BESIDE_IN) / sum(shares)
    figure = new_figure(_WIDTH_IN, 3 * row_in + _ABOVE_IN, title)
    axes = figure.subplots(3, 2, width_ratios=shares)
    for step, panel in zip(_steps(scene.grids, scene.boxes), axes[:, 0], strict=True):
        if scene.camera is None:
            _draw_from_above(panel, scene, step)
        else:
            _draw_on_image(panel, scene.camera, scene.ground, (scene.grids, step))
        panel.set_title(step.title, loc="left")
    part = scene.grids.work_cells.part(scene.grids.config.area)
    heights = _draw_heights(axes[0, 1], scene.grids, scene.grids.elevation.height_m[part])
    _draw_heights(axes[1, 1], scene.grids, scene.grids.background_m[part])
    _draw_heights(axes[2, 1], scene.grids, scene.grids.motion_m)
    titles = "elevation grid E", "short-term map S", "motion grid M and its objects"
    for panel, name in zip(axes[:, 1], titles, strict=True):
        panel.set_title(name, loc="left")
    _outline(axes[2, 1], scene.boxes)
    axes[2, 1].set_xlabel("ahead [m]")
    figure.colorbar(heights, ax=axes[:, 1], label="height [m]", shrink=0.5, pad=0.02, aspect=30)
    save_figure(figure, path)


def _steps(grids: MotionGrids, boxes: Boxes3D) -> list[_Step]:
    """Return the three steps of Fig. 5.10."""
    motion_m, labels = grids.motion_m, grids.found.labels
    stays = np.array([palette.STATIC, palette.MOVING], np.uint8)[(motion_m > 0).astype(int)]
    colors = np.array([palette.track_color(number) for number in range(len(boxes) + 1)], np.uint8)
    # Cells that morphology adds are flat tiles; moving cells keep their height.
    tile_m = np.float32(grids.cells.cell_m / 2)
    joined_m = np.where(grids.found.joined, np.maximum(motion_m, tile_m), 0)
    owners = np.where((labels > 0)[..., None], colors[labels - 1], np.array(_DROPPED, np.uint8))
    return [
        _Step(
            "(a) after subtraction; red: removed by suppression",
            grids.subtracted_m,
            stays,
            Boxes3D.empty(),
        ),
        _Step("(b) after suppression by the neighbourhood", motion_m, stays, Boxes3D.empty()),
        _Step(
            "(c) after morphology and labelling; brown: implausible size",
            joined_m,
            owners,
            boxes,
        ),
    ]


def _draw_on_image(
    axes: "Axes", camera: CameraView, ground: GroundModel, shown: tuple[MotionGrids, _Step]
) -> None:
    """Draw each cell as a column on the ground in the camera's image."""
    grids, step = shown
    height, width = camera.image.shape[:2]
    rows, columns = np.nonzero(step.height_m)
    stack = cell_columns(grids, ground, step.height_m)
    visible = render_cubes(camera.image_P_velo, (width, height), stack)
    tints = step.colors[rows, columns][stack.counts]
    is_cube = visible.is_cube
    lit = tints[visible.cubes[is_cube]] * _FACE_LIGHT[visible.faces[is_cube], None]
    image = camera.image.astype(np.float64)
    image[is_cube] += _OPACITY * (lit - image[is_cube])
    axes.imshow(image.astype(np.uint8))
    for number, box_m in enumerate(corners(step.boxes)):
        pixels, _ = project(camera.image_P_velo, box_m[_BOX_WALK])
        axes.plot(*pixels.T, color=rgb(palette.track_color(number)), linewidth=1.3)
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), xticks=[], yticks=[])
    axes.set_frame_on(False)


def cell_columns(grids: MotionGrids, ground: GroundModel, height_m: Float32) -> Voxels:
    """Return the cells of (X, Y) heights as columns of cubes on the ground; `counts` holds the cell of each cube.

    Args:
        grids: Grids of the scan.
        ground: Ground surface in the LiDAR frame.
        height_m: (X, Y) heights over the ground in the area of reported objects, 0 of cells that are left out.
    """
    rows, columns = np.nonzero(height_m)
    place_m = grids.cells.centers_m(rows, columns)
    above_m = height_m[rows, columns]
    return _cubes(place_m, ground.height_m(place_m) + above_m, above_m, grids.cells.cell_m)


def _cubes(place_m: Float64, tops_m: Float64, height_m: Float32, cell_m: float) -> Voxels:
    """Stack cubes from the top of each cell downwards; `counts` holds the cell of each cube."""
    cubes = np.maximum(np.ceil(height_m / cell_m - 0.01), 1).astype(int)
    cell_of = np.repeat(np.arange(len(cubes)), cubes)
    below = np.arange(len(cell_of)) - np.repeat(np.cumsum(cubes) - cubes, cubes)
    z = tops_m[cell_of] - (below + 0.5) * cell_m
    centers_m = np.column_stack([place_m[cell_of], z]).astype(np.float32)
    return Voxels(centers_m, cell_of, cell_m)


def _draw_from_above(axes: "Axes", scene: MotionGridScene, step: _Step) -> None:
    """Draw the cells of a step over the observed area."""
    image = _backdrop(scene.grids)
    is_shown = step.height_m > 0
    image[is_shown] = step.colors[is_shown]
    _show(axes, scene.grids, image)
    _outline(axes, step.boxes)


def _draw_heights(axes: "Axes", grids: MotionGrids, height_m: Float32) -> "AxesImage":
    """Draw heights in colours over the observed area."""
    _show(axes, grids, _backdrop(grids))
    return _show(axes, grids, np.where(height_m > 0, height_m, np.nan))


def _backdrop(grids: MotionGrids) -> UInt8:
    """Return the (X, Y, 3) dark image of unobserved cells, ground and obstacles."""
    part = grids.work_cells.part(grids.config.area)
    kind = grids.elevation.is_observed[part].astype(int) + (grids.elevation.height_m[part] > 0)
    return np.asarray(np.array([_UNSEEN, _SEEN_GROUND, _EXPLAINED], np.uint8)[kind])


def _show(axes: "Axes", grids: MotionGrids, image: Float | UInt8) -> "AxesImage":
    """Show (X, Y) or (X, Y, 3) cells with ahead to the right and left up."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    (low_x, low_y), (high_x, high_y) = grids.cells.low_m, grids.cells.high_m
    axes.set_ylabel("left [m]")
    axes.fill(*vehicle_outline_m()[:, :2].T, color=rgb(palette.VEHICLE), zorder=2)
    return axes.imshow(
        image.swapaxes(0, 1),
        origin="lower",
        extent=(low_x, high_x, low_y, high_y),
        # Without the darkest end, which is not visible on the background.
        cmap=ListedColormap(colormaps["plasma"](np.linspace(0.25, 1, 256))),
        vmin=0,
        vmax=_HIGHEST_M,
        interpolation="nearest",
    )


def _outline(axes: "Axes", boxes: Boxes3D) -> None:
    for number, box_m in enumerate(corners(boxes)):
        outline = box_m[[0, 1, 2, 3, 0], :2]
        axes.plot(*outline.T, color=rgb(palette.track_color(number)), linewidth=1.3)
