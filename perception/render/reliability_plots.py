"""How often detections of a score are right, as PNG."""

from collections.abc import Mapping
from pathlib import Path

from perception.evaluation.detection.reliability import Reliability
from perception.render.plots import new_figure, save_figure


def plot_reliability(path: Path, title: str, measured: Mapping[str, Reliability]) -> None:
    """Draw a curve for each detector over the diagonal that a probability would follow."""
    figure = new_figure(5.6, 5.0, title)
    axes = figure.add_subplot()
    axes.plot([0, 1], [0, 1], color="grey", linewidth=1)
    for name, one in measured.items():
        label = f"{name}: off by {100 * one.expected_error:.1f} points"
        axes.plot(one.scores, one.precision, marker="o", label=label)
    axes.set(xlabel="score", ylabel="share that is right", xlim=(0, 1), ylim=(0, 1.02))
    axes.grid(alpha=0.25)
    axes.legend(loc="upper left", title="expected calibration error")
    save_figure(figure, path)
