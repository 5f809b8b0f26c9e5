"""Split files, which `trifuse split` writes, and lists of frames, as KITTI's users share them."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from data.kitti.reading import read_label_lines, read_text
from data.recorded_drive import RecordedDrive
from data.results.documents import write_json
from data.splits.frame_split import DriveParts, FrameSplit
from data.splits.parts import PARTS, Part
from perception.errors import LabelError, UsageError
from perception.json_text import read_json_text

_FORMAT = "trifuse split 1"
_EXPECTED = f"a split file, {_FORMAT}"


def write_split(file: Path, split: FrameSplit) -> FrameSplit:
    """Write a split, with folders relative to the file; return it with its file."""
    here = file.resolve().parent
    document = {
        "format": _FORMAT,
        "by": split.by,
        "shares": split.shares,
        "seed": split.seed,
        "drives": [
            {"root": os.path.relpath(one.root, here), "name": one.name, **one.frames}
            for one in split.drives
        ],
    }
    write_json(file, document)
    return replace(split, file=file)


def read_split(file: Path) -> FrameSplit:
    """Read a split file.

    Raises:
        UsageError: It is missing, damaged, or another document.
    """
    text = read_text(file, UsageError, _EXPECTED, "make one with: trifuse split")
    try:
        document = read_json_text(text)
    except ValueError as error:
        raise _unreadable(file, f"no whole JSON document ({error})") from error
    version = document.get("format") if isinstance(document, dict) else None
    if version != _FORMAT:
        raise _unreadable(file, f"format {version}" if version else "another JSON document")
    try:
        drives = tuple(_read_parts(file, entry) for entry in document["drives"])
        shares = tuple(map(float, document["shares"]))
        return FrameSplit(drives, document["by"], shares, document["seed"], file)
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise _unreadable(file, f"other entries ({error!r})") from error


def select_part(
    drives: Sequence[RecordedDrive], file: Path | None, part: Part
) -> list[RecordedDrive]:
    """Return the drives with the frames of one part of a split file alone, or as they are without a file.

    Raises:
        UsageError: The file is damaged, of other drives, or has no frame of them in the part.
        DriveError: A drive lacks a frame of the part.
    """
    return list(drives) if file is None else read_split(file).require_part(drives, part)


def split_by_lists(drives: Sequence[RecordedDrive], folder: Path) -> FrameSplit:
    """Read a split from train.txt, val.txt and test.txt, one frame a line, such as KITTI's 3712 and 3769.

    Args:
        drives: The one drive whose frames they name.
        folder: Folder of the lists; a list that is not there is an empty part.

    Raises:
        UsageError: There are several drives, or no lists, or a frame is on two of them.
        LabelError: A list cannot be read, is empty, or names a frame that the drive does not have.
    """
    files: dict[Part, Path] = {part: folder / f"{part}.txt" for part in PARTS}
    files = {part: file for part, file in files.items() if file.exists()}
    if len(drives) != 1 or not files:
        raise UsageError(
            f"--lists {folder}",
            expected="train.txt, val.txt or test.txt of the frames of one drive",
            found=f"{', '.join(file.name for file in files.values()) or 'none of them'} for {len(drives)} drives",
        )
    (drive,) = drives
    frames = {part: _read_list(file, drive) for part, file in files.items()}
    return FrameSplit((DriveParts(drive.root.resolve(), drive.name, frames),))


def _read_list(file: Path, drive: RecordedDrive) -> tuple[str, ...]:
    words = [line.strip() for line in read_label_lines(file, "a list of frames")]
    if not words:
        raise LabelError(file, expected="names of frames, one a line", found="none")
    known = drive.frame_names
    names = {name: name for name in known} | {
        str(number): name for number, name in zip(drive.frame_numbers, known, strict=True)
    }
    found = set()
    for row, word in enumerate(words, start=1):
        name = names.get(word) or names.get(word.lstrip("0") or "0")
        if name is None:
            raise LabelError(
                f"{file} row {row}",
                expected=f"one of the {len(known)} frames of the drive, {known[0]} to {known[-1]}",
                found=repr(word),
                advice="move the list away if it is of KITTI's testing folder",
            )
        found.add(name)
    return tuple(sorted(found))


def _read_parts(file: Path, entry: dict[str, Any]) -> DriveParts:
    frames: dict[Part, tuple[str, ...]] = {
        part: tuple(map(str, entry[part])) for part in PARTS if part in entry
    }
    root = file.resolve().parent / entry["root"]
    return DriveParts(root.resolve(), str(entry["name"]), frames)


def _unreadable(file: Path, found: str) -> UsageError:
    return UsageError(file, expected=_EXPECTED, found=found, advice="make one with: trifuse split")
