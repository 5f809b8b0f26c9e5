"""Labels and results of KITTI's object benchmark as plain rows: a folder of texts, one a frame.

Labels have 15 columns, results a 16th; neither needs a calibration here:

    type truncation occlusion alpha  x1 y1 x2 y2  height width length  x y z  ry  [score]

    Car 0.00 0 1.85 387.63 181.54 423.81 203.12 1.67 1.87 3.69 -16.53 2.39 58.49 1.57
    Car -1 -1 -10 296.74 161.75 455.22 292.37 -1 -1 -1 -1000 -1000 -1000 -10 0.93

What a detector does not say is -1 (truncation, occlusion, size), -1000 (place) or -10 (angle).
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import Protocol

import numpy as np

from data.kitti.reading import read_label_lines
from data.kitti.rows import read_object_rows
from data.kitti.sensor_files import list_folder
from perception.errors import DriveError, LabelError
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes, upright_boxes
from perception.evaluation.detection.protocol import DONT_CARE
from perception.evaluation.frame_numbering import numbering_fit, numbering_notes
from perception.types import Progress

_MAX_DIGITS = 18  # of a frame number


class NumberedDetections(Protocol):
    """Detections by the numbers of frames, in one of the forms that are read."""

    @property
    def path(self) -> Path:
        """File or folder."""

    @property
    def noun(self) -> str:
        """Name of what has a number, such as result files."""

    @property
    def numbers(self) -> Collection[int]:
        """Numbers of the frames that it has something of."""

    def read(self, chosen: Sequence[int], progress: Progress) -> DetectedBoxes:
        """Return the detections of some frames, in the order of these."""


@dataclass(frozen=True)
class DetectionSet:
    """Detections and labels of F frames.

    Attributes:
        numbers: (F,) numbers of the frames, in order; rows name a frame by its index here.
        truths: Labelled boxes.
        detections: Detected boxes.
        missing_results: Numbers of the frames without a result file, in which nothing was detected.
        extra_results: Numbers of the result files that belong to none of the frames.
        noun: Name of what has a number: result files, or images of a single file.
        notes: Sentences on how the results are read.
    """

    numbers: tuple[int, ...]
    truths: TrueBoxes
    detections: DetectedBoxes
    missing_results: tuple[int, ...] = ()
    extra_results: tuple[int, ...] = ()
    noun: str = "result files"
    notes: tuple[str, ...] = ()

    @property
    def description(self) -> str:
        """Numbers of detections and frames, and what was not there or not read, in lines."""
        missing, extra = self.missing_results, self.extra_results
        lines = [f"{len(self.detections)} detections in {len(self.numbers)} frames"]
        if missing:
            lines.append(
                f"{len(missing)} frames without a result file, the first {missing[0]:06d}: counted as no detection"
            )
        if extra:
            lines.append(
                f"{len(extra)} {self.noun} of other frames, the first {extra[0]:06d}: not read"
            )
        return "\n".join([*lines, *self.notes])


def read_detection_set(
    results: Path | NumberedDetections,
    labels: Path,
    numbers: Sequence[int] | None = None,
    progress: Progress = iter,
) -> DetectionSet:
    """Read the results of a detector and the labels of the same frames.

    An empty or missing result file says that nothing was detected in its frame.

    Args:
        results: Folder of 000000.txt, or one that holds them in data/; or detections that are read already.
        labels: Folder of 000000.txt, or one that holds them in label_2/ or training/label_2/.
        numbers: Numbers of the frames; None for all that have labels.
        progress: Progress bar around the frames.

    Raises:
        DriveError: A folder holds no file of any of the frames.
        LabelError: A label file is missing, or a row cannot be read.
    """
    label_files = _text_files(labels, ("label_2", "training/label_2"))
    chosen = tuple(label_files.texts if numbers is None else numbers)
    source = _text_files(results, ("data",)) if isinstance(results, Path) else results
    has_files = isinstance(results, Path)
    if set(chosen).isdisjoint(source.numbers) and (has_files or source.numbers):
        raise DriveError(
            source.path,
            expected=f"results of the {len(chosen)} frames, numbered as their labels are",
            found=f"{len(source.numbers)} {source.noun} of other frames",
            advice="name the folder of the result files, and the list of the frames that they are of",
        )
    truths, detections = _read_labels(label_files, chosen, progress), source.read(chosen, progress)
    frames, objects = np.array(chosen, np.int64), truths[np.char.lower(truths.types) != DONT_CARE]
    fit = numbering_fit(
        frames[objects.frames], objects.boxes_px, frames[detections.frames], detections.boxes_px
    )
    return DetectionSet(
        numbers=chosen,
        truths=truths,
        detections=detections,
        missing_results=tuple(n for n in chosen if has_files and n not in source.numbers),
        extra_results=tuple(sorted(set(source.numbers) - set(chosen))),
        noun=source.noun,
        notes=tuple(numbering_notes({str(source.path): fit})),
    )


def read_frame_list(path: Path) -> tuple[int, ...]:
    """Read the numbers of frames, one a row, such as of a split.

    Raises:
        LabelError: The file cannot be read, or a row is not a number, or repeats one.
    """
    numbers: dict[int, int] = {}
    for row, line in enumerate(read_label_lines(path), start=1):
        word = line.strip()
        if not word.isdecimal():
            raise LabelError(f"{path} row {row}", expected="a frame number", found=repr(word))
        if int(word) in numbers:
            before = numbers[int(word)]
            raise LabelError(
                f"{path} row {row}", expected="each frame once", found=f"{word} as in row {before}"
            )
        numbers[int(word)] = row
    if not numbers:
        raise LabelError(path, expected="frame numbers, one a row", found="none")
    return tuple(numbers)


@dataclass(frozen=True)
class _TextFiles:
    """Texts of a folder by the number in their names."""

    path: Path
    texts: Mapping[int, Path]
    noun: str = "result files"

    @property
    def numbers(self) -> Collection[int]:
        """Numbers in the names."""
        return self.texts.keys()

    def read(self, chosen: Sequence[int], progress: Progress) -> DetectedBoxes:
        """Read the detections of some frames."""
        paths = [self.texts.get(number) for number in chosen]
        table = read_object_rows(paths, has_scores=True, progress=progress)
        return DetectedBoxes(
            frames=table.files,
            types=table.types,
            alphas_rad=table.numbers[:, 2],
            boxes_px=table.numbers[:, 3:7],
            boxes_3d=upright_boxes(table.numbers[:, 7:14]),
            scores=table.numbers[:, 14],
        )


def _text_files(folder: Path, inner: Sequence[str]) -> _TextFiles:
    """List the texts of a folder, or of the first inner one that exists."""
    within = next((folder / name for name in inner if (folder / name).is_dir()), folder)
    # By name: paths compare several times as slowly.
    files = sorted(list_folder(within), key=attrgetter("name"))
    texts = [path for path in files if path.suffix == ".txt"]
    named = [path for path in texts if path.stem.isdecimal() and len(path.stem) <= _MAX_DIGITS]
    paths = {int(path.stem): path for path in named}
    if len(paths) < len(named):
        twice = next(one for one in named if paths[int(one.stem)] != one)
        found = f"{twice.name} and {paths[int(twice.stem)].name}"
        raise DriveError(within, expected="one text of each frame", found=found)
    if not paths:
        found = "no such file" if within.is_dir() else "no folder"
        raise DriveError(within, expected="texts named 000000.txt", found=found)
    return _TextFiles(within, paths)


def _read_labels(files: _TextFiles, chosen: Sequence[int], progress: Progress) -> TrueBoxes:
    paths = [files.texts.get(number, files.path / f"{number:06d}.txt") for number in chosen]
    table = read_object_rows(paths, allows_more=True, progress=progress)
    return TrueBoxes(
        frames=table.files,
        types=table.types,
        truncation=table.numbers[:, 0],
        occlusion=table.numbers[:, 1],
        alphas_rad=table.numbers[:, 2],
        boxes_px=table.numbers[:, 3:7],
        boxes_3d=upright_boxes(table.numbers[:, 7:14]),
    )
