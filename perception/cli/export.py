"""`trifuse export`."""

from pathlib import Path

from data.results.command_config import SECTION, CommandConfig
from data.splits.parts import Part
from perception.cli.flags import require_split
from perception.errors import UsageError, optional_package


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
        split: Split file of `trifuse split`, of which one part of the drive is taken; all frames by default.
        part: Part of the split: train, val or test; val by default.
        frames: Maximum number of frames, spread evenly over the drive.
        int8: Make an 8-bit model too; the one that is not chosen becomes NAME.int8.onnx or NAME.fp32.onnx.
        size: Input size of a detector as HEIGHTxWIDTH in multiples of 32, such as 352x1216; by default that of the training.
    """
    from data.open_drive import open_drive
    from data.splits.files import select_part
    from perception.atomic_file import require_writable
    from perception.cli.progress import progress_bar
    from perception.detection.detectors.input_size import InputSize

    require_split(part, split)
    for flag, is_given in (("--int8", int8), ("--split", split is not None)):
        if is_given and data is None:
            raise UsageError(flag, expected="--data DRIVE beside it", found="none")
    input_size = None if size is None else InputSize.parse(size)
    require_writable(out)
    with optional_package("torch, onnx and onnxscript", needed_for="trifuse export", extra="train"):
        from export.exporters import export_network
        from export.result import ExportConfig
    drive = None
    if data is not None:
        (drive,) = select_part([open_drive(data, sequence=sequence)], split, part or "val")
    exported = export_network(
        ExportConfig(checkpoint, drive, frames, int8=int8, size=input_size, progress=progress_bar)
    )
    print("\n\n".join(table.text() for table in exported.tables(out.name)))
    print(f"chosen: {exported.choice.variant}; {exported.choice.reason}")
    for file in exported.write(out, drive, frames, {SECTION: config.values}):
        print(f"wrote {file}")
