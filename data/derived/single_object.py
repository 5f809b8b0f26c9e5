"""Objects that the thesis tracks: Table 3.2 (8 sequences) and 3D-OTD, Table A.1 (50).

The thesis prints numbers of frames, sizes and types; which KITTI tracks these are follows from them and
from the track lists of the author's released code. Frames are numbered from 0 and both ends are included.

    49 of the 50 sequences of Table A.1 are certain. Of 3, a parked van, 101 of 110 labelled frames are
    meant, not said which. 1 and 2 have their types swapped in print; "C" there holds vans and trucks too.
    12 and 13 are overlapping parts of one track, 23 and 24 parts of another.
    Of Table 3.2, the last frame of 5 is open; 4 is the only track that fits; the others are certain.
    Beside its rows are the errors that Tables 7.6 and 7.7 print of six trackers.

The author's ground offsets, tuned by hand for each sequence, are left out: no tracker here wants them.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

from data.derived.tables import table_rows
from perception.evaluation.single_object.track import ObjectSequence


@cache
def table_3_2() -> tuple[ObjectSequence, ...]:
    """Return the 8 sequences on which the thesis evaluates its fusion tracker."""
    printed: dict[str, dict[str, dict[str, float]]] = {}
    for row in table_rows("tables_7_6_7_7.csv"):
        number, metric = row.pop("number"), row.pop("metric")
        errors = {tracker: float(error) for tracker, error in row.items() if error}
        printed.setdefault(f"3.2 ({number})", {})[metric] = errors
    sequences = _read("table_3_2.csv", "3.2 ({})")
    return tuple(replace(one, printed=printed[one.name]) for one in sequences)


@cache
def table_a_1() -> tuple[ObjectSequence, ...]:
    """Return the 50 sequences of the thesis' benchmark of 3D object tracking in driving environments."""
    return _read("table_a_1.csv", "OTD {}")


def unique_sequences(sequences: Sequence[ObjectSequence]) -> list[ObjectSequence]:
    """Return each sequence once, under all of its names."""
    names: dict[tuple[str, int, int, int], list[ObjectSequence]] = {}
    for one in sequences:
        key = (one.sequence, one.track_id, one.first_frame, one.last_frame)
        names.setdefault(key, []).append(one)
    return [
        replace(
            same[-1],
            name=" = ".join(one.name for one in same),
            stated={key: value for one in same for key, value in one.stated.items()},
            printed={key: errors for one in same for key, errors in one.printed.items()},
        )
        for same in names.values()
    ]


def _read(name: str, title: str) -> tuple[ObjectSequence, ...]:
    return tuple(_parse(row, title) for row in table_rows(name))


def _parse(row: dict[str, str], title: str) -> ObjectSequence:
    return ObjectSequence(
        name=title.format(row.pop("number")),
        sequence=row.pop("sequence"),
        track_id=int(row.pop("track_id")),
        kind=row.pop("kind"),
        first_frame=int(row.pop("first_frame")),
        last_frame=int(row.pop("last_frame")),
        stated=row,
    )
