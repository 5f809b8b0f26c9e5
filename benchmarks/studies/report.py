"""What the studies share: the drive they read, and the tables and numbers that they write beside the figure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path
from typing import Any

from data.results.documents import write_json
from perception import __version__
from perception.cli.flags import SourceFlags, require_positive
from perception.cli.parser import FlagGroup
from perception.evaluation.report import Column, Table, Value
from perception.sensor import load_sensor
from perception.types import Drive, Float64

RESULTS = Path("results") / "study"
"""Folder of the figures where no other path is given."""

_SYNTHETIC_FRAMES = 40


@dataclass(frozen=True)
class DriveOfStudy(SourceFlags):
    """Drive of a study."""

    def open(self, drive: str, *, images: bool = False) -> Drive:
        """Open a path, or return a synthetic street for the word `synthetic`."""
        if drive == "synthetic":
            from data.synthetic.drive import SyntheticDrive

            sensor = load_sensor(self.sensor or "HDL-64E")
            return SyntheticDrive(_SYNTHETIC_FRAMES, sensor=sensor, images=images)
        from data.open_drive import open_drive

        return open_drive(Path(drive), sequence=self.sequence, config=self.reading, images=images)


@dataclass(frozen=True)
class StreetFlags(FlagGroup):
    """Synthetic drives.

    Attributes:
        frames: Number of frames of each drive.
        seed: Seed of the first drive; the next drives have the seeds after it.
        drives: Number of drives that are measured together.
    """

    frames: int = 80
    seed: int = 0
    drives: int = 1

    def __post_init__(self) -> None:
        """Validate the numbers of frames and drives."""
        require_positive("--frames", self.frames)
        require_positive("--drives", self.drives)

    @property
    def seeds(self) -> range:
        """Seeds of all drives."""
        return range(self.seed, self.seed + self.drives)

    @property
    def title(self) -> str:
        """Words that name the drives."""
        seeds = ", ".join(map(str, self.seeds))
        return f"synthetic drives of seed {seeds}, {self.frames} frames each"


def publish(
    out: Path,
    repeats: str,
    tables: Mapping[str, Table[Any]],
    conditions: Mapping[str, object],
    **details: object,
) -> None:
    """Write the numbers beside the figure, and print the tables and both paths.

    Args:
        out: Figure, named as the study.
        repeats: Figure or table of the thesis that the study repeats.
        tables: Results by their names in the JSON document.
        conditions: Drive, frames and parameters.
        details: Results for the JSON document alone.
    """
    results = {name: table.to_json() for name, table in tables.items()}
    document = {
        "repeats": repeats,
        "program": f"trifuse {__version__}",
        "conditions": conditions,
        "results": {**results, **details},
    }
    write_json(out.with_suffix(".json"), document)
    text = "\n\n".join(table.text() for table in tables.values())
    print(f"{text}\n\n{out}\n{out.with_suffix('.json')}")


def formatted_table(
    title: str,
    heading: str,
    specs: Mapping[str, str],
    rows: Mapping[str, Sequence[Value] | Float64],
) -> Table[Any]:
    """Return a table of rows of values.

    Args:
        title: Title of the table.
        heading: Heading of the names of the rows.
        specs: (C,) format specification of each column by its name with unit, its name in the JSON document too.
        rows: (C,) values by the name of the row.
    """
    columns: list[Column[Any]] = [
        Column(name, itemgetter(place), spec, name)
        for place, (name, spec) in enumerate(specs.items())
    ]
    return Table(title, columns, rows, heading)
