"""Labels and results of KITTI's object benchmark as plain rows: a folder of texts, one a frame.

Labels have 15 columns, results a 16th; neither needs a calibration here:

    type truncation occlusion alpha  x1 y1 x2 y2  height width length  x y z  ry  [score]

    Car 0.00 0 1.85 387.63 181.54 423.81 203.12 1.67 1.87 3.69 -16.53 2.39 58.49 1.57
    Car -1 -1 -10 296.74 161.75 455.22 292.37 -1 -1 -1 -1000 -1000 -1000 -10 0.93

What a detector does not say is -1 (truncation, occlusion, size), -1000 (place) or -10 (angle).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from data.kitti.reading import read_label_lines
from data.kitti.rows import read_object_rows
from data.kitti.sensor_files import list_folder
from perception.errors import DriveError, LabelError
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes, upright_boxes
from perception.types import Progress


@dataclass(frozen=True)
class DetectionSet:
    """Detections and labels of F frames.

    Attributes:
        numbers: (F,) numbers of the frames, in order; rows name a frame by its index here.
        truths: Labelled boxes.
        detections: Detected boxes.
        missing_results: Numbers of the frames without a result file, in which nothing was detected.
        extra_results: Numbers of the result files that belong to none of the frames.
    """

    numbers: tuple[int, ...]
    truths: TrueBoxes
    detections: DetectedBoxes
    missing_results: tuple[int, ...]
    extra_results: tuple[int, ...]

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
                f"{len(extra)} result files of other frames, the first {extra[0]:06d}: not read"
            )
        return "\n".join(lines)


def read_detection_set(
    results: Path,
    labels: Path,
    numbers: Sequence[int] | None = None,
    progress: Progress = iter,
) -> DetectionSet:
    """Read the results of a detector and the labels of the same frames.

    An empty or missing result file says that nothing was detected in its frame.

    Args:
        results: Folder of 000000.txt, or one that holds them in data/.
        labels: Folder of 000000.txt, or one that holds them in label_2/ or training/label_2/.
        numbers: Numbers of the frames; None for all that have labels.
        progress: Progress bar around the frames.

    Raises:
        DriveError: A folder holds no file of any of the frames.
        LabelError: A label file is missing, or a row cannot be read.
    """
    label_files = _text_files(labels, ("label_2", "training/label_2"))
    chosen = tuple(label_files.paths if numbers is None else numbers)
    result_files = _text_files(results, ("data",))
    if result_files.paths.keys().isdisjoint(chosen):
        raise DriveError(
            result_files.folder,
            expected=f"results of the {len(chosen)} frames, named as their labels are",
            found=f"{len(result_files.paths)} results of other frames",
            advice="name the folder of the result files, and the list of the frames that they are of",
        )
    return DetectionSet(
        numbers=chosen,
        truths=_read_labels(label_files, chosen, progress),
        detections=_read_results(result_files, chosen, progress),
        missing_results=tuple(n for n in chosen if n not in result_files.paths),
        extra_results=tuple(sorted(result_files.paths.keys() - set(chosen))),
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

    folder: Path
    paths: Mapping[int, Path]


def _text_files(folder: Path, inner: Sequence[str]) -> _TextFiles:
    """List the texts of a folder, or of the first inner one that exists."""
    within = next((folder / name for name in inner if (folder / name).is_dir()), folder)
    texts = [path for path in sorted(list_folder(within)) if path.suffix == ".txt"]
    paths = {int(path.stem): path for path in texts if path.stem.isdecimal()}
    if not paths:
        found = "no such file" if within.is_dir() else "no folder"
        raise DriveError(within, expected="texts named 000000.txt", found=found)
    return _TextFiles(within, paths)


def _read_labels(files: _TextFiles, chosen: Sequence[int], progress: Progress) -> TrueBoxes:
    paths = [files.paths.get(number, files.folder / f"{number:06d}.txt") for number in chosen]
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


def _read_results(files: _TextFiles, chosen: Sequence[int], progress: Progress) -> DetectedBoxes:
    table = read_object_rows(
        [files.paths.get(number) for number in chosen], has_scores=True, progress=progress
    )
    return DetectedBoxes(
        frames=table.files,
        types=table.types,
        alphas_rad=table.numbers[:, 2],
        boxes_px=table.numbers[:, 3:7],
        boxes_3d=upright_boxes(table.numbers[:, 7:14]),
        scores=table.numbers[:, 14],
    )
