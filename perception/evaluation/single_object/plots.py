"""Plots of trackers of one object: the thesis' Figs A.1 to A.3, and success and precision of one-pass evaluation."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from perception.evaluation.config import MAX_CENTER_M, MAX_HEADING_DEG, MAX_LOCATION_PX, MIN_OVERLAP
from perception.evaluation.single_object.challenges import Challenge
from perception.evaluation.single_object.measure import SingleObjectReport
from perception.evaluation.single_object.metrics import (
    SingleObjectErrors,
    area_under_curve,
    correct_frames,
    cumulative_success,
    location_curve,
    precision_curve,
    success_curve,
)
from perception.render.curve_plots import Curve, CurvePanel, plot_curves
from perception.types import Float64

# Curve and its value in the legend.
_Draw = Callable[[SingleObjectErrors], tuple[Float64, float]]


def write_plots(folder: Path, title: str, report: SingleObjectReport) -> list[Path]:
    """Write all plots into a folder; return their paths."""
    thresholds_px = np.arange(51.0)

    def location(errors: SingleObjectErrors) -> tuple[Float64, float]:
        is_correct = correct_frames(errors).location
        return location_curve(errors, thresholds_px), is_correct.mean() if len(is_correct) else 0.0

    def success(errors: SingleObjectErrors) -> tuple[Float64, float]:
        curve = success_curve(errors)
        return curve, area_under_curve(curve)

    def precision(errors: SingleObjectErrors) -> tuple[Float64, float]:
        curve = precision_curve(errors)
        return curve, area_under_curve(curve)

    within = f"in brackets: within {MAX_LOCATION_PX:g} px"
    overlaps = ("Success: area under the curve", "3D overlap, at least")
    distances = (
        "Precision: area under the curve, as a share",
        "distance of the centres [m], at most",
    )
    figures = {
        "overlap": f"3D overlap above {MIN_OVERLAP:.0%} (Fig. A.1)",
        "heading": f"heading within {MAX_HEADING_DEG:g}° (Fig. A.2)",
        "location": "location in the image (Fig. A.3)",
        "one_pass": "one-pass evaluation",
    }
    panels = {
        "location": [
            _panel(report, (within, "distance of the centres [px]", "({:.3f})"), 50, location)
        ],
        "one_pass": [
            _panel(report, (*overlaps, "{:.3f}"), 1, success),
            _panel(report, (*distances, "{:.3f}"), MAX_CENTER_M, precision),
        ],
    }
    for name, what in figures.items():
        shown = panels.get(name) or _cumulative_panels(report, name)
        plot_curves(folder / f"{name}.png", f"{title}:\n{what}", shown)
    return [folder / f"{name}.png" for name in figures]


def _cumulative_panels(report: SingleObjectReport, criterion: str) -> list[CurvePanel]:
    """Return a panel of all objects, and one for each challenge that an object has."""

    def draw(errors: SingleObjectErrors) -> tuple[Float64, float]:
        frames = getattr(correct_frames(errors), criterion)
        if not len(frames):
            return np.full(1, np.nan), 0.0
        return cumulative_success(frames), frames.mean()

    panels, x_label = [], "share of the frames of all sequences"
    for one in (None, *Challenge):
        if one is None or report.objects_with(one):
            title = f"sequences{f' with {one}' if one else ''}: {len(report.objects_with(one))}"
            panel = _panel(report, (title, x_label, "{:.3f}"), 1, draw, one)
            panels.append(replace(panel, y_label="correct frames so far, share of all"))
    return panels


def _panel(
    report: SingleObjectReport,
    words: tuple[str, str, str],
    x_last: float,
    draw: _Draw,
    challenge: Challenge | None = None,
) -> CurvePanel:
    """Return the curve of each tracker; words are the title, the x axis, and the format of the legend's value."""
    title, x_label, note = words
    errors = {name: report.errors_of(name, challenge) for name in report.trackers}
    drawn = {name: draw(one) for name, one in errors.items() if one is not None}
    curves = [
        Curve.evenly_spaced(name, y, x_last, note.format(value))
        for name, (y, value) in drawn.items()
        if np.isfinite(y).all()
    ]
    y_label = "share of frames"
    return CurvePanel(title, x_label, y_label, curves, x_limits=(0, x_last), y_limits=(0, 1.02))
