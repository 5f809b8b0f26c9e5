"""Results of a tracker and the labels of their sequences: one file SSSS.txt each.

Which sequences there are, and how long they are, can be said by a seqmap of the benchmark, a row each:

    0001 empty 000000 000447
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from data.kitti.mot_rows import are_mot_rows
from data.kitti.reading import first_row, read_label_lines
from data.kitti.tracking_rows import TrackingRows, read_label_rows, read_result_rows
from perception.errors import DriveError, LabelError

_MAX_NAMED = 3  # files that an error names


@dataclass(frozen=True)
class TrackedSequenceFiles:
    """Files of the labels and the results of one sequence.

    Attributes:
        name: Name of the sequence, such as 0000.
        labels: Label file with 17 columns.
        results: Result file with 18 columns, or MOTChallenge's.
        frame_count: Number of frames of the sequence, or None without a seqmap.
    """

    name: str
    labels: Path
    results: Path
    frame_count: int | None = None

    @property
    def states_classes(self) -> bool:
        """Whether the columns of the results have a class."""
        return not are_mot_rows(first_row(self.results))

    def read(self) -> "LabelledResults":
        """Read both files.

        Raises:
            LabelError: One of the files cannot be used.
        """
        labels = read_label_rows(self.labels, self.frame_count)
        results = read_result_rows(self.results, self.frame_count)
        last = max(labels.frames.max(initial=-1), results.frames.max(initial=-1))
        # No frame beyond the last row of either file could change any measure.
        return LabelledResults(labels, results, self.frame_count or int(last) + 1)


@dataclass(frozen=True)
class LabelledResults:
    """One sequence.

    Attributes:
        labels: Labels of all classes.
        results: Results of a tracker.
        frame_count: Number of frames of the sequence; up to the last row of either file without a seqmap.
    """

    labels: TrackingRows
    results: TrackingRows
    frame_count: int


def sequences_in(folder: Path) -> list[str]:
    """List the sequences of which a folder holds a file SSSS.txt."""
    return sorted(file.stem for file in folder.glob("[0-9][0-9][0-9][0-9].txt"))


def label_folder(path: Path) -> Path:
    """Find the folder of SSSS.txt: a path itself, or label_02 in it or in its training/.

    Raises:
        DriveError: There is no such folder.
    """
    for folder in (path, path / "label_02", path / "training" / "label_02"):
        if sequences_in(folder):
            return folder
    raise DriveError(
        path,
        expected="labels named SSSS.txt, here, in label_02 or in training/label_02",
        found="none" if path.is_dir() else "no such folder",
    )


def pair_with_labels(
    results: Path, labels: Path, seqmap: Path | None = None
) -> list[TrackedSequenceFiles]:
    """Find the two files of each sequence: of a seqmap, else of all that have results.

    Args:
        results: Folder of result files SSSS.txt.
        labels: Folder of label files SSSS.txt.
        seqmap: File with the names and lengths of the sequences.

    Raises:
        DriveError: A file is missing.
        LabelError: The seqmap cannot be read.
    """
    if not results.is_dir():
        raise DriveError(results, expected="a folder of results SSSS.txt", found="no such folder")
    lengths: dict[str, int | None] = dict.fromkeys(sequences_in(results))
    if seqmap is not None:
        lengths = dict(read_seqmap(seqmap))
    if not lengths:
        renamed = other_names(results, sequences_in(labels))
        named = [f"{file} where the labels have {name}.txt" for file, name in renamed.items()]
        advice = "give results the names of their labels" if renamed else None
        found = ", ".join(named[:_MAX_NAMED]) or "none"
        raise DriveError(results, expected="results named SSSS.txt", found=found, advice=advice)
    for name in lengths:
        _require(results, name, "results", "add an empty file for a sequence without tracks")
        _require(labels, name, "labels", "remove results of sequences without labels")
    return [
        TrackedSequenceFiles(name, labels / f"{name}.txt", results / f"{name}.txt", length)
        for name, length in lengths.items()
    ]


def other_names(folder: Path, sequences: Iterable[str]) -> dict[str, str]:
    """Return the texts of a folder that have the number of a sequence under another name, such as 0.txt for 0000."""
    by_number = {int(name): name for name in sequences if name.isdecimal()}
    numbers = {
        file.name: int(digits[-1])
        for file in sorted(folder.glob("*.txt"))
        if (digits := re.findall(r"[0-9]{1,18}", file.stem))
    }
    return {
        name: by_number[number]
        for name, number in numbers.items()
        if number in by_number and name != f"{by_number[number]}.txt"
    }


def read_seqmap(path: Path) -> dict[str, int]:
    """Read the lengths of sequences by name.

    Raises:
        LabelError: The file or a row cannot be read, or a sequence is named twice.
    """
    lengths: dict[str, int] = {}
    expected = "a sequence that is named once, `empty`, its first frame and its length"
    for number, line in enumerate(read_label_lines(path, "a seqmap"), start=1):
        words = line.split()
        is_row = len(words) == 4 and words[3].isdigit() and int(words[3]) > 0
        if not is_row or words[0] in lengths:
            raise LabelError(f"{path} row {number}", expected=expected, found=repr(line))
        lengths[words[0]] = int(words[3])
    return lengths


def _require(folder: Path, name: str, what: str, advice: str) -> None:
    file = folder / f"{name}.txt"
    if not file.is_file():
        found, named = "no file", list(other_names(folder, [name]))
        if named:
            found, advice = ", ".join(named), f"rename {named[0]} if it is of this sequence"
        raise DriveError(
            file, expected=f"the {what} of sequence {name}", found=found, advice=advice
        )
