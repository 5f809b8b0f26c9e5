"""Result files of any program, measured against label files by KITTI's protocols."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from data.kitti.detection_rows import read_detection_set, read_frame_list
from data.kitti.tracker_files import label_folder, pair_with_labels, sequences_in
from data.results.evaluated import EvaluationDocument
from perception.errors import UsageError
from perception.evaluation.detection.benchmark_scores import measure_benchmark
from perception.evaluation.detection.class_precision import PrecisionReport, measure_precision
from perception.evaluation.detection.config import PrecisionConfig, PublishedTable
from perception.evaluation.detection.evaluation_boxes import pair_boxes
from perception.evaluation.detection.protocol import DetectionClass
from perception.evaluation.detection.published import PublishedComparison
from perception.evaluation.multi_object.kitti_protocol import NEIGHBOURS
from perception.evaluation.report import Report
from perception.evaluation.tracking_measure import PROTOCOL, TrackingMeasure
from perception.types import Progress

_SPLIT = "the files under data; the training data of the program are not known"


@dataclass(frozen=True)
class ResultBars:
    """Progress bars over the files of results.

    Attributes:
        reading: Bar over the frames that are read.
        bootstrap: Bar over the resamples.
        sequences: Bar over the sequences of tracks.
    """

    reading: Progress = iter
    bootstrap: Progress = iter
    sequences: Callable[[Iterable[Any]], Iterable[Any]] = iter


def measure_detections(  # noqa: PLR0913, PLR0917 - each is a flag of its own
    results: Path,
    labels: Path,
    classes: Sequence[DetectionClass],
    metric: PrecisionConfig,
    frame_list: Path | None,
    published: PublishedTable | None,
    bars: ResultBars,
) -> tuple[str, PrecisionReport, EvaluationDocument]:
    """Measure detections; return a heading, the metrics, and what they rest on.

    Args:
        results: Folder of the result files.
        labels: Folder of the label files, or the root of KITTI's object data.
        classes: Classes to measure.
        metric: Average precision.
        frame_list: File of frame numbers, one a row; None for all frames with labels.
        published: Table of the thesis whose published detectors stand beside, or None.
        bars: Progress bars.

    Raises:
        LabelError: A file cannot be read.
    """
    numbers = None if frame_list is None else read_frame_list(frame_list)
    found = read_detection_set(results, labels, numbers, bars.reading)
    frames = len(found.numbers)
    rows = found.truths, found.detections, frames
    boxes, scores = pair_boxes(*rows), measure_benchmark(*rows, classes, metric, bars.bootstrap)
    precision = [measure_precision(boxes, one, metric, bars.bootstrap) for one in classes]
    data = {
        **_paths(results=results, labels=labels, frame_list=frame_list),
        "frames": frames,
        "missing_results": found.missing_results,
        "detections": len(found.detections),
    }
    words = metric.protocol(classes=classes)
    document = EvaluationDocument("detections", data, words, _SPLIT)
    title = f"Average precision in the image, {frames} frames"
    computed = PrecisionReport(title, precision, benchmark=scores)
    if published is not None:
        place = f"{frames} frames of {labels}"
        computed = PublishedComparison(title, precision, (), scores, published, place)
    return f"{results}: {found.description}", computed, document


def measure_tracks(
    results: Path, labels: Path, classes: Sequence[str], seqmap: Path | None, bars: ResultBars
) -> tuple[str, Report, EvaluationDocument]:
    """Measure tracks; return a heading, the metrics, and what they rest on.

    Args:
        results: Folder of the result files.
        labels: Folder of the label files, or the root of KITTI's tracking data.
        classes: Names of the classes to measure; none for car and pedestrian.
        seqmap: File of sequence names and numbers of frames; None for all sequences with results.
        bars: Progress bars.

    Raises:
        UsageError: A class is none of KITTI's.
        LabelError: A file cannot be read.
    """
    requested = {name.lower() for name in classes or ("car", "pedestrian")}
    if not requested <= set(NEIGHBOURS):
        raise UsageError("--classes", expected=", ".join(NEIGHBOURS), found=",".join(classes))
    chosen = [name for name in NEIGHBOURS if name in requested]
    folder, measure = label_folder(labels), TrackingMeasure(chosen)
    pairs = pair_with_labels(results, folder, seqmap)
    for files in bars.sequences(pairs):
        rows = files.read()
        labelled, found = rows.labels.image_boxes, rows.results.image_boxes
        measure.update(files.name, labelled, found, rows.frame_count)
    computed = measure.compute()
    data = {
        **_paths(results=results, labels=folder, seqmap=seqmap),
        "frames": computed.frame_counts,
    }
    document = EvaluationDocument("tracks", data, PROTOCOL, _SPLIT)
    heading = (
        f"{results}: {len(computed.frame_counts)} of {len(sequences_in(folder))} labelled sequences, "
        f"{sum(computed.frame_counts.values())} frames"
    )
    return heading, computed, document


def _paths(**paths: Path | None) -> dict[str, object]:
    return {name: path and path.resolve() for name, path in paths.items()}
