"""Detectors measured on labelled drives, each drive by itself."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from data.derived.instance_boxes import InstanceLabels
from data.detections.measured_detectors import MeasuredDetector
from data.detections.unlearned_frames import LearnedCounts, count_learned_frames
from data.frames import file_number, frame_count, read_frames
from data.kitti.drive import KittiDrive
from data.labelled_drives import LabelledDrives
from data.open_drive import open_drive, sequences_in
from data.recorded_drive import RecordedDrive
from data.splits.files import read_split
from data.splits.parts import Part
from perception.atomic_file import write_jpeg
from perception.errors import DriveError
from perception.evaluation.detection.frame_errors import worst_frames
from perception.evaluation.report import Report, Table
from perception.geometry.threads import limit_blas_threads
from perception.render.curve_plots import plot_curves
from perception.render.detections import draw_detection_errors
from perception.render.figure import save_figure
from perception.render.fusion_plots import reliability_figure
from perception.types import Detections, Drive, Frame


def drive_kind(drive: Drive) -> str:
    """Return `synthetic` for a drive of `trifuse synth`, else `real`.

    In KITTI's layouts with boxes beside points, only synthetic drives know the class of every point.
    """
    if not isinstance(drive, KittiDrive) or isinstance(drive, InstanceLabels):
        return "real"
    return "synthetic" if drive.has_labels and drive.has_point_truth else "real"


@dataclass(frozen=True)
class DriveInfo:
    """Labelled frames that the metrics of one drive rest on.

    Attributes:
        name: Path and sequence as given.
        kind: Kind of the drive: real or synthetic.
        root: Folder of the drive.
        sensor: Name of the LiDAR model.
        frames: Number of frames of the drive, or of its part.
        frames_evaluated: Number of frames that were evaluated.
        part: Part of a split, or None for all frames.
        seen_in_training: How many of the evaluated frames each network learned from.
    """

    name: str
    kind: str
    root: Path
    sensor: str
    frames: int
    frames_evaluated: int
    part: Part | None
    seen_in_training: LearnedCounts

    @property
    def title(self) -> str:
        """Drive, kind, part and number of frames in words."""
        part = "" if self.part is None else f"part {self.part}, "
        return f"{self.name} ({self.kind}, {part}{self.frames_evaluated} frames)"


@dataclass(frozen=True)
class DrivesReport(Report):
    """Metrics of several drives, each by itself.

    Attributes:
        drives: Frames and metrics of each drive.
    """

    drives: Sequence[tuple[DriveInfo, Any]]

    @property
    def data(self) -> list[dict[str, Any]]:
        """Frames of each drive."""
        return [asdict(info) for info, _ in self.drives]

    @property
    def seen_in_training(self) -> str:
        """How many frames of each drive the networks learned from, in a line a drive."""
        return "\n".join(f"{info.name}: {info.seen_in_training}" for info, _ in self.drives)

    def tables(self) -> Sequence[Table[Any]]:
        """Return the tables of one drive after the other."""
        return [
            replace(table, title=f"{info.title}: {table.title}")
            for info, report in self.drives
            for table in report.tables()
        ]

    def to_json(self) -> dict[str, Any]:
        """Return the metrics by drive."""
        return {
            info.name: {"kind": info.kind, "frames": info.frames_evaluated, **report.to_json()}
            for info, report in self.drives
        }

    def panels(self) -> list[Any]:
        """Return the panels of all drives."""
        return [
            replace(panel, title=f"{info.title}: {panel.title}")
            for info, report in self.drives
            for panel in report.panels()
        ]

    def plot(self, path: Path, title: str) -> None:
        """Plot the panels of all drives."""
        plot_curves(path, title, self.panels(), share_y="all")

    def plot_reliability(self, path: Path, iou: float) -> None:
        """Plot the share of correct detections over their scores, of the first class on the first drive."""
        info, first = self.drives[0]
        of_class, *_ = first.classes.values()
        title = f"{info.title}, IoU over {iou:g}"
        save_figure(reliability_figure(title, of_class.reliability), path)


@dataclass(frozen=True)
class DriveReader(LabelledDrives):
    """How the labelled drives of detectors are opened, read, and given to a detector frame by frame."""

    def drives(self, paths: Sequence[Path]) -> list[tuple[str, RecordedDrive]]:
        """Open the drives of all paths, with their names; of a split, those that have frames in the part.

        Raises:
            DriveError: a path holds no drive, or one without labelled boxes, or lacks a frame of the part.
            UsageError: the split is damaged, of other drives, or has no frame of them in the part.
        """
        named = [one for path in paths for one in self._open(path, is_alone=len(paths) == 1)]
        if self.split is None:
            return named
        split, part = read_split(self.split), self.part or "test"
        split.require_part([drive for _, drive in named], part)
        return [(name, one) for name, drive in named for one in split.select([drive], part)]

    def feed(
        self,
        name: str,
        drive: RecordedDrive,
        detect: Callable[[Frame], Any],
        measure: Any,  # noqa: ANN401 - of its detector
        networks: Mapping[str, Mapping[str, str]],
    ) -> tuple[DriveInfo, list[int]]:
        """Detect in the frames of a drive and update a measure with each; return their indices, too.

        Args:
            name: Path and sequence as given.
            drive: Labelled frames.
            detect: Function from a frame to what the measure takes.
            measure: Measure of the detector.
            networks: Metadata of each network, which may state the frames that it learned from.

        Raises:
            PerceptionError: a frame or its labels cannot be read or used, or no frame can.
        """
        indices = []
        frames = read_frames(drive, on_bad_frame=self.on_bad_frame, limit=self.frames)
        for frame in self.progress(frames, drive.name, frame_count(drive, self.frames)):
            with limit_blas_threads():
                output = detect(frame)
            measure.update(output, drive.labels(frame.index))
            indices.append(frame.index)
        return self.describe(name, drive, indices, networks), indices

    def describe(
        self,
        name: str,
        drive: RecordedDrive,
        indices: Sequence[int],
        networks: Mapping[str, Mapping[str, str]],
    ) -> DriveInfo:
        """Describe the frames of a drive that were evaluated, with a warning where networks learned from them.

        Args:
            name: Path and sequence as given.
            drive: Labelled frames.
            indices: Indices of the evaluated frames.
            networks: Metadata of each network, which may state the frames that it learned from.

        Raises:
            DriveError: There is no frame.
        """
        if not indices:
            raise DriveError(drive.root, expected="a frame that can be read", found="none")
        learned = count_learned_frames(networks, drive.select(indices))
        learned.warn(name)
        return DriveInfo(
            name,
            drive_kind(drive),
            drive.root.resolve(),
            drive.sensor.name,
            len(drive),
            len(indices),
            None if self.split is None else self.part or "test",
            learned,
        )

    def _open(self, path: Path, *, is_alone: bool) -> Iterator[tuple[str, RecordedDrive]]:
        names = sequences_in(path)
        if self.sequence is not None:
            names = [self.sequence] if names != [None] or is_alone else names
        for name in names:
            drive = open_drive(path, sequence=name, config=self.reading)
            if not drive.has_labels:
                raise DriveError(
                    drive.root,
                    expected="labelled boxes to measure against",
                    found="none in this drive",
                    advice="name `labels` in the drive.yaml of a folder, or take the tracking or object layout",
                )
            yield " ".join(filter(None, (str(path), name))), drive


def measure_drives(
    detector: MeasuredDetector,
    paths: Sequence[Path],
    reader: DriveReader,
    worst: tuple[Path, int] | None = None,
) -> DrivesReport:
    """Measure a detector on every drive of the paths.

    Args:
        detector: Detector with its networks open.
        paths: Folders of labelled drives.
        reader: How they are opened and read.
        worst: Folder for images of the frames with most errors, and their number for each drive and class.

    Raises:
        PerceptionError: a drive, a frame or its labels cannot be read or used.
    """
    measured = []
    for name, drive in reader.drives(paths):
        detect, measure = detector.start(drive)
        info, indices = reader.feed(name, drive, detect, measure, detector.metadata)
        measured.append((info, measure.compute()))
        if worst is not None:
            _draw_worst_frames(*worst, name, drive, detector, measure, indices)
    return DrivesReport(measured)


def _draw_worst_frames(  # noqa: PLR0913, PLR0917 - what the images show
    folder: Path,
    count: int,
    name: str,
    drive: Drive,
    detector: MeasuredDetector,
    measure: Any,  # noqa: ANN401 - of its detector
    indices: Sequence[int],
) -> None:
    """Write DRIVE_CLASS_RANK_NUMBER.jpg of the frames with most errors of each class."""
    stem, boxes = "_".join(re.findall(r"\w+", name)), measure.boxes()
    for one in detector.classes:
        target = one.at_iou(measure.config.iou[0])
        found = worst_frames(boxes, target, count)
        for rank, errors in enumerate(found):
            index, detected = indices[errors.place], errors.detections
            image = draw_detection_errors(
                detector.image(drive[index]),
                errors.objects_px,
                errors.ignored_px,
                Detections(detected.boxes_px, detected.scores, detected.types),
                target.iou,
            )
            file = f"{stem}_{one.name}_{rank:02d}_{file_number(drive, index):06d}.jpg"
            write_jpeg(folder / file, image, quality=95)
