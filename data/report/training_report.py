"""The report of a training: curves of the logged values, metrics of the best epoch, configuration."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from data.report.document_parts import document_markup, heading
from data.report.markup import Plots, Section, note_markup, text_markup
from data.report.page import Page
from data.report.plotly_figures import CurveOptions, curves_figure
from data.results.folder import CONFIG
from perception.errors import UsageError
from perception.render.curve_plots import Curve, CurvePanel
from perception.types import Float64

EVENTS = "events.out.tfevents.*"
_METRICS = {
    "metrics.json": "Best epoch",
    "metrics_validate.json": "Validation",
    "metrics_test.json": "Test",
}
_FIRST = ("loss", "moderate", "accuracy")  # of the figures


def is_training(folder: Path) -> bool:
    """Return whether a training was written into a folder."""
    return any(folder.glob(EVENTS)) or (folder / "metrics.json").is_file()


def training_page(folder: Path) -> Page:
    """Return the report of a training.

    Raises:
        UsageError: A file of metrics is damaged.
    """
    plots = Plots()
    figures = [
        plots.add(panel.title, curves_figure(panel, CurveOptions(has_markers=True)))
        for panel in scalar_panels(read_all_scalars(folder))
    ]
    grid = f'<div class="plots">{"".join(figures)}</div>'
    curves = grid if figures else note_markup("No logged values, or TensorBoard is not installed.")
    sections = [Section("Training", curves)]
    for name, title in _METRICS.items():
        if (folder / name).is_file():
            document = _read(folder / name)
            sections.append(Section(title, document_markup(title.lower(), document, plots)))
    config = folder / CONFIG
    text = config.read_text() if config.is_file() else "missing"
    sections.append(Section("Configuration", text_markup(CONFIG, text)))
    command = text.partition("\n")[0].removeprefix("# ")
    return Page(f"Training {folder.resolve().name}", command, sections, plots)


def scalar_panels(scalars: Mapping[str, Mapping[int, float]]) -> list[CurvePanel]:
    """Return a panel for each quantity, with a curve for each stage that logs it.

    Args:
        scalars: Values by step, by name, such as `train/loss` and `validation/loss`.
    """
    by_quantity: dict[str, dict[str, Mapping[int, float]]] = {}
    for name, values in scalars.items():
        stage, _, quantity = name.rpartition("/")
        by_quantity.setdefault(quantity, {})[stage or quantity] = values
    order = sorted(by_quantity, key=lambda one: (one not in _FIRST, one))
    return [
        CurvePanel(
            heading(quantity),
            "step",
            heading(quantity),
            [Curve(stage, *_columns(values)) for stage, values in by_quantity[quantity].items()],
        )
        for quantity in order
    ]


def read_all_scalars(folder: Path) -> dict[str, dict[int, float]]:
    """Return all logged values by step; of a step that was logged twice, the later one counts.

    Without TensorBoard, or without its files, there are none.
    """
    try:
        from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
    except ImportError:
        return {}
    if not any(folder.glob(EVENTS)):
        return {}
    events = EventAccumulator(str(folder), size_guidance={"scalars": 0}).Reload()
    return {
        name: {event.step: event.value for event in events.Scalars(name)}
        for name in events.Tags()["scalars"]
    }


def _columns(values: Mapping[int, float]) -> tuple[Float64, Float64]:
    steps = sorted(values)
    return np.array(steps, np.float64), np.array([values[step] for step in steps], np.float64)


def _read(path: Path) -> dict[str, object]:
    try:
        document: dict[str, object] = json.loads(path.read_text())
    except ValueError as error:
        raise UsageError(path, expected="metrics of a training", found="no JSON") from error
    return document
