"""The folder of a training: where its checkpoints are, and which one a subcommand starts from."""

from dataclasses import dataclass
from pathlib import Path

from perception.errors import UsageError

BEST, LAST, CONFIG = "best.ckpt", "last.ckpt", "config.yaml"


@dataclass(frozen=True)
class TrainingFolder:
    """Folder of a training.

    Attributes:
        out: Folder of checkpoints and events.
    """

    out: Path

    @property
    def best(self) -> Path:
        """Checkpoint of the best epoch."""
        return self.out / BEST

    @property
    def last(self) -> Path:
        """Checkpoint of the last whole epoch."""
        return self.out / LAST

    def checkpoint(self, stage: str, given: str | Path | None) -> Path | None:
        """Return the checkpoint that a subcommand starts from.

        Args:
            stage: Subcommand: fit, validate or test.
            given: Checkpoint, the word last for that of the folder, or None: a new training, or the best one.

        Raises:
            UsageError: a new training is asked for in the folder of another.
        """
        if given is not None:
            return self.last if str(given) == "last" else Path(given)
        if stage != "fit":
            return self.best
        if self.last.exists():
            raise UsageError(
                self.out,
                expected="a folder without a training",
                found=LAST,
                advice="resume it with --resume last, or name another --out",
            )
        return None

    def how_to_go_on(self, kind: str) -> str:
        """Return what to do after a training of some kind was stopped."""
        if not self.last.exists():
            return "start again with the same command, as no epoch is complete"
        flags = f"--config {self.out / CONFIG} --out {self.out} --resume last"
        return f"go on with: trifuse train {kind} {flags}"


def config_beside(checkpoint: str | None, out: str | Path) -> list[Path]:
    """Return the configuration that a training has left beside its checkpoint, if there is one.

    Args:
        checkpoint: Checkpoint, the word last for that of the folder, or None.
        out: Folder of the training.
    """
    if checkpoint is None:
        return []
    file = (Path(out) if checkpoint == "last" else Path(checkpoint).parent) / CONFIG
    return [file] if file.exists() else []
