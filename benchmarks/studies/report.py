"""What a study leaves: a picture, the numbers beside it, and a table for people."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from data.results.documents import write_json
from perception import __version__

RESULTS = Path("results") / "study"
"""Where pictures go, unless another place is named."""


@dataclass(frozen=True)
class Study:
    """The outcome of a study.

    Attributes:
        name: as the command calls it.
        repeats: of the thesis, which it repeats.
        table: for people.
        numbers: the same for programs.
        conditions: drive, frames and parameters.
    """

    name: str
    repeats: str
    table: str
    numbers: Any
    conditions: dict[str, Any]


def publish(study: Study, plot_path: Path) -> None:
    """Write the numbers beside the picture, and print the table and where both are."""
    document = {
        "study": study.name,
        "repeats": study.repeats,
        "program": f"trifuse {__version__}",
        "conditions": study.conditions,
        "results": study.numbers,
    }
    numbers = plot_path.with_suffix(".json")
    write_json(numbers, document)
    print(f"{study.table}\n\n{plot_path}\n{numbers}")
