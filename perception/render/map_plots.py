"""Figure of dense maps: returns, masks, triangulation, and both maps by each method (Fig. 6.4, B.3)."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from perception.maps.densify import DenseMaps
from perception.maps.encoding import encode_depth, encode_reflectance
from perception.maps.projection import SparseMaps
from perception.maps.triangle_filling import triangles_of
from perception.render.figure import new_figure, save_figure
from perception.types import MapMethod, UInt8

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MEASURED, _FILLED, _UNKNOWN = (250, 190, 60), (40, 100, 150), (30, 30, 34)
# Largest width and height of a map, and room for its title.
_MAP_IN, _TITLE_IN = (7.4, 3.6), 0.15


def plot_maps(
    path: Path,
    title: str,
    image: UInt8 | None,
    sparse: SparseMaps,
    maps: Mapping[MapMethod, DenseMaps],
) -> None:
    """Draw the returns on the image and the masks of the first method, then both maps of each method."""
    aspect = sparse.size_px[0] / sparse.size_px[1]
    high_in = min(_MAP_IN[0] / aspect, _MAP_IN[1])
    height_in = (high_in + _TITLE_IN) * (len(maps) + 2)
    figure = new_figure(2 * (high_in * aspect + _TITLE_IN), height_in, title)
    rows = figure.subplots(len(maps) + 2, 2)
    first = next(iter(maps))
    _draw_returns(rows[0, 0], image, sparse)
    rows[0, 1].imshow(mask_image(maps[first]))
    rows[0, 1].set_title(f"{first}: measured (yellow), filled (blue), unknown (black)")
    for axes, box in zip(rows[1], (None, _busiest(sparse)), strict=True):
        _draw_triangles(axes, sparse, box)
    for (depth, reflectance), (name, dense) in zip(rows[2:], maps.items(), strict=True):
        code = np.ma.masked_where(~dense.is_valid, encode_depth(dense.depth_m))
        depth.imshow(code, cmap="turbo_r", vmin=0, vmax=255)
        depth.set_title(f"depth map, {name}")
        reflectance.imshow(encode_reflectance(dense.reflectance), cmap="gray", vmin=0, vmax=200)
        reflectance.set_title(f"reflectance map, {name}")
    for axes in rows.ravel():
        axes.set_axis_off()
    save_figure(figure, path)


def mask_image(dense: DenseMaps) -> UInt8:
    """Return an (H, W, 3) image of the measured, filled and unknown pixels."""
    image = np.full((*dense.depth_m.shape, 3), _UNKNOWN, np.uint8)
    image[dense.is_filled] = _FILLED
    image[dense.is_measured] = _MEASURED
    return image


def _draw_returns(axes: "Axes", image: UInt8 | None, sparse: SparseMaps) -> None:
    width, height = sparse.size_px
    axes.imshow(np.full((height, width, 3), _UNKNOWN, np.uint8) if image is None else image)
    column, row = sparse.pixels.T
    code = encode_depth(sparse.depth_m)
    axes.scatter(column, row, s=0.4, c=code, cmap="turbo_r", vmin=0, vmax=255, linewidths=0)
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
    axes.set_title(
        f"{len(sparse)} returns, {100 * len(sparse) / (width * height):.1f} % of the pixels"
    )


def _busiest(sparse: SparseMaps) -> tuple[int, int, int, int]:
    """Return left, top, right and bottom of the window with the largest variation of depth."""
    width, height = sparse.size_px
    window = max(1, width // 6), max(1, height // 6)
    spread = cv2.boxFilter(sparse.scattered(np.reciprocal(sparse.depth_m)) ** 2, -1, window)
    row, column = np.unravel_index(int(spread.argmax()), spread.shape)
    left = min(max(int(column) - window[0] // 2, 0), width - window[0])
    top = min(max(int(row) - window[1] // 2, 0), height - window[1])
    return left, top, left + window[0], top + window[1]


def _draw_triangles(
    axes: "Axes", sparse: SparseMaps, box: tuple[int, int, int, int] | None
) -> None:
    """Draw the triangulation (Fig. 6.4 b), or what of it lies in a box (c)."""
    left, top, right, bottom = box or (0, 0, *sparse.size_px)
    axes.set(xlim=(left - 0.5, right - 0.5), ylim=(bottom - 0.5, top - 0.5))
    axes.set_aspect("equal")
    axes.set_title("Delaunay triangles" if box is None else f"of columns {left} to {right}")
    corners = triangles_of(sparse)
    if len(corners):
        column, row = sparse.pixels.T
        width_pt = 0.1 if box is None else 0.4
        axes.triplot(column, row, corners, color=(0.2, 0.4, 0.7), linewidth=width_pt)
        code = encode_depth(sparse.depth_m)
        size = 0.1 if box is None else 3
        axes.scatter(column, row, s=size, c=code, cmap="turbo_r", vmin=0, vmax=255, linewidths=0)
