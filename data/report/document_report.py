"""The report of an evaluation or a benchmark, from its JSON document."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from data.report.document_parts import Document, document_markup, figures_markup
from data.report.markup import Plots, Section, note_markup, table_markup, text_markup
from data.report.page import Page
from data.results.command_config import SECTION
from data.results.documents import yaml_text
from perception.errors import UsageError

# Sections of a document that are no results, by the titles under which a report shows them.
TABLES = "tables"
_STATED = {"data": "Data", "protocol": "Protocol", "networks": "Networks"}


def document_page(document: Document) -> Page:
    """Return the report of a JSON document of `evaluate` or `bench`."""
    plots = Plots()
    measure = str(document.get("measure", "benchmark"))
    title = f"Evaluation: {measure}" if "measure" in document else "Benchmark"
    sections = [Section("Results", _results_markup(measure, document, plots))]
    sections += [
        Section(title, text_markup(name, _text(document[name]), is_open=name == "data"))
        for name, title in _STATED.items()
        if document.get(name)
    ]
    if SECTION in document:
        sections.append(Section("Configuration", text_markup(SECTION, _text(document[SECTION]))))
    stated = [document.get(name) for name in ("program", "drive", "machine", "split")]
    subtitle = " · ".join(str(one) for one in stated if one)
    return Page(title, subtitle, sections, plots)


def read_document(path: Path) -> dict[str, Any]:
    """Read the JSON document of an evaluation or a benchmark.

    Raises:
        UsageError: It cannot be read, or is no such document.
    """
    found = "no JSON"
    try:
        document = json.loads(path.read_text())
        if isinstance(document, dict) and document:
            return document
        found = f"a JSON {type(document).__name__}"
    except OSError as error:
        found = str(error.strerror)
    except ValueError:
        pass
    raise UsageError(path, expected="a JSON report of `evaluate` or `bench`", found=found)


def _results_markup(measure: str, document: Document, plots: Plots) -> str:
    """Return the tables as they were printed, where they are stated, and the figures; else all metrics."""
    results = document.get("results")
    if not isinstance(results, Mapping):
        others = (*_STATED, SECTION, "drive", "machine")
        results = {name: one for name, one in document.items() if name not in others}
    if not (tables := document.get(TABLES)):
        return document_markup(measure, results, plots)
    shown = [
        table_markup(one["title"], one["header"], one["rows"])
        + "".join(note_markup(note) for note in one["notes"] if note)
        for one in tables
    ]
    return figures_markup(measure, results, plots) + "".join(shown)


def _text(value: object) -> str:
    return value if isinstance(value, str) else yaml_text(value)
