"""`trifuse export`: a checkpoint as an ONNX file, shown to say what the checkpoint says."""

import os
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from data.atomic_file import write_atomically
from data.open_drive import open_drive
from data.results.documents import describe_machine, write_json
from perception.cli.progress import progress_bar
from perception.cli.table import Cell, format_table
from perception.detection.detectors.input_size import InputSize
from perception.errors import MissingDependencyError, UsageError

if TYPE_CHECKING:
    from export.result import ExportResult


def export(  # noqa: PLR0913 - flags of a command
    checkpoint: Path,
    *,
    out: Path,
    data: Path | None = None,
    sequence: str | None = None,
    frames: int = 100,
    int8: bool = False,
    size: str | None = None,
) -> None:
    """Write a trained network as an ONNX file, normalisation and decoding of boxes inside.

    Torch and ONNX Runtime are shown the same inputs: noise, and what a drive shows where one is given. A
    report beside the file has the largest differences; where they are too large, no model is written.
    Of a detector, also average precision on the drive's labels: with --int8 the form in 8 bits is
    written where it is faster and loses at most one percent of it, else that in full precision; the
    report says why.

    Example: trifuse export runs/dm/best.ckpt --out dm_compact.onnx --data kitti/object --int8 true

    Args:
        checkpoint: that training wrote.
        out: the ONNX file; the report has the same name and ends in .json.
        data: a drive that the network is shown.
        sequence: which one, where there are several.
        frames: of the drive at most, spread evenly.
        int8: also make an 8-bit form; the one not chosen is written as NAME.int8.onnx or NAME.fp32.onnx.
        size: of a detector's input, such as 352x1216, in multiples of 32; else as it was trained.
    """
    if int8 and data is None:
        raise UsageError("--int8", expected="--data, to find its scales with", found="none")
    input_size = None if size is None else InputSize.parse(size)
    _require_writable(out)
    exporters = _import_exporters()
    drive = None if data is None else open_drive(data, sequence=sequence)
    exported = exporters.export_network(
        exporters.ExportConfig(
            checkpoint, drive, frames, int8=int8, size=input_size, progress=progress_bar
        )
    )
    print(_table(out.name, exported))
    if exported.variants["fp32"].precision:
        print(f"\n{_precision_table(exported)}")
    print(f"chosen: {exported.choice.variant}; {exported.choice.reason}")
    write_json(
        out.with_suffix(".json"),
        {
            "checkpoint": checkpoint,
            "data": drive.name if drive else None,
            "frames": min(frames, len(drive)) if drive else 0,
            "machine": describe_machine(),
            "tolerances": exported.tolerances,
            "facts": exported.metadata,
            "opset": exported.opset,
            "forms": exported.variants,
            "choice": exported.choice,
        },
    )
    exported.require_parity(out.name)
    for name, model in exported.models.items():
        is_chosen = name == exported.choice.variant
        file = out if is_chosen else out.with_suffix(f".{name.partition(' ')[0]}.onnx")
        write_atomically(file, model)
        print(f"wrote {file}")


def _import_exporters() -> ModuleType:
    """Return the module that needs torch."""
    try:
        from export import exporters
    except ImportError as error:
        raise MissingDependencyError(
            "torch, onnx and onnxscript", needed_for="trifuse export", extra="train", reason=error
        ) from error
    return exporters


def _require_writable(out: Path) -> None:
    """Refuse, before any work is done, a file that could not be written after it."""
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        found = "no permission to write" if not os.access(out.parent, os.W_OK) else None
    except OSError as error:
        found = str(error.strerror)
    if out.is_dir():
        found = "a folder of that name"
    if found is not None:
        raise UsageError(f"--out {out}", expected="a file that can be written", found=found)


def _table(name: str, exported: "ExportResult") -> str:
    """Return size, time and differences of every form."""
    variants = exported.variants
    outputs = [
        (kind, output)
        for kind, parity in variants["fp32"].parity.items()
        for output in parity.largest
    ]
    rows: list[list[Cell]] = []
    for form_name, variant in variants.items():
        size = f"{variant.size_bytes / 1e6:.2f}" if variant.size_bytes else None
        differences = [
            f"{variant.parity[kind].largest[output]:.1e}" if variant.parity else None
            for kind, output in outputs
        ]
        rows.append([form_name, size, f"{variant.fastest_ms:.1f}", *differences])
    header = ("", "MB", "ms", *(f"{output}, {kind}" for kind, output in outputs))
    title = f"{name}: {exported.timed_input}; largest differences from torch"
    return format_table(title, header, rows)


def _precision_table(exported: "ExportResult") -> str:
    """Return average precision of every form, by class and overlap, and by difficulty."""
    variants = exported.variants
    columns = [
        (name, level) for name, levels in variants["fp32"].precision.items() for level in levels
    ]
    rows: list[list[Cell]] = [
        [form_name, *(f"{variant.precision[of_class][level]:.2f}" for of_class, level in columns)]
        for form_name, variant in variants.items()
    ]
    header = ("", *(f"{of_class} {level}" for of_class, level in columns))
    return format_table("average precision, percent, by class and IoU", header, rows)
