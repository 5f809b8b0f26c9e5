"""`trifuse evaluate results`: detection and tracking result files of any program, by the protocols of KITTI and nuScenes."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from data.results.command_config import CommandConfig
from perception.cli.evaluate_detection import PrecisionFlags
from perception.cli.flags import ReportFlags
from perception.evaluation.detection.config import PublishedTable, require_published
from perception.evaluation.detection.protocol import KITTI_CLASSES, class_of_name
from perception.evaluation.nuscenes.protocol import Protocol

Kind = Literal["auto", "detections", "tracks"]


@dataclass(frozen=True)
class ResultPrecisionFlags(PrecisionFlags):
    """Metric of detections.

    Attributes:
        iou: IoU that a detection must exceed to match an object, several with commas; by default KITTI's, 0.7 for
            Car and 0.5 for Pedestrian and Cyclist.
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
    protocol: Protocol | None = None,
    classes: tuple[str, ...] = (),
    frame_list: Path | None = None,
    seqmap: Path | None = None,
    published: PublishedTable | None = None,
    plot: Path | None = None,
) -> None:
    """Measure result files of any program: average precision of detections, or HOTA, CLEAR and IDF1 of tracks.

    Detections: KITTI's NNNNNN.txt (3D boxes also from above, in space, and their orientation; a missing file has none) or
    COCO's JSON. Tracks: SSSS.txt of a sequence in KITTI's or MOTChallenge's columns. Or nuScenes' JSON of either, all
    round; tracks also within the view of the front camera.

    Example: trifuse evaluate results results/latest/tracks --labels kitti/tracking

    Args:
        results: Folder of the result files, or JSON file.
        labels: Folder of the label files, or the root of KITTI's object or tracking data, or of nuScenes'.
        kind: Kind of the results; auto decides by their content.
        protocol: Protocol of detections, by default that of the files; kitti takes those of nuScenes in the front camera.
        classes: Classes to measure, several with commas; by default Car, Pedestrian and Cyclist, of tracks car and
            pedestrian; of detections, with --iou any other.
        frame_list: File of frame numbers, one per row, of detections; by default all frames with labels.
        seqmap: File of sequence names and numbers of frames, of tracks; by default all sequences with results.
        published: Table of the thesis whose published detectors are printed beside the detected cars: table-7.9
            (DepthCN) or table-7.11 (fusion).
        plot: PNG file for the precision-recall curves of detections.
    """
    from data.measured_results import ResultBars, measure_detections, measure_tracks
    from data.measured_task import measure_task_results, require_unset
    from data.result_files import find_results
    from perception.cli.progress import frame_progress_bar, progress_bar, resample_bar
    from perception.render.curve_plots import plot_curves

    bars = ResultBars(
        frame_progress_bar("reading"),
        resample_bar,
        lambda files: progress_bar(files, "tracks", unit="sequence", delay_s=2),
    )
    found = find_results(results, None if kind == "auto" else kind)
    if published is not None:
        require_published(classes, metric.iou, are_tracks=found.kind == "tracks")
    if found.kind == "tracks":
        report.publish(*measure_tracks(found, labels, classes, seqmap, bars), config)
        return
    precision: Any  # a report that has curves
    if protocol == "nuscenes" or (found.form == "nuScenes" and protocol is None):
        require_unset(classes=classes, frame_list=frame_list, published=published)
        heading, precision, document = measure_task_results(found, labels, bars.reading)
    else:
        chosen = [class_of_name(name, metric.iou) for name in classes] or list(KITTI_CLASSES)
        heading, precision, document = measure_detections(
            found, labels, chosen, metric, frame_list, published, bars
        )
    report.publish(heading, precision, document, config)
    if plot is not None:
        plot_curves(plot, f"{results}: {precision.title}", precision.panels(), share_y="all")
