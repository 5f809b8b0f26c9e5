"""`trifuse export`."""

from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from data.results.command_config import SECTION, CommandConfig
from data.splits.parts import Part
from perception.cli.flags import require_split
from perception.errors import UsageError, optional_package

if TYPE_CHECKING:
    from data.recorded_drive import RecordedDrive


def export(
    checkpoint: Path,
    *,
    config: CommandConfig,
    out: Path,
    data: Path | None = None,
    sequence: str | None = None,
    split: Path | None = None,
    part: Part | None = None,
    frames: int = 100,
    int8: bool = False,
    size: str | None = None,
) -> None:
    """Write a trained network as an ONNX file that includes normalisation and box decoding.

    The outputs of PyTorch and of ONNX Runtime are compared on noise and on the frames of a drive; where they differ too
    much, no model is written. A report beside the model has the largest differences and, for a detector, the average
    precision. With --int8 the 8-bit model is written where it is faster and loses at most one percent of it.

    Example: trifuse export runs/dm/best.ckpt --out dm_compact.onnx --data kitti/object --int8

    Args:
        checkpoint: Checkpoint of a training.
        out: ONNX file; the report has the same name and ends in .json.
        data: Drive for calibration, comparison and average precision.
        sequence: Sequence of a tracking folder.
        split: Split file of `trifuse split`, of which one part of the drive is taken; else all frames.
        part: Part of the split: train, val or test; val where none is named.
        frames: Maximum number of frames, spread evenly over the drive.
        int8: Make an 8-bit model too; the one that is not chosen becomes NAME.int8.onnx or NAME.fp32.onnx.
        size: Input size of a detector as HEIGHTxWIDTH in multiples of 32, such as 352x1216; else that of the training.
    """
    from data.results.documents import describe_machine, write_json
    from data.splits.training_frames import ENTRY
    from perception.atomic_file import require_writable, write_atomically
    from perception.cli.progress import progress_bar
    from perception.detection.detectors.input_size import InputSize

    require_split(part, split)
    for flag, is_given in (("--int8", int8), ("--split", split is not None)):
        if is_given and data is None:
            raise UsageError(flag, expected="--data DRIVE beside it", found="none")
    input_size = None if size is None else InputSize.parse(size)
    require_writable(out)
    exporters = _import_exporters()
    drive = None if data is None else _open_part(data, sequence, split, part or "val")
    exported = exporters.export_network(
        exporters.ExportConfig(
            checkpoint, drive, frames, int8=int8, size=input_size, progress=progress_bar
        )
    )
    print("\n\n".join(table.text() for table in exported.tables(out.name)))
    print(f"chosen: {exported.choice.variant}; {exported.choice.reason}")
    write_json(
        out.with_suffix(".json"),
        {
            SECTION: config.values,
            "data": drive.name if drive else None,
            "frames": min(frames, len(drive)) if drive else 0,
            "machine": describe_machine(),
            "tolerances": exported.tolerances,
            "metadata": {k: text for k, text in exported.metadata.items() if k != ENTRY},
            "opset": exported.opset,
            "variants": exported.variants,
            "choice": exported.choice,
        },
    )
    exported.require_parity(out.name)
    for name, model in exported.models.items():
        is_chosen = name == exported.choice.variant
        file = out if is_chosen else out.with_suffix(f".{name.partition(' ')[0]}.onnx")
        write_atomically(file, model)
        print(f"wrote {file}")


def _open_part(data: Path, sequence: str | None, split: Path | None, part: Part) -> "RecordedDrive":
    """Open a drive with the frames of one part of a split, or with all of them."""
    from data.open_drive import open_drive
    from data.splits.files import select_part

    (drive,) = select_part([open_drive(data, sequence=sequence)], split, part)
    return drive


def _import_exporters() -> ModuleType:
    """Import the exporters, which need PyTorch."""
    with optional_package("torch, onnx and onnxscript", needed_for="trifuse export", extra="train"):
        from export import exporters
    return exporters
