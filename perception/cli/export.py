"""`trifuse export`: a checkpoint as an ONNX file, shown to say what the checkpoint says."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from tqdm import tqdm

from data.drive import Drive
from data.frames import frame_count, read_frames
from data.open_drive import open_drive
from data.whole_file import write_whole
from perception.cli.documents import write_json
from perception.cli.machine import describe_machine
from perception.cli.table import Cell, format_table
from perception.errors import MissingDependencyError, UsageError
from perception.sensor import HDL_64E
from perception.types import Frame

if TYPE_CHECKING:
    from export.forms import Form


def export(
    checkpoint: Path,
    *,
    out: Path,
    data: Path | None = None,
    sequence: str | None = None,
    frames: int = 20,
    int8: bool = False,
) -> None:
    """Write a trained network as an ONNX file, normalisation and decoding of boxes inside.

    Torch and ONNX Runtime are shown the same inputs: noise, and candidates of a drive where one is given.
    A report beside the file has the largest differences; where they are too large, no model is written.

    Example: trifuse export runs/depthcn/best.ckpt --out depthcn.onnx --data kitti/object

    Args:
        checkpoint: that training wrote.
        out: the ONNX file; the report has the same name and ends in .json.
        data: a drive whose candidates the network is shown.
        sequence: which one, where there are several.
        frames: of the drive.
        int8: also write an 8-bit form, NAME.int8.onnx; the report says whether it is any faster.
    """
    if int8 and data is None:
        raise UsageError("--int8", expected="--data, to find its scales with", found="none")
    _require_place(out)
    depthcn = _exporter()
    drive = None if data is None else open_drive(data, sequence=sequence)
    exported = depthcn.export_verifier(
        checkpoint,
        _frames(drive, frames) if drive else (),
        drive.sensor if drive else HDL_64E,
        int8=int8,
    )
    print(_table(out.name, exported.forms))
    write_json(
        out.with_suffix(".json"),
        {
            "checkpoint": checkpoint,
            "data": drive.name if drive else None,
            "machine": describe_machine(),
            "tolerances": depthcn.TOLERANCES,
            "facts": exported.facts,
            "opset": exported.opset,
            "forms": exported.forms,
        },
    )
    exported.require_parity(out.name)
    for name, model in exported.models.items():
        file = out if name == "fp32" else out.with_suffix(f".{name}.onnx")
        write_whole(file, model)
        print(f"wrote {file}")


def _exporter() -> ModuleType:
    """Return the module that needs torch."""
    try:
        from export import depthcn
    except ImportError as error:
        raise MissingDependencyError(
            "torch, onnx and onnxscript", needed_for="trifuse export", extra="train", reason=error
        ) from error
    return depthcn


def _require_place(out: Path) -> None:
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


def _frames(drive: Drive, limit: int) -> Iterator[Frame]:
    count = frame_count(drive, limit)
    yield from tqdm(read_frames(drive, limit=limit), "candidates", count, file=sys.stderr)


def _table(name: str, forms: "dict[str, Form]") -> str:
    outputs = [
        (kind, output) for kind, parity in forms["fp32"].parity.items() for output in parity.largest
    ]
    rows: list[list[Cell]] = []
    for form_name, form in forms.items():
        size = f"{form.size_bytes / 1e6:.2f}" if form.size_bytes else None
        differences = [
            f"{form.parity[kind].largest[output]:.1e}" if form.parity else None
            for kind, output in outputs
        ]
        rows.append([form_name, size, f"{form.fastest_ms:.1f}", *differences])
    header = ("", "MB", "ms", *(f"{output}, {kind}" for kind, output in outputs))
    return format_table(f"{name}: 40 candidates; largest differences from torch", header, rows)
