"""The making of dense maps as a figure: camera, returns, masks, and both maps by each method (Fig. 6.4, B.3)."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from perception.maps.densify import DenseMaps, MapMethod
from perception.maps.encoding import encode_depth, encode_reflectance
from perception.maps.projection import SparseMaps
from perception.render.plots import new_figure, save_figure
from perception.types import UInt8

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MEASURED, _FILLED, _UNKNOWN = (250, 190, 60), (40, 100, 150), (30, 30, 34)
_ROW_IN = 2.35


def plot_maps(
    path: Path,
    title: str,
    image: UInt8 | None,
    sparse: SparseMaps,
    maps: Mapping[MapMethod, DenseMaps],
) -> None:
    """Draw the returns on the image and the masks of the first method, then both maps of each method."""
    figure = new_figure(15.0, _ROW_IN * (len(maps) + 1), title)
    rows = figure.subplots(len(maps) + 1, 2)
    first = next(iter(maps))
    _draw_returns(rows[0, 0], image, sparse)
    rows[0, 1].imshow(mask_picture(maps[first]))
    rows[0, 1].set_title(f"{first}: measured (yellow), filled (blue), not known (black)")
    for (depth, reflectance), (name, dense) in zip(rows[1:], maps.items(), strict=True):
        code = np.ma.masked_where(~dense.is_valid, encode_depth(dense.depth_m))
        depth.imshow(code, cmap="turbo_r", vmin=0, vmax=255)
        depth.set_title(f"depth map, {name}")
        reflectance.imshow(encode_reflectance(dense.reflectance), cmap="gray", vmin=0, vmax=200)
        reflectance.set_title(f"reflectance map, {name}")
    for axes in rows.ravel():
        axes.set_axis_off()
    save_figure(figure, path)


def mask_picture(dense: DenseMaps) -> UInt8:
    """Return an (H, W, 3) picture of what is measured, filled and not known."""
    picture = np.full((*dense.depth_m.shape, 3), _UNKNOWN, np.uint8)
    picture[dense.is_filled] = _FILLED
    picture[dense.is_measured] = _MEASURED
    return picture


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
