"""A page as one HTML file that needs no network: style, scripts, Plotly, figures and images are in it."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib.util import find_spec
from pathlib import Path

from data.report.markup import Plots, Section, json_markup
from perception import __version__
from perception.errors import MissingDependencyError, optional_package

log = logging.getLogger(__name__)

_HERE = Path(__file__).parent
# Forbids every request, so that the page shows the same without a network.
_POLICY = (
    "default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
)


@dataclass(frozen=True)
class Page:
    """Content of a page.

    Attributes:
        title: Heading.
        subtitle: Line below the heading.
        sections: Sections in their order.
        plots: Figures of the sections.
        data: Data of the page's script by name, such as the frames of the player.
    """

    title: str
    subtitle: str
    sections: Sequence[Section]
    plots: Plots
    data: Mapping[str, object] = field(default_factory=dict)

    def text(self) -> str:
        """Return the HTML file.

        Raises:
            MissingDependencyError: Plotly is not installed.
        """
        links = "".join(f'<a href="#{s.anchor}">{escape(s.title)}</a>' for s in self.sections)
        body = "".join(
            f'<section id="{s.anchor}" aria-labelledby="{s.anchor}-title">'
            f'<h2 id="{s.anchor}-title">{escape(s.title)}</h2>{s.markup}</section>'
            for s in self.sections
        )
        data = {"figures": self.plots.figures, **self.data}
        return "\n".join(
            [
                "<!DOCTYPE html>",
                '<html lang="en"><head><meta charset="utf-8">',
                '<meta name="viewport" content="width=device-width, initial-scale=1">',
                f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">',
                f'<meta name="generator" content="trifuse {__version__}">',
                '<meta name="color-scheme" content="light dark"><link rel="icon" href="data:,">',
                f"<title>{escape(self.title)}</title>",
                f"<style>{(_HERE / 'page.css').read_text()}</style></head><body>",
                '<a class="skip" href="#content">Skip to content</a>',
                f"<header><h1>{escape(self.title)}</h1><p>{escape(self.subtitle)}</p></header>",
                f'<nav aria-label="Sections">{links}</nav>',
                f'<main id="content">{body}</main>',
                f"<footer>Written by Trifuse {__version__}</footer>",
                *(json_markup(name, document) for name, document in data.items()),
                f"<script>{_plotly_script()}</script>" if self.plots.figures else "",
                f"<script>{(_HERE / 'plots.js').read_text()}</script>",
                f"<script>{(_HERE / 'player.js').read_text()}</script>",
                "</body></html>\n",
            ]
        )


def can_write_report() -> bool:
    """Return whether the package of the figures is installed; log the line that installs it where it is not."""
    try:
        require_plotly()
    except MissingDependencyError as error:
        log.warning("no report.html: %s", error)
        return False
    return True


def require_plotly() -> None:
    """Validate that the package of the figures is installed; it is imported with the first page.

    Raises:
        MissingDependencyError: It is not.
    """
    with optional_package("plotly", needed_for="the report", extra="report"):
        if find_spec("plotly") is None:
            raise ImportError("No module named 'plotly'")


def _plotly_script() -> str:
    require_plotly()
    from plotly.offline import get_plotlyjs

    return str(get_plotlyjs())
