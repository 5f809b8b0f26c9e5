"""Metrics of the obstacles of several sequences: Table 7.2, and the objects of Table 3.1."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from perception.evaluation.obstacle_counts import ObstacleCounts, ObstacleSequence
from perception.evaluation.obstacle_measure import ObstacleReport
from perception.evaluation.report import Metric, Report, SummedMetrics, Table, with_total


@dataclass(frozen=True)
class ObjectMotions(SummedMetrics):
    """Numbers of labelled objects that enter the local area, beside those that the thesis prints.

    Attributes:
        static: Number of static objects.
        moving: Number of objects that move in some frame.
        unknown: Number of objects labelled too shortly to tell.
        thesis_static: Number of static objects in Table 3.1.
        thesis_moving: Number of moving objects in Table 3.1.
    """

    static: Annotated[int, Metric("static")]
    moving: Annotated[int, Metric("moving")]
    unknown: Annotated[int, Metric("unknown")]
    thesis_static: Annotated[int, Metric("thesis: static")]
    thesis_moving: Annotated[int, Metric("thesis: moving")]

    @classmethod
    def of(cls, report: ObstacleReport, row: ObstacleSequence) -> "ObjectMotions":
        """Count the objects of one sequence by their motion."""
        motions = list(report.object_motions.values())
        static, moving, unknown = map(motions.count, ("static", "moving", "unknown"))
        return cls(static, moving, unknown, row.static_objects, row.moving_objects)


@dataclass(frozen=True)
class ObstacleSetReport(Report):
    """Metrics of the obstacles of several sequences.

    Attributes:
        sequences: Metrics of each sequence, by its name.
        printed: Sequences of the set as the thesis prints them.
    """

    sequences: Mapping[str, ObstacleReport]
    printed: Sequence[ObstacleSequence]

    @property
    def counts(self) -> dict[str, ObstacleCounts]:
        """Obstacles of each sequence whose truth allows to count them."""
        return {name: one.total for name, one in self.sequences.items() if one.counts}

    @property
    def motions(self) -> dict[str, ObjectMotions]:
        """Labelled objects of each sequence by motion."""
        rows = {row.name: row for row in self.printed}
        return {name: ObjectMotions.of(one, rows[name]) for name, one in self.sequences.items()}

    def tables(self) -> list[Table[Any]]:
        """Return the columns of Table 7.2, the printed ones, and the objects by motion beside Table 3.1."""
        by_title: dict[str, dict[str, ObstacleCounts]] = {}
        for name, counts in self.counts.items():
            title = f"{self.sequences[name].title}, all frames"
            by_title.setdefault(title, {})[name] = counts
        title = "Labelled objects that enter the local area, and those of Table 3.1"
        motions = Table(title, ObjectMotions.columns(), with_total(self.motions), "sequence")
        missing = [f"{name}: {one.missing}" for name, one in self.sequences.items() if one.missing]
        return [
            *(counts_table(title, rows) for title, rows in by_title.items()),
            printed_table(self.printed),
            replace(motions, notes=["", *missing] if missing else ()),
        ]

    def to_json(self) -> dict[str, Any]:
        """Return the metrics by sequence, the sum of their counts, and what the thesis prints."""
        counts = with_total(self.counts)
        return {
            "sequences": {name: one.to_json() for name, one in self.sequences.items()},
            "counts": {name: one.to_json() for name, one in counts.items()},
            "motions": {name: one.to_json() for name, one in with_total(self.motions).items()},
            "thesis": printed_table(self.printed).to_json(),
        }


def counts_table(title: str, rows: Mapping[str, ObstacleCounts]) -> Table[ObstacleCounts]:
    """Return the counts of sequences and their sum."""
    return Table(title, ObstacleCounts.columns(), with_total(rows), heading="sequence")


def printed_table(rows: Sequence[ObstacleSequence]) -> Table[ObstacleCounts]:
    """Return the counts that the thesis prints."""
    title = "Thesis, Table 7.2: 25 scans of each sequence, counted by a person"
    return counts_table(title, {row.name: row.printed for row in rows})


@dataclass(frozen=True)
class CountingReport(Report):
    """Counts of random scans by a person or by exact truth, as a counting sheet holds them.

    Attributes:
        sheet: File of the sheet.
        sequences: Counts of each sequence by its name.
        images: Number of images of the sheet.
        images_counted: Number of these images whose counts are filled in.
        printed: Sequences of the set as the thesis prints them.
    """

    sheet: Path
    sequences: Mapping[str, ObstacleCounts]
    images: int
    images_counted: int
    printed: Sequence[ObstacleSequence]

    def __str__(self) -> str:
        """Return the file, and how many images are counted, in one line."""
        left = self.images - self.images_counted
        advice = "; fill in the empty counts and run the same command again" if left else ""
        return f"{self.sheet}: {self.images_counted} of {self.images} images are counted{advice}"

    def tables(self) -> list[Table[Any]]:
        """Return the counts in the form of Table 7.2, and the printed ones."""
        printed = printed_table(self.printed)
        if not self.sequences:
            return [printed]
        return [
            counts_table("Obstacles of the counting sheet (Table 7.2)", self.sequences),
            printed,
        ]

    def to_json(self) -> dict[str, Any]:
        """Return the counts by sequence and their sum, and what the thesis prints."""
        counts = with_total(self.sequences)
        return {
            "images": self.images,
            "images_counted": self.images_counted,
            "counts": {name: one.to_json() for name, one in counts.items()},
            "thesis": printed_table(self.printed).to_json(),
        }
