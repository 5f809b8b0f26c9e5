"""Rows of objects, which KITTI's labels and results have in common, read as plain numbers.

    [frame id] type truncation occlusion alpha  x1 y1 x2 y2  height width length  x y z  ry  [score]

The tracking benchmark has the first two columns, results have the last.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from data.kitti.reading import read_label_lines
from perception.errors import LabelError
from perception.types import ArrayTable, Float64, Int, Progress

_HEADS = ("frame", "id")
_COLUMNS = (
    *("type", "truncation", "occlusion", "alpha", "x1", "y1", "x2", "y2"),
    *("height", "width", "length", "x", "y", "z", "ry", "score"),
)
MAX_WHOLE = 2**53  # larger integers are not exact


@dataclass(frozen=True)
class ObjectRows(ArrayTable):
    """N rows of some files, one file after the other.

    Attributes:
        files: (N,) index of the file.
        heads: (N, 2) frame and id of the tracking benchmark, else (N, 0).
        types: (N,) class names.
        numbers: (N, 14) numbers after the type, or (N, 15) with scores.
    """

    files: Int
    heads: Annotated[Int, ...]
    types: np.ndarray
    numbers: Annotated[Float64, ...]


def read_object_rows(
    paths: Sequence[Path | None],
    *,
    heads: int = 0,
    has_scores: bool = False,
    allows_more: bool = False,
    progress: Progress = iter,
) -> ObjectRows:
    """Read files in turn; convert all words to numbers at once.

    Args:
        paths: Files, None for an empty one.
        heads: Number of columns before the type: 2 of the tracking benchmark, else 0.
        has_scores: Whether rows end with a score.
        allows_more: Whether rows may have further columns, which are ignored.
        progress: Progress bar around the files.

    Raises:
        LabelError: A file cannot be read, or a row has too few columns or a word that is no number.
    """
    columns = _HEADS[len(_HEADS) - heads :] + _COLUMNS[: None if has_scores else -1]
    rows: list[list[str]] = []
    places: list[tuple[int, int]] = []  # file and row of each
    for file in progress(range(len(paths))):
        path = paths[file]
        lines = [] if path is None else read_label_lines(path)
        for number, words in enumerate(map(str.split, lines), start=1):
            if len(words) < len(columns) or (len(words) > len(columns) and not allows_more):
                raise LabelError(
                    f"{path} row {number}",
                    expected=f"{len(columns)} columns, {columns[0]} to {columns[-1]}",
                    found=f"{len(words)}",
                )
            rows.append(words[: len(columns)])
            places.append((file, number))
    numbers = to_numbers([row[:heads] + row[heads + 1 :] for row in rows], len(columns) - 1)
    is_bad = ~np.isfinite(numbers)
    whole = numbers[:, :heads]
    is_bad[:, :heads] |= (np.abs(whole) > MAX_WHOLE) | (np.rint(whole) != whole)
    for row, column in np.argwhere(is_bad)[:1].tolist():
        file, number = places[row]
        is_head = column < heads
        at = column + (not is_head)
        expected = "whole numbers before the type" if is_head else "finite numbers after the type"
        raise LabelError(
            f"{paths[file]} row {number}",
            expected=f"{expected}, as {columns[at]} is",
            found=repr(rows[row][at]),
        )
    return ObjectRows(
        files=np.array([file for file, _ in places], np.int64),
        heads=numbers[:, :heads].astype(np.int64),
        types=np.array([row[heads] for row in rows], np.str_),
        numbers=numbers[:, heads:],
    )


def to_numbers(rows: list[list[str]], columns: int) -> Float64:
    """Return (N, columns); NaN where a word is no number."""
    try:
        numbers = [list(map(float, row)) for row in rows]
    except ValueError:
        numbers = [list(map(_number_or_nan, row)) for row in rows]
    return np.array(numbers, np.float64).reshape(-1, columns)


def _number_or_nan(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return float("nan")
