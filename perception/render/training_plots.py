"""How a training went, as PNG."""

from collections.abc import Mapping
from pathlib import Path

from perception.render.plots import new_figure, save_figure
from perception.types import Float64


def plot_accuracies(
    path: Path, title: str, accuracies: Mapping[str, tuple[Float64, Float64]]
) -> None:
    """Draw accuracies over epochs.

    Args:
        path: of the picture.
        title: over it.
        accuracies: training and validation, 0..1, an epoch each, by the name of the training.
    """
    figure = new_figure(7.2, 4.2, title)
    axes = figure.add_subplot()
    for number, (name, (training, validation)) in enumerate(accuracies.items()):
        for part, values, style in (("training", training, "--"), ("validation", validation, "-")):
            epochs = range(1, len(values) + 1)
            axes.plot(
                epochs,
                100 * values,
                style,
                color=f"C{number}",
                marker=".",
                label=f"{name}, {part}",
            )
    axes.grid(alpha=0.25)
    axes.set(xlabel="epoch", ylabel="accuracy, %")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    save_figure(figure, path)
