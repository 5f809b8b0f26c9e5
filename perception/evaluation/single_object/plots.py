"""Plots of trackers of one object: the thesis' Figs A.1 to A.3, and success and precision of one-pass evaluation."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from perception.evaluation.single_object.challenges import Challenge
from perception.evaluation.single_object.curves import (
    correct_frames,
    cumulative_success,
    location_curve,
    precision_curve,
    success_curve,
)
from perception.evaluation.single_object.errors import SingleObjectErrors
from perception.evaluation.single_object.measure import SingleObjectReport
from perception.evaluation.single_object.metrics import SingleObjectMetrics
from perception.render.curve_plots import Curve, CurvePanel, plot_curves
from perception.types import Bool, Float64

_LAST_LOCATION_PX = 50


def write_plots(folder: Path, title: str, report: SingleObjectReport) -> list[Path]:
    """Write all plots into a folder; return their paths."""
    config = report.protocol.metrics
    paths = {
        name: folder / f"{name}.png" for name in ("overlap", "heading", "location", "one_pass")
    }
    plot_curves(
        paths["overlap"],
        f"{title}: 3D overlap above {config.overlap:.0%} (Fig. A.1)",
        _cumulative_panels(report, lambda errors: correct_frames(errors, config).overlap),
    )
    plot_curves(
        paths["heading"],
        f"{title}: heading within {config.heading_deg:g}° (Fig. A.2)",
        _cumulative_panels(report, lambda errors: correct_frames(errors, config).heading),
    )
    plot_curves(
        paths["location"],
        f"{title}: location in the image (Fig. A.3)",
        [_location_panel(report)],
    )
    plot_curves(paths["one_pass"], f"{title}: one-pass evaluation", _one_pass_panels(report))
    return list(paths.values())


def _cumulative_panels(
    report: SingleObjectReport, is_correct: Callable[[SingleObjectErrors], Bool]
) -> list[CurvePanel]:
    """Return a panel of all objects, and one for each challenge that an object has."""
    panels = []
    for challenge in (None, *Challenge):
        objects = report.objects_with(challenge)
        if challenge is not None and not objects:
            continue
        correct = {name: is_correct(one) for name, one in _errors(report, challenge).items()}
        correct = {name: frames for name, frames in correct.items() if len(frames)}
        panels.append(
            CurvePanel(
                f"sequences{f' with {challenge}' if challenge else ''}: {len(objects)}",
                "share of the frames of all sequences",
                "correct frames so far, share of all",
                [
                    Curve.evenly_spaced(
                        name, cumulative_success(frames), note=f"{frames.mean():.3f}"
                    )
                    for name, frames in correct.items()
                ],
                x_limits=(0, 1),
                y_limits=(0, 1.02),
            )
        )
    return panels


def _location_panel(report: SingleObjectReport) -> CurvePanel:
    thresholds_px = np.arange(_LAST_LOCATION_PX + 1.0)
    limit_px = report.protocol.metrics.location_px
    return _panel(
        report,
        (f"in brackets: within {limit_px:g} px", "distance of the centres [px]"),
        _LAST_LOCATION_PX,
        lambda errors: location_curve(errors, thresholds_px),
        lambda metrics: f"({metrics.location_success:.3f})",
    )


def _one_pass_panels(report: SingleObjectReport) -> list[CurvePanel]:
    config = report.protocol.metrics
    return [
        _panel(
            report,
            ("Success: area under the curve", "3D overlap, at least"),
            1.0,
            lambda errors: success_curve(errors, config),
            lambda metrics: f"{metrics.success:.3f}",
        ),
        _panel(
            report,
            ("Precision: area under the curve, as a share", "distance of the centres [m], at most"),
            config.max_center_error_m,
            lambda errors: precision_curve(errors, config),
            lambda metrics: f"{metrics.precision:.3f}",
        ),
    ]


def _panel(
    report: SingleObjectReport,
    names: tuple[str, str],
    x_last: float,
    curve: Callable[[SingleObjectErrors], Float64],
    value: Callable[[SingleObjectMetrics], str],
) -> CurvePanel:
    """Return the curves of all objects together; `names` are those of the panel and of its x axis."""
    curves = {name: curve(errors) for name, errors in _errors(report).items()}
    known = {name: one for name, one in curves.items() if np.isfinite(one).all()}
    metrics = {name: report.metrics_of(name) for name in known}
    return CurvePanel(
        names[0],
        names[1],
        "share of frames",
        [
            Curve.evenly_spaced(name, known[name], x_last, "" if one is None else value(one))
            for name, one in metrics.items()
        ],
        x_limits=(0, x_last),
        y_limits=(0, 1.02),
    )


def _errors(
    report: SingleObjectReport, challenge: Challenge | None = None
) -> Mapping[str, SingleObjectErrors]:
    errors = {name: report.errors_of(name, challenge) for name in report.trackers}
    return {name: one for name, one in errors.items() if one is not None}
