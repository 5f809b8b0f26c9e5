"""`trifuse evaluate detection`: detectors on labelled drives, by the protocols of KITTI and nuScenes."""

from dataclasses import dataclass
from pathlib import Path

from data.results.command_config import CommandConfig
from data.results.evaluated import EvaluationDocument
from perception.cli.flags import LabelledDriveFlags, ReportFlags, require_positive
from perception.cli.parser import FlagGroup
from perception.detection.config import DetectionConfig
from perception.errors import UsageError
from perception.evaluation.detection.config import PrecisionConfig
from perception.evaluation.nuscenes.protocol import Protocol

_DETECTION = DetectionConfig()


@dataclass(frozen=True)
class PrecisionFlags(PrecisionConfig, FlagGroup):
    """Metric."""

    bootstrap: int = 200


def evaluate_detection(
    drives: list[Path],
    *,
    drive: LabelledDriveFlags,
    metric: PrecisionFlags,
    report: ReportFlags,
    config: CommandConfig,
    protocol: Protocol = "kitti",
    detector: tuple[str, ...] = ("fusion",),
    classes: tuple[str, ...] = (),
    fusions: tuple[Path, ...] = (),
    cache: Path | None = None,
    plot: Path | None = None,
    reliability_plot: Path | None = None,
    worst_frames: Path | None = None,
    worst_count: int = 12,
    detection: DetectionConfig = _DETECTION,
) -> None:
    """Measure detectors on labelled drives: average precision in the image and of 3D boxes.

    Each drive is measured by itself. The fusion has scores of its 3D boxes, too, located in each scan by itself, and
    is measured beside each modality alone, and with modalities missing (Table 7.10).

    Example: trifuse evaluate detection kitti/object --detector fusion --bootstrap 1000

    Args:
        drives: Labelled drive of any layout; one or several.
        protocol: KITTI's object benchmark, or nuScenes' detection task: 3D boxes of the whole pipeline wherever objects are labelled, by distance.
        detector: Detector: fusion, depthcn, rgb, dm, rm, or a file of any, ONNX or YAML; several with commas.
        classes: Classes to measure, several with commas; by default all of the network, of the fusion KITTI's.
        fusions: ONNX files of further fusion networks to compare, such as the thesis' two variants.
        cache: Folder for the detections of the modalities before fusion; by default the user's cache folder.
        plot: PNG file for the precision-recall curves.
        reliability_plot: PNG file for the share of correct detections over their scores, of the fusion.
        worst_frames: Folder for images of the frames with most errors, of the first detector.
        worst_count: Number of these images of each drive and class.
        detection: Detectors: networks, proposals, suppression.
    """
    from data.detections.compared_detectors import open_compared
    from data.detections.measured_detectors import DetectorOptions
    from data.detections.measured_drives import measure_drives
    from data.measured_task import measure_task_drives, require_unset
    from perception.cli.progress import resample_bar

    require_positive("--worst-count", worst_count)
    worst = None if worst_frames is None else (worst_frames, worst_count)
    if protocol == "nuscenes":
        require_unset(classes=classes, fusions=fusions, cache=cache, worst_frames=worst_frames)
        require_unset(detector=detector != ("fusion",), reliability_plot=reliability_plot)
        title = "nuScenes' detection task, where objects are labelled"
        measured, document = measure_task_drives(drives, drive.reader(), detection)
    else:
        if reliability_plot is not None and detector != ("fusion",):
            named = ",".join(detector)
            raise UsageError("--reliability-plot", expected="--detector fusion", found=named)
        options = DetectorOptions(detection, classes, metric, fusions, cache, resample_bar)
        opened = open_compared(detector, options)
        title, words, metadata = opened.title, metric.protocol(), opened.metadata
        measured = measure_drives(opened, drives, drive.reader(), worst)
        document = EvaluationDocument.of_networks("detection", measured.data, words, metadata)
    report.publish(f"{title}\n{measured.seen_in_training}", measured, document, config)
    if plot is not None:
        measured.plot(plot, title)
    if reliability_plot is not None:
        measured.plot_reliability(reliability_plot, metric.iou[0])
