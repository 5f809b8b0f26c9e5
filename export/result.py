"""What is asked of an export, and what it comes to, whatever the network."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from export.onnx import OPSET
from export.variants import ModelVariant
from perception.detection.detectors.input_size import InputSize
from perception.types import Drive, Frame


class Progress(Protocol):
    """Shows how far a loop over frames is, as tqdm does."""

    def __call__(self, frames: Iterable[Frame], what: str, count: int) -> Iterable[Frame]:
        """Return the same frames."""
        ...


def no_progress(frames: Iterable[Frame], what: str, count: int) -> Iterable[Frame]:
    """Show nothing."""
    return frames


@dataclass(frozen=True)
class ExportConfig:
    """What is asked for.

    Attributes:
        checkpoint: that training wrote.
        drive: whose frames all forms are shown, or None.
        frames: of the drive at most, spread evenly over it.
        int8: whether an 8-bit form is wanted, too.
        size: of the pictures that the file shall take, where that may be chosen; None as it was trained.
        progress: shows how far it is.
    """

    checkpoint: Path
    drive: Drive | None = None
    frames: int = 100
    int8: bool = False
    size: InputSize | None = None
    progress: Progress = no_progress

    def read(self, what: str, most: int | None = None) -> Iterator[Frame]:
        """Yield frames of the drive, none without one.

        Args:
            what: is done with them.
            most: of them, where fewer do.

        Raises:
            PerceptionError: a frame cannot be read.
        """
        if self.drive is None:
            return
        drive, total = self.drive, len(self.drive)
        count = min(total, self.frames, most or self.frames)
        indices = np.linspace(0, total - 1, count).round().astype(int).tolist()
        yield from self.progress((drive[index] for index in indices), what, count)


@dataclass(frozen=True)
class ChosenVariant:
    """Which of several forms is the one to use.

    Attributes:
        variant: its name.
        reason: in words.
    """

    variant: str
    reason: str


@dataclass(frozen=True)
class ExportResult:
    """A network as files, and how they compare with it.

    Attributes:
        metadata: what the files say of themselves.
        models: their content by the name of their form: fp32, and the best of int8 where asked for.
        variants: torch and all that were tried.
        tolerances: by output, how far the file in full precision may be from the checkpoint.
        choice: which one is best.
        timed_input: what the forms were timed with, in words.
        opset: of ONNX that they are written in.
    """

    metadata: dict[str, str]
    models: dict[str, bytes]
    variants: dict[str, ModelVariant]
    tolerances: dict[str, float]
    choice: ChosenVariant
    timed_input: str
    opset: int = OPSET

    def require_parity(self, where: str) -> None:
        """Refuse a file in full precision that does not say what the checkpoint says.

        Raises:
            ModelError: an output is too far from it.
        """
        for parity in self.variants["fp32"].parity.values():
            parity.require(self.tolerances, where)
