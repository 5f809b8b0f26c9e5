"""The sheet in which a person counts missed and false obstacles of random scans, as a CSV file (7.1.1)."""

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from data.kitti.reading import read_text
from perception.atomic_file import write_atomically
from perception.errors import LabelError
from perception.evaluation.obstacle_counts import ObstacleCounts
from perception.types import Int

_COLUMNS = tuple(field.name for field in fields(ObstacleCounts))
_HEADER = ("sequence", "frame", "image", *_COLUMNS)


@dataclass(frozen=True)
class CountedImage:
    """One row of the sheet.

    Attributes:
        sequence: Name of the sequence.
        frame: Name of the frame.
        image: Name of the image's file, beside the sheet.
        counts: Counts of the image, or None while they are not filled in.
    """

    sequence: str
    frame: str
    image: str
    counts: ObstacleCounts | None


def choose_frames(sequence: str, frames: int, count: int, seed: int) -> Int:
    """Return the random numbers of frames of a sequence, each once and in order; all where there are fewer."""
    random = np.random.default_rng([seed, *sequence.encode()])
    return np.sort(random.permutation(frames)[:count])


def write_counting_sheet(path: Path, rows: Sequence[CountedImage]) -> None:
    """Write the sheet; counts that are not known are left empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_HEADER)
    for row in rows:
        empty = [""] * len(_COLUMNS)
        counts = empty if row.counts is None else [getattr(row.counts, name) for name in _COLUMNS]
        writer.writerow([row.sequence, row.frame, row.image, *counts])
    write_atomically(path, text.getvalue().encode())


def read_counting_sheet(path: Path) -> list[CountedImage]:
    """Read a sheet; rows without any count are not filled in yet.

    Raises:
        LabelError: A column is missing, or a row has some counts but not all, or counts that cannot be.
    """
    reader = csv.DictReader(read_text(path, LabelError, "a counting sheet as text").splitlines())
    missing = {*_HEADER} - {*(reader.fieldnames or ())}
    if missing:
        found = ", ".join(reader.fieldnames or ()) or "an empty file"
        raise LabelError(path, expected=f"the columns {', '.join(_HEADER)}", found=found)
    return [_parse(f"{path} row {number}", row) for number, row in enumerate(reader, start=2)]


def _parse(where: str, row: dict[str, str]) -> CountedImage:
    """Return one row, whose counts are all filled in or all empty."""
    texts = [(row[name] or "").strip() for name in _COLUMNS]
    counts = ObstacleCounts(*(int(text) for text in texts)) if all(map(_is_count, texts)) else None
    if any(texts) and (counts is None or not _is_possible(counts)):
        raise LabelError(
            where,
            expected="whole numbers in all columns, no more moving than obstacles, and no more missed than there are",
            found=", ".join(texts),
            advice="correct the row, or leave all of its counts empty",
        )
    return CountedImage(row["sequence"], row["frame"], row["image"], counts)


def _is_count(text: str) -> bool:
    return text.isascii() and text.isdigit()


def _is_possible(counts: ObstacleCounts) -> bool:
    return (
        counts.moving <= counts.obstacles
        and counts.missed_obstacles <= counts.obstacles
        and counts.missed_moving <= counts.moving
    )
