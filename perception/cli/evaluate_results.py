"""`trifuse evaluate results`: detection and tracking result files of any program, by KITTI's protocols."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from data.results.command_config import CommandConfig
from data.results.evaluated import EvaluationDocument
from perception.cli.evaluate_detection import PrecisionFlags, protocol, resample_bar
from perception.cli.evaluation import publish_report
from perception.cli.flags import ReportFlags
from perception.errors import UsageError
from perception.evaluation.detection.config import PublishedTable, require_published
from perception.evaluation.detection.protocol import (
    KITTI_CLASSES,
    DetectionClass,
    class_of_name,
)

if TYPE_CHECKING:
    from perception.evaluation.detection.class_precision import PrecisionReport
    from perception.evaluation.report import Report

Kind = Literal["auto", "detections", "tracks"]

_SPLIT = "the files under data; the training data of the program are not known"


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


def evaluate_results(
    results: Path,
    *,
    labels: Path,
    metric: ResultPrecisionFlags,
    report: ReportFlags,
    config: CommandConfig,
    kind: Kind = "auto",
    classes: tuple[str, ...] = (),
    frame_list: Path | None = None,
    seqmap: Path | None = None,
    published: PublishedTable | None = None,
    plot: Path | None = None,
) -> None:
    """Measure result files of any program: average precision of detections, or HOTA, CLEAR and IDF1 of tracks.

    Detections: NNNNNN.txt of a frame with 16 columns, the score last; rows with 3D boxes are measured from above and
    in space, too, and their orientation. Tracks: SSSS.txt of a sequence with 18 columns. An empty file means that
    nothing was found, as does a missing file of detections.

    Example: trifuse evaluate results results/latest/tracks --labels kitti/tracking

    Args:
        results: Folder of the result files.
        labels: Folder of the label files, or the root of KITTI's object or tracking data.
        kind: Kind of the results; auto decides by the names of the files.
        classes: Classes to measure, several with commas; else Car, Pedestrian and Cyclist, of tracks car and
            pedestrian; of detections, with --iou any other.
        frame_list: File of frame numbers, one a row, of detections; else all frames with labels.
        seqmap: File of sequence names and numbers of frames, of tracks; else all sequences with results.
        published: Table of the thesis whose published detectors are printed beside the detected cars: table-7.9
            (DepthCN) or table-7.11 (fusion).
        plot: PNG file for the precision-recall curves of detections.
    """
    from data.kitti.tracker_files import are_tracks

    is_of_tracks = kind == "tracks" or (kind == "auto" and are_tracks(results))
    if published is not None:
        require_published(classes, metric.iou, are_tracks=is_of_tracks)
    if is_of_tracks:
        publish_report(*_measure_tracks(results, labels, classes, seqmap), config, report)
        return
    chosen = [class_of_name(name, metric.iou) for name in classes] or list(KITTI_CLASSES)
    heading, precision, document = _measure_detections(
        results, labels, chosen, metric, frame_list, published
    )
    publish_report(heading, precision, document, config, report)
    if plot is not None:
        from perception.render.curve_plots import plot_curves

        plot_curves(plot, f"{results}: {precision.title}", precision.panels(), share_y="all")


def _measure_detections(
    results: Path,
    labels: Path,
    classes: Sequence[DetectionClass],
    metric: PrecisionFlags,
    frame_list: Path | None,
    published: PublishedTable | None,
) -> "tuple[str, PrecisionReport, EvaluationDocument]":
    from data.kitti.detection_rows import read_detection_set, read_frame_list
    from perception.cli.progress import frame_progress_bar
    from perception.evaluation.detection.benchmark_scores import measure_benchmark
    from perception.evaluation.detection.class_precision import PrecisionReport, measure_precision
    from perception.evaluation.detection.evaluation_boxes import pair_boxes
    from perception.evaluation.detection.published import PublishedComparison

    numbers = None if frame_list is None else read_frame_list(frame_list)
    found = read_detection_set(results, labels, numbers, frame_progress_bar("reading"))
    frames = len(found.numbers)
    rows = found.truths, found.detections, frames
    boxes, scores = pair_boxes(*rows), measure_benchmark(*rows, classes, metric, resample_bar())
    precision = [measure_precision(boxes, one, metric, resample_bar()) for one in classes]
    data = {
        **_paths(results=results, labels=labels, frame_list=frame_list),
        "frames": frames,
        "missing_results": found.missing_results,
        "detections": len(found.detections),
    }
    words = protocol(metric, classes=classes)
    document = EvaluationDocument("detections", data, words, _SPLIT)
    title = f"Average precision in the image, {frames} frames"
    computed = PrecisionReport(title, precision, benchmark=scores)
    if published is not None:
        place = f"{frames} frames of {labels}"
        computed = PublishedComparison(title, precision, (), scores, published, place)
    return f"{results}: {found.description}", computed, document


def _measure_tracks(
    results: Path, labels: Path, classes: Sequence[str], seqmap: Path | None
) -> "tuple[str, Report, EvaluationDocument]":
    from data.kitti.tracker_files import label_folder, pair_with_labels, sequences_in
    from perception.cli.progress import progress_bar
    from perception.evaluation.multi_object.kitti_protocol import NEIGHBOURS
    from perception.evaluation.tracking_measure import PROTOCOL, TrackingMeasure

    requested = {name.lower() for name in classes or ("car", "pedestrian")}
    if not requested <= set(NEIGHBOURS):
        raise UsageError("--classes", expected=", ".join(NEIGHBOURS), found=",".join(classes))
    chosen = [name for name in NEIGHBOURS if name in requested]
    folder, measure = label_folder(labels), TrackingMeasure(chosen)
    pairs = pair_with_labels(results, folder, seqmap)
    for files in progress_bar(pairs, "tracks", unit="sequence", delay_s=2):
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
