"""`trifuse evaluate detection`: vehicle detectors on labelled drives, by KITTI's 2D protocol."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from perception.cli.evaluation import EvaluatedDrive, EvaluationDocument, publish_report
from perception.cli.flags import DriveFlags, ReportFlags, require_positive
from perception.cli.parser import FlagGroup
from perception.detection.config import DetectionConfig
from perception.errors import DriveError, UsageError
from perception.evaluation.detection.config import PrecisionConfig
from perception.evaluation.detection.protocol import DIFFICULTIES
from perception.types import Detections, Drive, Frame, Labels

if TYPE_CHECKING:
    from perception.cli.detectors import OpenedDetector
    from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
    from perception.evaluation.report import Table

_DETECTION = DetectionConfig()


@dataclass(frozen=True)
class PrecisionFlags(PrecisionConfig, FlagGroup):
    """Metric."""


def evaluate_detection(  # noqa: PLR0913 - flags of a command
    drives: list[Path],
    *,
    drive: DriveFlags,
    metric: PrecisionFlags,
    report: ReportFlags,
    detector: str = "fusion",
    classes: tuple[str, ...] = (),
    fusions: tuple[Path, ...] = (),
    cache: Path | None = None,
    plot: Path | None = None,
    reliability_plot: Path | None = None,
    worst_frames: Path | None = None,
    worst_count: int = 12,
    detection: DetectionConfig = _DETECTION,
) -> None:
    """Measure a vehicle detector on labelled drives by KITTI's 2D protocol: average precision.

    Each drive is measured by itself. The fusion is measured beside each modality alone, and with modalities
    missing (Table 7.10).

    Example: trifuse evaluate detection kitti/object --detector fusion --bootstrap 1000

    Args:
        drives: Object folder, tracking folder or synthetic drive; one or several.
        detector: Detector: fusion, depthcn, rgb, dm, rm, or an ONNX file of a modality's detector.
        classes: Classes to measure, several with commas; else all of the network, Car for fusion and depthcn.
        fusions: ONNX files of further fusion networks to compare, such as the thesis' two variants.
        cache: Folder for the detections of the modalities before fusion; else the user's cache folder.
        plot: PNG file for the precision-recall curves.
        reliability_plot: PNG file for the share of correct detections over their scores, of the fusion.
        worst_frames: Folder for images of the frames with most errors.
        worst_count: Number of these images of each drive and class.
        detection: Detectors: networks, proposals, suppression.
    """
    from perception.cli.detectors import open_detector, open_fusion

    require_positive("--worst-count", worst_count)
    if reliability_plot is not None and detector != "fusion":
        raise UsageError("--reliability-plot", expected="--detector fusion", found=detector)
    opened = (
        open_fusion(detection, classes, metric, fusions, cache)
        if detector == "fusion"
        else open_detector(detector, detection, classes, metric)
    )
    images = None if worst_frames is None else WorstFramesFolder(worst_frames, worst_count)
    measured = measure_drives(opened, drives, drive, metric, images)
    document = EvaluationDocument(
        "detection",
        [one.data for one in measured],
        {**_protocol(), "values": {"difficulties": DIFFICULTIES, **asdict(metric)}},
        {"detector": detector, "detection": detection, "networks": opened.metadata},
        "; ".join(
            f"{name} was trained on: {one.get('training_data', 'not known')}"
            for name, one in opened.metadata.items()
        ),
    )
    publish_report(opened.title, DrivesReport(measured), document, report.json)
    if plot is not None:
        _plot_curves(plot, opened.title, measured)
    if reliability_plot is not None:
        from perception.render.fusion_plots import plot_reliability

        first = measured[0]
        title = f"{first.data.title}, IoU over {metric.iou[0]:g}"
        plot_reliability(reliability_plot, title, first.report.reliability)


@dataclass(frozen=True)
class LabelledDrive(EvaluatedDrive):
    """Labelled frames that the metrics of one drive rest on.

    Attributes:
        path: Path and sequence as on the command line.
        kind: `synthetic` where the exact truth of every point is known, else `real`.
        indices: Indices of the frames that were evaluated.
    """

    path: str = ""
    kind: str = "real"
    indices: tuple[int, ...] = ()

    @property
    def title(self) -> str:
        """Drive, kind and number of frames in words."""
        return f"{self.path} ({self.kind}, {self.frames_evaluated} frames)"


@dataclass(frozen=True)
class DriveSource:
    """A drive of the command line.

    Attributes:
        path: Folder.
        sequence: Sequence of a tracking folder.
    """

    path: Path
    sequence: str | None

    def __str__(self) -> str:
        """Return the folder and the sequence."""
        return " ".join(filter(None, (str(self.path), self.sequence)))

    def open(self, flags: DriveFlags, *, images: bool = True) -> Drive:
        """Open the drive.

        Raises:
            DriveError: it has no labelled boxes.
        """
        from data.open_drive import open_drive

        drive = open_drive(self.path, sequence=self.sequence, sensor=flags.sensor, images=images)
        if not drive.has_labels:
            raise DriveError(
                drive.root,
                expected="labelled boxes to measure against",
                found="none in this drive",
                advice="name the same drive in the tracking or object layout",
            )
        return drive


def drive_sources(paths: Sequence[Path], sequence: str | None) -> Iterator[DriveSource]:
    """Yield the drives of all paths: every sequence of a tracking folder, or the one that is named.

    Raises:
        DriveError: a path holds no drive.
    """
    from data.open_drive import sequences_in

    for path in paths:
        names = sequences_in(path)
        if sequence is None:
            yield from (DriveSource(path, name) for name in names)
        else:
            has_sequences = names != [None]
            yield DriveSource(path, sequence if has_sequences or len(paths) == 1 else None)


class LabelMeasure(Protocol):
    """A measure that compares the output of a detector with labels."""

    def update(self, output: Any, labels: Labels) -> None:  # noqa: ANN401 - output of its detector
        """Add one frame."""
        ...


def feed_measure(
    source: DriveSource,
    drive: Drive,
    flags: DriveFlags,
    detect: Callable[[Frame], Any],
    measure: LabelMeasure,
) -> LabelledDrive:
    """Detect in the frames of a drive with a progress bar, and update a measure with each.

    Raises:
        PerceptionError: a frame or its labels cannot be read or used, or no frame can.
    """
    from data.frames import frame_count, read_frames
    from perception.cli.progress import progress_bar
    from perception.geometry.threads import limit_blas_threads

    indices = []
    frames = read_frames(drive, on_bad_frame=flags.on_bad_frame, limit=flags.frames)
    for frame in progress_bar(frames, drive.name, frame_count(drive, flags.frames)):
        with limit_blas_threads():
            output = detect(frame)
        measure.update(output, drive.labels(frame.index))
        indices.append(frame.index)
    if not indices:
        raise DriveError(drive.root, expected="a frame that can be read", found="none")
    known = vars(EvaluatedDrive.of(drive, flags.frames, len(indices)))
    is_synthetic = drive.point_truth(indices[0]) is not None
    kind = "synthetic" if is_synthetic else "real"
    return LabelledDrive(**known, path=str(source), kind=kind, indices=tuple(indices))


@dataclass(frozen=True)
class DriveReport:
    """Metrics of one drive.

    Attributes:
        data: Frames that the metrics rest on.
        report: Metrics.
    """

    data: LabelledDrive
    report: Any


@dataclass(frozen=True)
class DrivesReport:
    """Metrics of several drives, each by itself.

    Attributes:
        drives: Metrics of each drive.
    """

    drives: Sequence[DriveReport]

    def tables(self) -> "Sequence[Table[Any]]":
        """Return the tables of one drive after the other."""
        return [
            replace(table, title=f"{one.data.title}: {table.title}")
            for one in self.drives
            for table in one.report.tables()
        ]

    def to_json(self) -> dict[str, Any]:
        """Return the metrics by drive."""
        return {
            one.data.path: {
                "kind": one.data.kind,
                "frames": one.data.frames_evaluated,
                **one.report.to_json(),
            }
            for one in self.drives
        }


@dataclass(frozen=True)
class WorstFramesFolder:
    """Images of the frames with most errors.

    Attributes:
        folder: Folder of DRIVE_CLASS_RANK_NUMBER.jpg.
        count: Number of images of each drive and class.
    """

    folder: Path
    count: int

    def write(
        self,
        drive: Drive,
        data: LabelledDrive,
        detector: "OpenedDetector",
        found: "tuple[TrueBoxes, DetectedBoxes]",
        iou: float,
    ) -> None:
        """Draw the worst frames of each class."""
        from data.atomic_file import write_jpeg
        from data.frames import file_number
        from perception.evaluation.detection.frame_errors import worst_frames
        from perception.render.detections import draw_detection_errors

        name = "_".join(re.findall(r"\w+", data.path))
        for one in detector.classes:
            worst = worst_frames(*found, data.frames_evaluated, one.at_iou(iou), self.count)
            for rank, errors in enumerate(worst):
                index, boxes = data.indices[errors.place], errors.detections
                image = draw_detection_errors(
                    detector.image(drive[index]),
                    errors.objects_px,
                    errors.ignored_px,
                    Detections(boxes.boxes_px, boxes.scores, boxes.types),
                    iou,
                )
                file = f"{name}_{one.name}_{rank:02d}_{file_number(drive, index):06d}.jpg"
                write_jpeg(self.folder / file, image, quality=95)


def measure_drives(
    detector: "OpenedDetector",
    drives: Sequence[Path],
    flags: DriveFlags,
    metric: PrecisionConfig,
    images: WorstFramesFolder | None = None,
) -> list[DriveReport]:
    """Measure a detector on every drive.

    Args:
        detector: Detector with its networks open.
        drives: Folders of labelled drives.
        flags: Sequence, sensor and frames.
        metric: Metric configuration; images show errors at its first IoU.
        images: Where to draw the frames with most errors, or None.

    Raises:
        PerceptionError: a drive, a frame or its labels cannot be read or used.
    """
    measured = []
    for source in drive_sources(drives, flags.sequence):
        drive = source.open(flags)
        detect, measure = detector.start(drive)
        data = feed_measure(source, drive, flags, detect, measure)
        measured.append(DriveReport(data, measure.compute()))
        if images is not None:
            images.write(drive, data, detector, measure.boxes(), metric.iou[0])
    return measured


def _plot_curves(path: Path, title: str, drives: "Sequence[DriveReport]") -> None:
    from perception.render.curve_plots import plot_curves

    panels = [
        replace(panel, title=f"{one.data.title}: {panel.title}")
        for one in drives
        for panel in one.report.panels()
    ]
    plot_curves(path, title, panels, share_y="all")


def _protocol() -> Mapping[str, str]:
    from perception.evaluation.detection.class_precision import PROTOCOL

    return {
        **PROTOCOL,
        "gain": (
            "average precision above that of the best single modality; in each bootstrap resample, of the best "
            "modality of that resample"
        ),
        "calibration": (
            "detections in ten bins of score; expected calibration error: mean difference of score and share of "
            "correct detections, of all labelled objects, at the first IoU"
        ),
    }
