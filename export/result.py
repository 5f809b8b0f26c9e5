"""Settings and result of the export of any network."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from data.results.documents import describe_machine, write_json
from data.splits.training_frames import ENTRY
from export.onnx import OPSET
from export.variants import ModelVariant
from perception.atomic_file import write_atomically
from perception.detection.detectors.input_size import InputSize
from perception.evaluation.report import Column, Table
from perception.types import Drive, Frame


@dataclass(frozen=True)
class ExportConfig:
    """Settings of an export.

    Attributes:
        checkpoint: Checkpoint of a training.
        drive: Drive whose frames all variants are compared on, or None.
        frames: Maximum number of frames, spread evenly over the drive.
        int8: Whether to make an 8-bit variant.
        size: Size of the input of the model file, where it may be chosen; None for that of the training.
        progress: Wrapper of the loop over frames that shows their description and number.
    """

    checkpoint: Path
    drive: Drive | None = None
    frames: int = 100
    int8: bool = False
    size: InputSize | None = None
    progress: Callable[[Iterable[Frame], str, int], Iterable[Frame]] = lambda frames, *_: frames

    def read(self, what: str, most: int | None = None) -> Iterator[Frame]:
        """Yield frames of the drive, none without one.

        Args:
            what: Description of the loop.
            most: Maximum number of frames, where it is less than the export's.

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
    """The best of several variants.

    Attributes:
        variant: Name of the variant.
        reason: Reason in words.
    """

    variant: str
    reason: str


@dataclass(frozen=True)
class ExportResult:
    """Model files of a network, compared with it.

    Attributes:
        metadata: Metadata of the model files.
        models: Content of the model files by variant: fp32, and the best of int8 where asked for.
        variants: Torch and all variants that were tried.
        tolerances: Largest allowed difference of the file in full precision, by output.
        choice: Best variant.
        timed_input: Input that the variants were timed with, in words.
        opset: Opset of ONNX.
    """

    metadata: dict[str, str]
    models: dict[str, bytes]
    variants: dict[str, ModelVariant]
    tolerances: dict[str, float]
    choice: ChosenVariant
    timed_input: str
    opset: int = OPSET

    def write(
        self, out: Path, drive: Drive | None, frames: int, stated: Mapping[str, object]
    ) -> list[Path]:
        """Write the report, and the model files where they agree with the checkpoint; return the model files.

        Args:
            out: File of the best variant; the report has the same name and ends in .json.
            drive: Drive that the variants were compared on, or None.
            frames: Maximum number of its frames.
            stated: What the report states besides.

        Raises:
            ModelError: An output is too far from the checkpoint.
            WriteError: A file cannot be written.
        """
        report = {
            **stated,
            "data": drive.name if drive else None,
            "frames": min(frames, len(drive)) if drive else 0,
            "machine": describe_machine(),
            "tolerances": self.tolerances,
            "metadata": {k: text for k, text in self.metadata.items() if k != ENTRY},
            "opset": self.opset,
            "variants": self.variants,
            "choice": self.choice,
        }
        write_json(out.with_suffix(".json"), report)
        self.require_parity(out.name)
        files = []
        for name, model in self.models.items():
            is_chosen = name == self.choice.variant
            file = out if is_chosen else out.with_suffix(f".{name.partition(' ')[0]}.onnx")
            write_atomically(file, model)
            files.append(file)
        return files

    def require_parity(self, where: str) -> None:
        """Validate that the file in full precision agrees with the checkpoint.

        Raises:
            ModelError: an output is too far from it.
        """
        for parity in self.variants["fp32"].parity.values():
            parity.require(self.tolerances, where)

    def tables(self, name: str) -> list[Table[ModelVariant]]:
        """Return size, time and differences, and, where it was measured, average precision of each variant."""
        full = self.variants["fp32"]
        columns = [
            Column[ModelVariant](
                "size [MB]", lambda row: row.size_bytes / 1e6 if row.size_bytes else None, ".2f"
            ),
            Column[ModelVariant]("time [ms]", lambda row: row.fastest_ms, ".1f"),
            *(
                Column(f"{output}, {kind}", partial(_difference, kind, output), ".1e")
                for kind, parity in full.parity.items()
                for output in parity.largest
            ),
        ]
        precision = [
            Column(f"{of_class} {level}", partial(_precision, of_class, level), ".2f")
            for of_class, levels in full.precision.items()
            for level in levels
        ]
        title = f"{name}: {self.timed_input}; largest differences from PyTorch"
        tables = [Table(title, columns, self.variants)]
        if precision:
            title = "average precision [%] by class and IoU"
            tables.append(Table(title, precision, self.variants))
        return tables


def _difference(kind: str, output: str, variant: ModelVariant) -> float | None:
    return variant.parity[kind].largest[output] if variant.parity else None


def _precision(of_class: str, level: str, variant: ModelVariant) -> float:
    return variant.precision[of_class][level]
