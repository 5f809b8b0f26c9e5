"""Tables as text."""

import math
from collections.abc import Sequence

Cell = str | int | float | None


def format_table(title: str, header: Sequence[str], rows: Sequence[Sequence[Cell]]) -> str:
    """Return a title, a header and rows: the first column to the left, all others to the right.

    A float gets three digits after the point, where the caller did not write it otherwise; what is
    unknown is a dash.
    """
    cells = [list(header), *([_text(cell) for cell in row] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = [_line(row, widths) for row in cells]
    rule = "-" * max(map(len, lines))
    return "\n".join([title, lines[0], rule, *lines[1:]])


def percent(part: int, whole: int) -> str | None:
    """Return a share in percent, or None of nothing."""
    return f"{100 * part / whole:.1f} %" if whole else None


def _line(row: Sequence[str], widths: Sequence[int]) -> str:
    first, *others = (
        cell.rjust(width) if column else cell.ljust(width)
        for column, (cell, width) in enumerate(zip(row, widths, strict=True))
    )
    return "  ".join([first, *others])


def _text(cell: Cell) -> str:
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return "-"
    return f"{cell:.3f}" if isinstance(cell, float) else str(cell)
