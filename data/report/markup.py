"""Parts of a page as HTML: sections, tiles, tables, plots; every text is escaped here."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from itertools import count
from typing import Any
from urllib.parse import quote

from data.report.plotly_figures import PlotlyFigure
from perception.evaluation.report import Table


@dataclass(frozen=True)
class Tile:
    """One value of a summary.

    Attributes:
        name: What it is.
        value: Value with its unit.
        note: Line below the value.
        is_bad: Whether it needs attention.
    """

    name: str
    value: str
    note: str = ""
    is_bad: bool = False


@dataclass(frozen=True)
class Section:
    """A section of a page.

    Attributes:
        title: Heading; its words name the section in links, too.
        markup: HTML below the heading.
    """

    title: str
    markup: str

    @property
    def anchor(self) -> str:
        """Name of the section in links."""
        return "-".join(self.title.lower().split())


class Plots:
    """The figures of a page, numbered in the order in which they are added."""

    def __init__(self) -> None:
        self.figures: dict[str, PlotlyFigure] = {}
        self._number = count()

    def add(self, title: str, figure: PlotlyFigure, note: str = "") -> str:
        """Add a figure; return the HTML of its place.

        Args:
            title: Title, also read aloud in place of the figure.
            figure: Figure in Plotly's schema.
            note: Text below the figure.
        """
        name = f"plot-{next(self._number)}"
        self.figures[name] = figure
        below = f'<p class="note">{escape(note)}</p>' if note else ""
        return (
            f'<figure class="plot"><figcaption>{escape(title)}</figcaption>'
            f'<div id="{name}" role="img" aria-label="{escape(title)}"></div>{below}</figure>'
        )


def tiles_markup(tiles: Sequence[Tile]) -> str:
    """Return values beside each other."""
    cells = "".join(
        f'<div class="tile{" bad" if one.is_bad else ""}"><dt>{escape(one.name)}</dt>'
        f"<dd>{escape(one.value)}<small>{escape(one.note)}</small></dd></div>"
        for one in tiles
    )
    return f'<dl class="tiles">{cells}</dl>'


def table_markup(
    title: str,
    header: Sequence[str],
    rows: Sequence[Sequence[str]],
    links: Mapping[str, str] | None = None,
) -> str:
    """Return a table, the first column to the left; it scrolls where the window is narrow.

    Args:
        title: Caption.
        header: Headings of the columns.
        rows: Cells as text.
        links: Files that first cells lead to, by their text.
    """
    head = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in header)
    body = "".join(
        f'<tr><th scope="row">{_linked(first, links or {})}</th>'
        + "".join(f"<td>{escape(cell)}</td>" for cell in others)
        + "</tr>"
        for first, *others in rows
    )
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(title)}"><table>'
        f"<caption>{escape(title)}</caption><thead><tr>{head}</tr></thead>"
        f"<tbody>{body}</tbody></table></div>"
    )


def _linked(text: str, links: Mapping[str, str]) -> str:
    if (place := links.get(text)) is None:
        return escape(text)
    return f'<a href="{escape(quote(place))}">{escape(text)}</a>'


def report_table_markup(table: Table[Any]) -> str:
    """Return a table of a report with its notes."""
    notes = "".join(f'<p class="note">{escape(note)}</p>' for note in table.notes if note)
    return table_markup(table.title, table.header, table.cells) + notes


def text_markup(title: str, text: str, *, is_open: bool = False) -> str:
    """Return a long text, such as a configuration, that is opened by its title."""
    opened = " open" if is_open else ""
    return (
        f"<details{opened}><summary>{escape(title)}</summary>"
        f'<pre tabindex="0">{escape(text)}</pre></details>'
    )


def note_markup(text: str) -> str:
    """Return a paragraph of small text."""
    return f'<p class="note">{escape(text)}</p>'


def json_markup(name: str, document: object) -> str:
    """Return data that the page's script reads by its name."""
    # No text of the data ends the element early.
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return f'<script type="application/json" id="{name}">{text}</script>'


def number_text(value: float | None, spec: str = ".1f", unit: str = "") -> str:
    """Return a number with its unit, a dash where it is unknown."""
    if value is None or not math.isfinite(value):
        return "-"
    return f"{value:{spec}}{f' {unit}' if unit else ''}"
