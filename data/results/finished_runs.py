"""Metrics of finished runs in one file, from which a long series of runs goes on where it was stopped."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from data.results.documents import yaml_text
from perception.atomic_file import write_atomically
from perception.errors import UsageError

Metrics = TypeVar("Metrics")


@dataclass(frozen=True)
class FinishedRuns(Generic[Metrics]):
    """Metrics of each finished run; the file is written whole after each.

    Attributes:
        path: JSON file; None to keep nothing on disk.
        configuration: Configuration of the runs as YAML.
        metrics: Metrics of each run by its name, a dataclass of numbers and words.
    """

    path: Path | None
    configuration: str
    metrics: dict[str, Metrics]

    @classmethod
    def open(
        cls, path: Path | None, values: Mapping[str, object], form: type[Metrics]
    ) -> "FinishedRuns[Metrics]":
        """Read the runs of a file, none where there is no such file.

        Args:
            path: JSON file; None to keep nothing on disk.
            values: Configuration of the runs.
            form: Dataclass of the metrics.

        Raises:
            UsageError: The file is damaged, or holds runs of another configuration.
        """
        configuration = yaml_text(values)
        if path is None or not path.exists():
            return cls(path, configuration, {})
        try:
            found: dict[str, Any] = json.loads(path.read_text())
            metrics = {name: form(**one) for name, one in found["runs"].items()}
            is_same = found["configuration"] == configuration
        except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise _unusable(path, f"a damaged file ({type(error).__name__})") from error
        if not is_same:
            raise _unusable(path, "runs of other frames, detectors or seeds")
        return cls(path, configuration, metrics)

    def add(self, name: str, metrics: Metrics) -> None:
        """Add a run and write all."""
        self.metrics[name] = metrics
        if self.path is None:
            return
        runs = {key: dict(vars(one)) for key, one in self.metrics.items()}
        document = {"configuration": self.configuration, "runs": runs}
        write_atomically(self.path, json.dumps(document, indent=1).encode())


def _unusable(path: Path, found: str) -> UsageError:
    return UsageError(
        str(path),
        expected="runs of the same command",
        found=found,
        advice="name another file, or remove this one to make all runs again",
    )
