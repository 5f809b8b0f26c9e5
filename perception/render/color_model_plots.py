"""Figure of the colour model of a tracked object: region, colours, and mean shift in the image."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from perception.render import palette
from perception.render.figure import new_figure, rgb, save_figure
from perception.render.palette import Color
from perception.tracking.single_object.color_model import (
    bin_colors,
    bins_per_channel_of,
    color_bins,
)
from perception.tracking.single_object.image_region import ImageRegion
from perception.types import Float64, UInt8

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Margin around the outermost outline, as a share of its size.
_MARGIN = 0.15
# Area of the circle of the most discriminative colour, in square points.
_LARGEST_CIRCLE = 260.0
_BACKDROP = (0.82, 0.84, 0.87)


@dataclass(frozen=True)
class ColorModelScene:
    """Colour model of an object in one image.

    Attributes:
        image: (H, W, 3) RGB image.
        regions: Regions of the mean shift in this image, at least one, the last where the object was found.
        measured: (512,) colour ratios of this image.
        filtered: (512,) colour ratios after the filters.
    """

    image: UInt8
    regions: tuple[ImageRegion, ...]
    measured: Float64
    filtered: Float64


def plot_color_model(path: Path, title: str, scene: ColorModelScene) -> None:
    """Draw region and ring, the ratios before and after the filters, and the mean shift (Fig. 5.16)."""
    part = _part(scene)
    figure = new_figure(16.0, 4.6, title)
    region, confidence = figure.add_subplot(1, 4, 1), figure.add_subplot(1, 4, 4)
    _draw_region(region, scene, part)
    for column, name, ratios in (
        (2, "measured in this image", scene.measured),
        (3, "filtered", scene.filtered),
    ):
        axes = figure.add_subplot(1, 4, column, projection="3d")
        _draw_colors(axes, ratios)
        axes.set_title(f"{name}: {np.count_nonzero(ratios)} colours")
    shown = _draw_mean_shift(confidence, scene, part)
    figure.colorbar(shown, ax=confidence, label="confidence", shrink=0.7)
    save_figure(figure, path)


def _part(scene: ColorModelScene) -> tuple[slice, slice]:
    """Return rows and columns of the image around all outlines."""
    outlines_px = np.concatenate([region.outer_px for region in scene.regions])
    low, high = outlines_px.min(axis=0), outlines_px.max(axis=0)
    size_px, margin_px = np.array(scene.image.shape[1::-1]), _MARGIN * (high - low).max()
    left, top = np.clip(low - margin_px, 0, size_px - 1).astype(int).tolist()
    right, bottom = np.clip(high + margin_px, (left + 1, top + 1), size_px).astype(int).tolist()
    return slice(top, bottom), slice(left, right)


def _show(axes: "Axes", image: UInt8 | Float64, part: tuple[slice, slice], **style: Any) -> Any:  # noqa: ANN401
    """Show a part of the image in the image's pixel coordinates, with fixed limits."""
    rows, columns = part
    extent = (columns.start - 0.5, columns.stop - 0.5, rows.stop - 0.5, rows.start - 0.5)
    shown = axes.imshow(image, extent=extent, **style)
    axes.set(xlim=extent[:2], ylim=extent[2:], xlabel="column [px]")
    return shown


def _draw_region(axes: "Axes", scene: ColorModelScene, part: tuple[slice, slice]) -> None:
    _show(axes, scene.image[part], part)
    axes.set_ylabel("row [px]")
    region = scene.regions[-1]
    axes.fill(*region.hull_px.T, color=rgb(palette.INSIDE), alpha=0.22)
    for name, outline_px, color in (
        ("Ω", region.hull_px, palette.INSIDE),
        ("Ω†", region.outer_px, palette.RING),
    ):
        _draw_outline(axes, outline_px, color, label=name, linewidth=2)
    axes.legend(loc="upper right")
    pixels, around = region.is_inside.sum(), region.is_ring.sum()
    axes.set_title(f"object {pixels} px, ring {around} px")


def _draw_colors(axes: Any, ratios: Float64) -> None:  # noqa: ANN401  (its type is known to few)
    """Draw a circle in the colour of each used bin, with the ratio as its area."""
    in_use = np.flatnonzero(ratios)
    colors = bin_colors(bins_per_channel_of(ratios))[in_use]
    axes.scatter(
        *colors.T,
        s=_LARGEST_CIRCLE * ratios[in_use],
        c=colors / 255,
        edgecolors="black",
        linewidths=0.4,
        depthshade=False,
    )
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_pane_color(_BACKDROP)
        axis.set_ticks([0, 128, 256])
    axes.set(xlim=(0, 256), ylim=(0, 256), zlim=(0, 256))
    axes.set(xlabel="red", ylabel="green", zlabel="blue")
    # Room for the outermost label, which the layout ignores.
    axes.set_box_aspect(None, zoom=0.9)
    axes.patch.set_visible(False)


def _draw_mean_shift(axes: "Axes", scene: ColorModelScene, part: tuple[slice, slice]) -> Any:  # noqa: ANN401
    """Draw the confidence of each pixel, and the outlines from the first, dark, to the last, bright."""
    confidence = scene.filtered[color_bins(scene.image[part], bins_per_channel_of(scene.filtered))]
    shown = _show(axes, confidence, part, cmap="gray", vmin=0, vmax=1)
    for number, region in enumerate(scene.regions, 1):
        light = 0.45 + 0.55 * number / len(scene.regions)
        red, green, blue = (int(light * channel) for channel in palette.INSIDE)
        _draw_outline(axes, region.hull_px, (red, green, blue), linewidth=2)
    centers_px = np.array([region.center_px for region in scene.regions])
    axes.plot(
        *centers_px.T, color=rgb(palette.TRACKED_OBJECT), marker="o", markersize=4, linewidth=1.2
    )
    shift_px = np.hypot(*(centers_px[-1] - centers_px[0]))
    axes.set(title=f"{len(scene.regions) - 1} shifts, {shift_px:.1f} px in all", yticks=[])
    return shown


def _draw_outline(axes: "Axes", outline_px: Float64, color: Color, **style: Any) -> None:  # noqa: ANN401
    axes.plot(*np.vstack([outline_px, outline_px[:1]]).T, color=rgb(color), **style)
