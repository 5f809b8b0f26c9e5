"""A run that was stopped, and is to go on."""

from dataclasses import dataclass
from pathlib import Path
from typing import Self

from data.results.checkpoint import Checkpoint
from data.results.command_config import CommandConfig, read_config
from data.results.folder import CONFIG, LATEST, ResultsFolder, command_of
from data.results.run_folder import is_complete
from perception.errors import UsageError
from perception.yaml_text import read_yaml


@dataclass(frozen=True)
class StoppedRun:
    """Results of a run that was killed, interrupted, or ended by an error.

    Attributes:
        folder: Folder of the results.
        checkpoint: Checkpoint to go on from; None where the run was stopped before the first one, and starts again.
    """

    folder: ResultsFolder
    checkpoint: Checkpoint | None

    @classmethod
    def find(cls, path: Path | None, config: CommandConfig) -> Self:
        """Return the stopped run in a folder; one that has left nothing starts.

        Args:
            path: Folder of the results; None for the latest.
            config: Configuration of the run that goes on.

        Raises:
            UsageError: The run was complete, or had another configuration, or the results are of another command.
            DriveError: Its checkpoint is damaged.
        """
        path = LATEST.resolve() if path is None else path
        if (
            command_of(path) != config.command
        ):  # killed before it wrote anything, or of another command
            return cls(ResultsFolder.choose(path, config, overwrite=False), None)
        checkpoint = Checkpoint.read(path)
        if checkpoint is None and is_complete(path):
            raise UsageError(
                f"--resume in {path}",
                expected="a run that was stopped",
                found="one that is complete",
                advice="name another folder, or replace it with --overwrite",
            )
        _require_same(path, config)
        return cls(ResultsFolder(path, config, is_resumed=checkpoint is not None), checkpoint)


def _require_same(path: Path, config: CommandConfig) -> None:
    """Validate that the stopped run had the configuration of the one that goes on."""
    earlier, now = read_config(path / CONFIG), read_yaml(config.text())
    for name in sorted({*earlier, *now}):
        if earlier.get(name) != now.get(name):
            raise UsageError(
                f"--resume in {path}",
                expected="the flags of the run that was stopped",
                found=f"another {name}",
                advice=f"give --config {path / CONFIG} instead of them",
            )
