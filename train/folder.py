"""The folder of a training: where its checkpoints are, and what it resumes from."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from perception.errors import UsageError

BEST, LAST = "best.ckpt", "last.ckpt"


@dataclass(frozen=True)
class TrainingFolder:
    """Folder of a training, and what happens there when it starts.

    Attributes:
        out: Folder of checkpoints and events.
        resume: Checkpoint of the same training to resume from.
        on_start: Function that writes the configuration; the first process calls it once nothing can be
            refused any more.
    """

    out: Path
    resume: Path | None = None
    on_start: Callable[[], object] = lambda: None

    @classmethod
    def open(cls, out: Path, resume: str | None, on_start: Callable[[], object]) -> Self:
        """Return the folder of a new or a resumed training.

        Args:
            out: Folder of the training.
            resume: Checkpoint, the word last for that of the folder, or None for a new training.
            on_start: Function that writes the configuration.

        Raises:
            UsageError: a new training is asked for in the folder of another.
        """
        if resume is None and (out / LAST).exists():
            raise UsageError(
                out,
                expected="a folder without a training",
                found=LAST,
                advice="resume it with --resume last, or name another --out",
            )
        if resume is None:
            return cls(out, None, on_start)
        return cls(out, out / LAST if resume == "last" else Path(resume), on_start)

    @property
    def best(self) -> Path:
        """Checkpoint of the best epoch."""
        return self.out / BEST

    @property
    def last(self) -> Path:
        """Checkpoint of the last whole epoch."""
        return self.out / LAST
