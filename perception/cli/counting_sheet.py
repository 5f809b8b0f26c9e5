"""Random scans as overlay images with a sheet in which a person counts obstacles (7.1.1)."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from data.derived.obstacle_sequences import SequenceSet, table_3_1
from perception.cli.flags import LabelledDriveFlags, require_positive
from perception.cli.parser import FlagGroup
from perception.cli.sequence_sets import find_sequences
from perception.errors import DriveError
from perception.pipeline import PipelineConfig
from perception.types import Drive

if TYPE_CHECKING:
    from data.results.counting_sheet import CountedImage
    from perception.evaluation.obstacle_measure import ObstacleMeasure
    from perception.evaluation.obstacle_sets import CountingReport

_SHEET = "counting_sheet.csv"


@dataclass(frozen=True)
class CountingFlags(FlagGroup):
    """Counting by a person.

    Attributes:
        counting_sheet: Folder of a counting sheet: the first call writes overlay images of random scans and a sheet
            with empty counts, which exact truth fills in; every call prints the sheet in the form of Table 7.2.
        scans: Number of random scans of each sequence.
        seed: Seed of the choice of scans.
    """

    counting_sheet: Path | None = None
    scans: int = 25
    seed: int = 0

    def __post_init__(self) -> None:
        """Validate the number of scans."""
        require_positive("--scans", self.scans)


@dataclass(frozen=True)
class CountingJob:
    """Writes the images of random scans, and what is known of their obstacles.

    Attributes:
        folder: Folder of the sheet and of its images.
        scans: Number of random scans of each sequence.
        seed: Seed of the choice of scans.
        drive: Flags of the drives.
        pipeline: Pipeline configuration.
        measure_of: Function that returns the measure of a drive's obstacles.
    """

    folder: Path
    scans: int
    seed: int
    drive: LabelledDriveFlags
    pipeline: PipelineConfig
    measure_of: "Callable[[Drive], ObstacleMeasure]"

    def report(self, root: Path, set: SequenceSet | None) -> "CountingReport":
        """Write the images and the sheet where there is no sheet yet, and return what the sheet holds.

        Raises:
            DriveError: A drive has no images, or the folder holds no sequence of the set.
            LabelError: The sheet cannot be read.
            PerceptionError: A frame cannot be read or used.
        """
        from data.results.counting_sheet import read_counting_sheet, write_counting_sheet
        from perception.evaluation.obstacle_counts import ObstacleCounts
        from perception.evaluation.obstacle_sets import CountingReport

        path = self.folder / _SHEET
        if not path.exists():
            drives = self._open_drives(root, set)
            write_counting_sheet(path, [row for drive in drives for row in self._write(drive)])
        rows = read_counting_sheet(path)
        names = {one.sequence: one.name for one in table_3_1()}
        counts: dict[str, ObstacleCounts] = {}
        for row in rows:
            if row.counts is not None:
                name = names.get(row.sequence, row.sequence)
                counts[name] = counts.get(name, ObstacleCounts()) + row.counts
        counted = sum(row.counts is not None for row in rows)
        return CountingReport(path, counts, len(rows), counted, table_3_1())

    def _open_drives(self, root: Path, set: SequenceSet | None) -> Sequence[Drive]:
        """Open the drives with images; a person needs no labels."""
        from data.open_drive import open_drive

        chosen = [self.drive.sequence]
        if set is not None:
            chosen = [one.sequence for one in find_sequences(root, set, self.drive.sequence)[0]]
        sensor = self.drive.sensor
        drives = self.drive.select(
            [open_drive(root, sequence=name, sensor=sensor, images=True) for name in chosen]
        )
        for drive in drives:
            if not drive.has_images or drive.calibration is None:
                raise DriveError(
                    drive.root,
                    expected=f"images and a camera calibration of {drive.name}, to project voxels into",
                    found="none",
                    advice="add image_02 and calib, or evaluate without --counting-sheet",
                )
        return drives

    def _write(self, drive: Drive) -> "Iterator[CountedImage]":
        """Write the images of the random scans of a drive, and yield their rows."""
        from data.frames import frame_count
        from data.results.counting_sheet import CountedImage, choose_frames
        from perception.atomic_file import write_jpeg
        from perception.cli.drive_results import drive_results
        from perception.render.counted_obstacles import draw_counted_obstacles

        count = frame_count(drive, self.drive.frames)
        frames = {*choose_frames(drive.name, count, self.scans, self.seed).tolist()}
        measure, skips = self.measure_of(drive), self.drive.on_bad_frame
        last = max(frames) + 1
        for result in drive_results(drive, self.pipeline, limit=last, on_bad_frame=skips):
            frame = result.frame
            truth = drive.point_truth(frame.index)
            measure.update(result, drive.labels(frame.index) if drive.has_labels else None, truth)
            if frame.index not in frames or frame.image is None:
                continue
            counted = measure.obstacles_of(frame.index)
            name = f"{drive.name}_{frame.name}.jpg"
            write_jpeg(self.folder / name, draw_counted_obstacles(result, counted))
            counts = None if counted is None or truth is None else counted.counts
            yield CountedImage(drive.name, frame.name, name, counts)
