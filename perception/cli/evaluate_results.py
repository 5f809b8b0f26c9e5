"""`trifuse evaluate results`: result files of any program against labels, by KITTI's 2D protocols."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from perception.cli.evaluate_detection import PrecisionFlags
from perception.cli.evaluation import EvaluationDocument, publish_report
from perception.cli.flags import ReportFlags
from perception.errors import UsageError
from perception.evaluation.detection.protocol import DIFFICULTIES, KITTI_CLASSES, DetectionClass

_SPLIT = "the frames counted under data; the training data of the detector are not known"


@dataclass(frozen=True)
class ResultPrecisionFlags(PrecisionFlags):
    """Metric of detections.

    Attributes:
        iou: IoU that a detection must exceed to match an object, several with commas; else KITTI's own, 0.7 for
            Car and 0.5 for Pedestrian and Cyclist.
        recall_points: Number of recall points over which precision is averaged: 11, 40 or 11,40.
        bootstrap: Number of bootstrap resamples of the frames for 95 % intervals; 0 for none.
        seed: Seed of the resamples.
    """

    iou: tuple[float, ...] = ()
    recall_points: tuple[int, ...] = (11, 40)


@dataclass(frozen=True)
class DetectionFiles:
    """Files that the metrics rest on.

    Attributes:
        results: Folder of the result files.
        labels: Folder of the label files.
        frame_list: File that named the frames, if any.
        frames: Number of frames.
        missing_results: Numbers of the frames without a result file, in which nothing was detected.
        detections: Number of detections of all classes.
    """

    results: Path
    labels: Path
    frame_list: Path | None
    frames: int
    missing_results: tuple[int, ...]
    detections: int


def evaluate_results(  # noqa: PLR0913 - flags of a command
    results: Path,
    *,
    labels: Path,
    metric: ResultPrecisionFlags,
    report: ReportFlags,
    classes: tuple[str, ...] = ("Car", "Pedestrian", "Cyclist"),
    frame_list: Path | None = None,
    plot: Path | None = None,
) -> None:
    """Measure KITTI detection result files of any program: average precision by KITTI's 2D protocol.

    An empty or missing result file means that nothing was detected in its frame.

    Example: trifuse evaluate results results/latest/data --labels kitti/object --plot precision.png

    Args:
        results: Folder of 000000.txt with 16 columns a row, the score last.
        labels: Folder of 000000.txt, or the root of KITTI's object data.
        classes: Classes to measure, several with commas: Car, Pedestrian, Cyclist, with --iou any other.
        frame_list: File of frame numbers, one a row; else all frames with labels.
        plot: PNG file for the precision-recall curves.
    """
    from data.kitti.detection_rows import read_detection_set, read_frame_list
    from perception.cli.progress import frame_progress_bar, progress_bar
    from perception.evaluation.detection.class_precision import (
        PROTOCOL,
        PrecisionReport,
        measure_precision,
    )

    chosen = [_parse_class(name, metric.iou) for name in classes]
    numbers = None if frame_list is None else read_frame_list(frame_list)
    found = read_detection_set(results, labels, numbers, frame_progress_bar("reading"))
    progress = partial(progress_bar, description="bootstrap", unit="resample", delay_s=2)
    frames = len(found.numbers)
    precision = [
        measure_precision(found.truths, found.detections, frames, one, metric, progress)
        for one in chosen
    ]
    files = DetectionFiles(
        results.resolve(),
        labels.resolve(),
        frame_list and frame_list.resolve(),
        frames,
        found.missing_results,
        len(found.detections),
    )
    values = {"classes": chosen, "difficulties": DIFFICULTIES, **asdict(metric)}
    document = EvaluationDocument(
        "results", files, {**PROTOCOL, "values": values}, {"metric": metric}, _SPLIT
    )
    computed = PrecisionReport(f"Average precision, {frames} frames", precision, metric)
    heading = _describe(results, files, found.extra_results)
    publish_report(heading, computed, document, report.json)
    if plot is not None:
        from perception.render.curve_plots import plot_curves

        plot_curves(plot, f"{results}: {frames} frames", computed.panels(), share_y="all")


def _parse_class(name: str, ious: Sequence[float]) -> DetectionClass:
    """Return a class by its name in any case.

    Raises:
        UsageError: KITTI has no such class, and no IoU is named.
    """
    for known in KITTI_CLASSES:
        if known.name.lower() == name.lower():
            return known
    if not ious:
        raise UsageError(
            "--classes",
            expected=", ".join(known.name for known in KITTI_CLASSES),
            found=name,
            advice="name any other class together with --iou",
        )
    return DetectionClass(name, ious[0])


def _describe(results: Path, files: DetectionFiles, extra_results: Sequence[int]) -> str:
    """Return what was read, and what was not there."""
    lines = [f"{results}: {files.detections} detections in {files.frames} frames"]
    if files.missing_results:
        lines.append(
            f"{len(files.missing_results)} frames without a result file, the first "
            f"{files.missing_results[0]:06d}: counted as no detection"
        )
    if extra_results:
        lines.append(
            f"{len(extra_results)} result files of other frames, the first {extra_results[0]:06d}: not read"
        )
    return "\n".join(lines)
