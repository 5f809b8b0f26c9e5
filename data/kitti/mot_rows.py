"""Rows of MOTChallenge's result files, which have no class.

    frame,id,left,top,width,height,conf,x,y,z

    1,3,794.27,247.59,71.245,174.88,0.93,-1,-1,-1

Frames count from 1, boxes are in pixels. What stands behind the confidence is of no use for boxes in the image, and may
be missing.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from data.kitti.reading import read_label_lines
from data.kitti.rows import MAX_WHOLE, to_numbers
from perception.errors import LabelError
from perception.types import Float64

_COLUMNS = ("frame", "id", "left", "top", "width", "height", "conf")
_MAX_COLUMNS = 10


def are_mot_rows(row: str) -> bool:
    """Tell by the first row of a text whether it has MOTChallenge's columns, which commas separate."""
    return "," in row


def read_mot_rows(path: Path) -> Float64:
    """Read (N, 7) frame, id, left, top, width, height and confidence, as they stand in the file.

    Raises:
        LabelError: The file cannot be read, or a row has other columns, a frame below 1 or no track.
    """
    rows = [line.split(",") for line in read_label_lines(path)]
    for number, words in enumerate(rows, start=1):
        if not len(_COLUMNS) <= len(words) <= _MAX_COLUMNS:
            expected = f"{len(_COLUMNS)} to {_MAX_COLUMNS} columns with commas between, {', '.join(_COLUMNS)} ..."
            raise LabelError(f"{path} row {number}", expected=expected, found=str(len(words)))
    numbers = to_numbers([words[: len(_COLUMNS)] for words in rows], len(_COLUMNS))
    whole = numbers[:, :2]
    is_bad = ~np.isfinite(numbers)
    is_bad[:, :2] |= (np.abs(whole) > MAX_WHOLE) | (np.rint(whole) != whole)
    _refuse(path, rows, is_bad, "finite numbers, frame and id whole")
    is_bad[:, 0] = numbers[:, 0] < 1
    _refuse(path, rows, is_bad, "frames from 1 on, as MOTChallenge counts")
    is_bad[:, 1] = numbers[:, 1] < 0
    _refuse(path, rows, is_bad, "an id, as tracks have and detections have not")
    is_bad[:, 4:6] = numbers[:, 4:6] < 0
    _refuse(path, rows, is_bad, "a width and a height from 0 on")
    return numbers


def _refuse(path: Path, rows: Sequence[Sequence[str]], is_bad: np.ndarray, expected: str) -> None:
    """Raise an error that names the first bad number, where there is one."""
    for row, column in np.argwhere(is_bad)[:1].tolist():
        found = f"{rows[row][column]!r} as {_COLUMNS[column]}"
        raise LabelError(f"{path} row {row + 1}", expected=expected, found=found)
