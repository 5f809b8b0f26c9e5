"""Sequences on which the thesis evaluates ground and obstacles: Table 3.1, with the counts that Table 7.2 prints.

The thesis prints numbers of frames; each of them is that of one whole sequence of KITTI's tracking benchmark. Which
objects it flagged as static and as moving was never published, only how many.
"""

import csv
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Literal

from perception.errors import DriveError
from perception.evaluation.obstacle_counts import ObstacleCounts, ObstacleSequence

SequenceSet = Literal["table-3.1"]

PRINTED_MDE_M = 0.086  # mean displacement error over all sequences, with m = 6 and eta = 6 (7.1.1)
_PRINTED = "printed_"


def table_rows(name: str) -> list[dict[str, str]]:
    """Return the rows of a CSV file of this package, by the names of its columns."""
    text = (files("data.derived") / name).read_text(encoding="utf-8")
    return list(csv.DictReader(text.splitlines()))


@cache
def table_3_1() -> tuple[ObstacleSequence, ...]:
    """Return the 8 sequences on which the thesis evaluates ground and obstacles."""
    return tuple(_parse(row) for row in table_rows("table_3_1.csv"))


def find_sequences(
    root: Path, set: SequenceSet, sequence: str | None
) -> tuple[list[ObstacleSequence], list[ObstacleSequence]]:
    """Return the sequences of a set that a folder holds, and those that it does not.

    Args:
        root: Folder of tracking sequences.
        set: Name of the set.
        sequence: Name of the only sequence, or None for all.

    Raises:
        DriveError: The folder holds none of them.
    """
    from data.open_drive import sequences_in  # what reads drives is not needed for a flag's type

    asked = [one for one in table_3_1() if sequence is None or one.sequence == sequence.zfill(4)]
    here = sequences_in(root)
    present = [one for one in asked if one.sequence in here]
    if not present:
        names = ", ".join(one.sequence for one in table_3_1())
        raise DriveError(
            root,
            expected=f"KITTI tracking sequences of the set {set}: {names}",
            found=", ".join(name for name in here if name) or "one drive",
            advice=f"name a tracking folder, or evaluate one drive without --set {set}",
        )
    return present, [one for one in asked if one not in present]


def _parse(row: dict[str, str]) -> ObstacleSequence:
    printed = {
        name.removeprefix(_PRINTED): int(value)
        for name, value in row.items()
        if name.startswith(_PRINTED)
    }
    return ObstacleSequence(
        number=int(row["number"]),
        sequence=row["sequence"],
        frames=int(row["frames"]),
        ego_status=row["ego_status"],
        scene=row["scene"],
        types=tuple(row["types"].split()),
        static_objects=int(row["static_objects"]),
        moving_objects=int(row["moving_objects"]),
        printed=ObstacleCounts(**printed),
    )
