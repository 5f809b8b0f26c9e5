"""Pages read back: headings, tables, data and figures."""

import json
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from typing import Any


@dataclass
class ReadPage(HTMLParser):
    """Text of a page by element, and the data in it."""

    texts: dict[str, list[str]] = field(default_factory=dict)
    data: dict[str, Any] = field(default_factory=dict)
    links: list[str] = field(default_factory=list)
    ids: list[str] = field(default_factory=list)

    def __post_init__(self):
        super().__init__()
        self._open: list[tuple[str, dict[str, str]]] = []

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self.ids += [values["id"]] if "id" in values else []
        self.links += [v for k, v in values.items() if k in ("src", "href")]
        if tag not in ("meta", "link", "img", "input", "br"):
            self._open.append((tag, values))

    def handle_endtag(self, tag):
        if self._open and self._open[-1][0] == tag:
            self._open.pop()

    def handle_data(self, data):
        tag, values = self._open[-1] if self._open else ("", {})
        if tag == "script" and values.get("type") == "application/json":
            self.data[values["id"]] = json.loads(data)
        elif tag not in ("script", "style") and data.strip():
            self.texts.setdefault(tag, []).append(data.strip())

    @property
    def words(self) -> str:
        return " ".join(word for texts in self.texts.values() for word in texts)


def read_page(page: Path | str) -> ReadPage:
    """Read a page; `convert_charrefs` joins escaped text."""
    reader = ReadPage()
    reader.feed(page.read_text() if isinstance(page, Path) else page)
    return reader


def titles_of(page: ReadPage) -> dict[str, str]:
    """Return the title of each figure by its name in the data."""
    names = [name for name in page.ids if name.startswith("plot-")]
    return dict(zip(names, page.texts.get("figcaption", [])[-len(names) :], strict=False))
