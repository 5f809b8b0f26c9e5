"""Figures of the fusion: rescoring, sizes of the network, and reliability of the scores."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from perception.evaluation.detection.reliability import Reliability
from perception.render import palette
from perception.render.figure import legend_below, new_figure, rgb
from perception.types import MODALITIES, Float64

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_NAMES = dict(zip(MODALITIES, ("color", "depth", "reflectance"), strict=True))


def rescoring_figure(title: str, levels: Float64, overlaps: Float64) -> "Figure":
    """Return the expected overlap of the box of each modality over the three scores (Fig. 7.12).

    Args:
        title: Title of the figure.
        levels: (S,) scores along each axis.
        overlaps: (S, S, S, 3) expected IoU, by the scores of the three modalities in their order.
    """
    figure = new_figure(12.6, 4.4, title)
    places = np.stack(np.meshgrid(levels, levels, levels, indexing="ij"), axis=-1).reshape(-1, 3)
    drawn = None
    axes_of_panels = []
    for column, name in enumerate(_NAMES.values()):
        axes = figure.add_subplot(1, 3, column + 1, projection="3d")
        values = np.clip(overlaps[..., column].ravel(), 0, 1)
        drawn = axes.scatter(*places.T, c=values, cmap="viridis", vmin=0, vmax=1, s=9)
        axes.set_title(f"overlap of the {name} box")
        axes.set(**dict(zip(("xlabel", "ylabel", "zlabel"), _NAMES.values(), strict=True)))
        axes_of_panels.append(axes)
    assert drawn is not None  # there are three
    figure.colorbar(drawn, ax=axes_of_panels, label="expected IoU", shrink=0.7)
    return figure


def sizes_figure(
    title: str,
    one_layer: Mapping[int, tuple[float, float]],
    two_layers: Mapping[tuple[int, int], float],
) -> "Figure":
    """Return the mean squared error over the sizes of the hidden layers (Fig. 7.13).

    Args:
        title: Title of the figure.
        one_layer: Errors of training and validation by the number of neurons.
        two_layers: Errors of validation by the numbers of neurons of both layers; may be empty.
    """
    panels = bool(one_layer) + bool(two_layers)
    figure = new_figure(0.6 + 4.6 * panels, 4.0, title)
    axes_of_panels = iter(figure.subplots(1, panels, squeeze=False)[0])
    if one_layer:
        _draw_one_layer(next(axes_of_panels), one_layer)
    if two_layers:
        _draw_two_layers(next(axes_of_panels), two_layers)
    return figure


def reliability_figure(title: str, found: Mapping[str, Reliability]) -> "Figure":
    """Return the share of correct detections over their score; calibrated scores lie on the diagonal."""
    figure = new_figure(5.2, 5.0, title)
    axes = figure.add_subplot()
    axes.plot([0, 1], [0, 1], color="grey", linewidth=1)
    for number, (name, one) in enumerate(found.items()):
        color = rgb(palette.STAGES[number % len(palette.STAGES)])
        label = f"{name}: error {100 * one.expected_calibration_error:.1f} %"
        axes.plot(one.scores, one.shares, color=color, linewidth=2, label=label)
        sizes = 8 + 120 * one.counts / max(1, one.counts.max(initial=0))
        axes.scatter(one.scores, one.shares, sizes, color=[color])
    axes.set(xlabel="score", ylabel="share of correct detections", xlim=(0, 1), ylim=(0, 1.02))
    axes.grid(alpha=0.25)
    legend_below(axes, columns=2)
    return figure


def _draw_one_layer(axes: "Axes", errors: Mapping[int, tuple[float, float]]) -> None:
    sizes: Sequence[int] = sorted(errors)
    for part, name in enumerate(("training", "validation")):
        color = rgb(palette.STAGES[3 * (1 - part)])
        values = [errors[size][part] for size in sizes]
        axes.plot(sizes, values, "--" if part == 0 else "-", marker=".", color=color, label=name)
    best = min(sizes, key=lambda size: errors[size][1])
    axes.plot(best, errors[best][1], "o", color="red", fillstyle="none", markersize=10)
    axes.set(
        title=f"one hidden layer: best {errors[best][1]:.4f} with {best}",
        xlabel="neurons",
        ylabel="mean squared error",
    )
    axes.grid(alpha=0.25)
    legend_below(axes, columns=2)


def _draw_two_layers(axes: "Axes", errors: Mapping[tuple[int, int], float]) -> None:
    first = sorted({pair[0] for pair in errors})
    second = sorted({pair[1] for pair in errors})
    values = np.array([[errors.get((a, b), np.nan) for b in second] for a in first])
    image = axes.imshow(values, cmap="viridis_r", origin="lower", aspect="auto")
    axes.figure.colorbar(image, ax=axes, label="mean squared error, validation")
    axes.set_xticks(range(len(second)), [str(size) for size in second])
    axes.set_yticks(range(len(first)), [str(size) for size in first])
    best = min(errors, key=lambda pair: errors[pair])
    axes.set(
        title=f"two: best {errors[best]:.4f} with {best[0]} and {best[1]}",
        xlabel="neurons of the second layer",
        ylabel="neurons of the first layer",
    )
