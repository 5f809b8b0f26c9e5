"""Random scans as overlay images, whose obstacles are counted on a sheet (7.1.1)."""

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from data.derived.motion_labels import evaluation_labels, obstacle_measure
from data.derived.obstacle_sequences import SequenceSet, find_sequences, table_3_1
from data.frames import frame_count
from data.kitti.reading import read_text
from data.labelled_drives import LabelledDrives
from data.open_drive import open_drive
from perception.atomic_file import write_atomically, write_jpeg
from perception.errors import DriveError, LabelError
from perception.evaluation.config import ObstacleProtocol
from perception.evaluation.obstacle_counts import ObstacleCounts
from perception.evaluation.obstacle_sets import CountingReport
from perception.pipeline import PipelineConfig
from perception.render.counted_obstacles import draw_counted_obstacles
from perception.types import Drive, Int

_COLUMNS = tuple(field.name for field in fields(ObstacleCounts))
_HEADER = ("sequence", "frame", "image", *_COLUMNS)
SHEET = "counting_sheet.csv"


@dataclass(frozen=True)
class CountedImage:
    """One row of the sheet.

    Attributes:
        sequence: Name of the sequence.
        frame: Name of the frame.
        image: Name of the image's file, beside the sheet.
        counts: Counts of the image, or None while they are not filled in.
    """

    sequence: str
    frame: str
    image: str
    counts: ObstacleCounts | None


def choose_frames(sequence: str, frames: int, count: int, seed: int) -> Int:
    """Return the random numbers of frames of a sequence, each once and in order; all where there are fewer."""
    random = np.random.default_rng([seed, *sequence.encode()])
    return np.sort(random.permutation(frames)[:count])


def write_counting_sheet(path: Path, rows: Sequence[CountedImage]) -> None:
    """Write the sheet; counts that are not known are left empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_HEADER)
    for row in rows:
        empty = [""] * len(_COLUMNS)
        counts = empty if row.counts is None else [getattr(row.counts, name) for name in _COLUMNS]
        writer.writerow([row.sequence, row.frame, row.image, *counts])
    write_atomically(path, text.getvalue().encode())


def read_counting_sheet(path: Path) -> list[CountedImage]:
    """Read a sheet; rows without any count are not filled in yet.

    Raises:
        LabelError: A column is missing, or a row has some counts but not all, or counts that cannot be.
    """
    reader = csv.DictReader(read_text(path, LabelError, "a counting sheet as text").splitlines())
    missing = {*_HEADER} - {*(reader.fieldnames or ())}
    if missing:
        found = ", ".join(reader.fieldnames or ()) or "an empty file"
        raise LabelError(path, expected=f"the columns {', '.join(_HEADER)}", found=found)
    return [_parse(f"{path} row {number}", row) for number, row in enumerate(reader, start=2)]


def _parse(where: str, row: dict[str, str]) -> CountedImage:
    """Return one row, whose counts are all filled in or all empty."""
    texts = [(row[name] or "").strip() for name in _COLUMNS]
    counts = (
        ObstacleCounts(*(int(text) for text in texts))
        if all(text.isascii() and text.isdigit() for text in texts)
        else None
    )
    if any(texts) and (counts is None or not _is_possible(counts)):
        raise LabelError(
            where,
            expected="whole numbers in all columns, no more moving than obstacles, and no more missed than there are",
            found=", ".join(texts),
            advice="correct the row, or leave all of its counts empty",
        )
    return CountedImage(row["sequence"], row["frame"], row["image"], counts)


def _is_possible(counts: ObstacleCounts) -> bool:
    return (
        counts.moving <= counts.obstacles
        and counts.missed_obstacles <= counts.obstacles
        and counts.missed_moving <= counts.moving
    )


@dataclass(frozen=True)
class CountedScans:
    """Random scans of each drive.

    Attributes:
        folder: Folder of the sheet and of its images.
        scans: Number of random scans of each drive.
        seed: Seed of the choice of scans.
        pipeline: Pipeline configuration.
        protocol: Protocol of the evaluation.
    """

    folder: Path
    scans: int
    seed: int
    pipeline: PipelineConfig
    protocol: ObstacleProtocol

    @property
    def sheet(self) -> Path:
        """The counting sheet."""
        return self.folder / SHEET

    def evaluate(
        self, root: Path, set: SequenceSet | None, reader: LabelledDrives
    ) -> CountingReport:
        """Write the images and the sheet where there is no sheet yet, and return what the sheet holds.

        Args:
            root: Folder of a drive with images, or of tracking sequences; a person needs no labels.
            set: Name of the set of sequences, or None for one drive.
            reader: How the drives are opened and read.

        Raises:
            DriveError: A drive has no images.
            PerceptionError: A frame cannot be read or used.
        """
        if not self.sheet.exists():
            names = [reader.sequence]
            if set is not None:
                names = [one.sequence for one in find_sequences(root, set, reader.sequence)[0]]
            opened = [open_drive(root, sequence=name, config=reader.reading) for name in names]
            drives = reader.select(opened)
            for drive in drives:
                if not drive.has_images or drive.calibration is None:
                    raise DriveError(
                        drive.root,
                        expected=f"images and a camera calibration of {drive.name}, to project voxels into",
                        found="none",
                        advice="add image_02 and calib, or evaluate without --counting-sheet",
                    )
            rows = [row for drive in drives for row in self._write(drive, reader)]
            write_counting_sheet(self.sheet, rows)
        return self.report()

    def report(self) -> CountingReport:
        """Return what the sheet holds, in the form of Table 7.2.

        Raises:
            LabelError: The sheet cannot be read.
        """
        rows = read_counting_sheet(self.sheet)
        names = {one.sequence: one.name for one in table_3_1()}
        counts: dict[str, ObstacleCounts] = {}
        for row in rows:
            if row.counts is not None:
                name = names.get(row.sequence, row.sequence)
                counts[name] = counts.get(name, ObstacleCounts()) + row.counts
        counted = sum(row.counts is not None for row in rows)
        return CountingReport(self.sheet, counts, len(rows), counted, table_3_1())

    def _write(self, drive: Drive, reader: LabelledDrives) -> Iterator[CountedImage]:
        """Write the images of the random scans of a drive, and yield their rows."""
        measure = obstacle_measure(drive, self.pipeline.area_of(drive.sensor), self.protocol)
        count = frame_count(drive, reader.frames)
        frames = {*choose_frames(drive.name, count, self.scans, self.seed).tolist()}
        until_last = replace(reader, frames=max(frames) + 1)
        for result in until_last.results(drive, self.pipeline):
            frame = result.frame
            truth = drive.point_truth(frame.index)
            measure.update(result, evaluation_labels(drive, frame.index), truth)
            if frame.index not in frames or frame.image is None:
                continue
            counted = measure.obstacles_of(frame.index)
            name = f"{drive.name}_{frame.name}.jpg"
            write_jpeg(self.folder / name, draw_counted_obstacles(result, counted))
            counts = None if counted is None or truth is None else counted.counts
            yield CountedImage(drive.name, frame.name, name, counts)
