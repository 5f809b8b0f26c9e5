"""Objects of the thesis' sets, or of the drives of a folder, that are available to be tracked."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Literal

from data.derived.object_truth import DriveObjects
from data.derived.obstacle_sequences import table_rows
from data.frames import frame_count, read_frames
from data.layouts import OpenConfig
from data.open_drive import open_drive, sequences_in
from data.pipeline_results import FrameProgress, no_progress
from data.recorded_drive import RecordedDrive
from data.synthetic.truth_files import truth_files
from perception.errors import DriveError, UsageError
from perception.evaluation.single_object.measure import SingleObjectMeasure, SingleObjectReport
from perception.evaluation.single_object.track import ObjectSequence, TargetObject
from perception.evaluation.single_object.tracker_runs import (
    TrackerMakers,
    TrackerRun,
    named_trackers,
    track_objects,
)
from perception.pipeline import PipelineConfig
from perception.tracking.single_object.config import SingleObjectTrackerConfig
from perception.types import Drive, OnBadFrame

_READING, _PIPELINE = OpenConfig(), PipelineConfig.for_motion("none")

ObjectSet = Literal["table-3.2", "3d-otd", "all", "present"]


@dataclass(frozen=True)
class ObjectSetConfig:
    """Objects to track, and the drives in which they are searched.

    Attributes:
        root: KITTI's tracking data, or a synthetic drive.
        objects: Set of the thesis, both sets together, or every labelled track of the available drives.
        sequence: Name of the only drive, or None for all.
        track_id: Track id of the only object, or None for all.
        frames: Number of frames from the start of each drive, or None for all.
        reading: How each drive is read.
        min_frames: Number of frames in which an object of the set `present` must be labelled.
    """

    root: Path
    objects: ObjectSet = "all"
    sequence: str | None = None
    track_id: int | None = None
    frames: int | None = None
    reading: OpenConfig = _READING
    min_frames: int = 15

    def __post_init__(self) -> None:
        """Validate the number of frames."""
        if self.frames is not None and self.frames < 2:
            raise UsageError("--frames", expected="at least 2", found=str(self.frames))


@dataclass(frozen=True)
class AbsentObject:
    """Requested object that is not available.

    Attributes:
        sequence: Object and its frames.
        reason: What is missing.
    """

    sequence: ObjectSequence
    reason: str


@dataclass(frozen=True)
class DriveTargets:
    """Drive with objects to track.

    Attributes:
        drive: Drive whose frames are read.
        objects: Objects to track, at least one.
    """

    drive: RecordedDrive
    objects: Sequence[TargetObject]


@dataclass(frozen=True)
class AvailableObjects:
    """Available and absent objects of a set.

    Attributes:
        drives: Drives with objects to track.
        absent: Objects of the thesis' sets that are not available.
    """

    drives: Sequence[DriveTargets]
    absent: Sequence[AbsentObject]

    def absent_lines(self) -> list[str]:
        """Return the names of the absent objects, one line for each reason."""
        names: dict[str, list[str]] = {}
        for one in self.absent:
            names.setdefault(one.reason, []).append(one.sequence.name)
        return [f"  {reason}: {', '.join(which)}" for reason, which in names.items()]

    def heading(self, root: Path, set: ObjectSet, count: int) -> str:
        """Return how many objects of a set were tracked, and which are absent."""
        total = count + len(self.absent)
        heading = f"{root}: {count} of {total} sequences of the set {set}"
        absent = self.absent_lines()
        return "\n".join([f"{heading}; absent:", *absent]) if absent else heading

    def to_json(self) -> dict[str, object]:
        """Return the drives, and the reason of each absent object."""
        drives = [
            {"drive": one.drive.name, "sensor": one.drive.sensor.name, "frames": len(one.drive)}
            for one in self.drives
        ]
        return {
            "drives": drives,
            "absent": {one.sequence.name: one.reason for one in self.absent},
        }


def find_objects(config: ObjectSetConfig) -> AvailableObjects:
    """Open the drives of a set and find its objects in them.

    Raises:
        DriveError: There is no object to track.
        PerceptionError: A drive cannot be opened, or its labels cannot be read.
    """
    if config.objects == "present":
        found = AvailableObjects(list(_present(config)), ())
    else:
        found = _published(config)
    if not found.drives:
        reasons = sorted({one.reason for one in found.absent})
        raise DriveError(
            config.root,
            expected=f"labelled objects of the set {config.objects}",
            found="; ".join(reasons) or f"none with {config.min_frames} labelled frames",
            advice="track every labelled object with --set present" if reasons else None,
        )
    return found


def _present(config: ObjectSetConfig) -> Iterator[DriveTargets]:
    names = sequences_in(config.root) if config.sequence is None else [config.sequence]
    for name in names:
        drive = _open(config, name)
        labelled = DriveObjects.of(drive)
        requested = [
            one for one in labelled.sequences(config.min_frames) if _is_requested(one, config)
        ]
        cut = [_cut(one, drive, labelled, config.frames) for one in requested]
        objects = [one for one in cut if one is not None and len(one.truth) >= config.min_frames]
        if objects:
            yield DriveTargets(drive, objects)


def _published(config: ObjectSetConfig) -> AvailableObjects:
    tables = {
        "table-3.2": table_3_2(),
        "3d-otd": table_a_1(),
        "all": unique_sequences([*table_3_2(), *table_a_1()]),
    }
    here = {str(name) for name in sequences_in(config.root)}
    by_drive: dict[str, list[ObjectSequence]] = {}
    for one in tables[config.objects]:
        is_requested = config.sequence is None or config.sequence.zfill(4) == one.sequence
        if is_requested and _is_requested(one, config):
            by_drive.setdefault(one.sequence, []).append(one)
    drives: list[DriveTargets] = []
    absent: list[AbsentObject] = []
    for name, requested in sorted(by_drive.items()):
        if name not in here:
            absent += [AbsentObject(one, f"no scans of sequence {name}") for one in requested]
            continue
        found = _published_of(_open(config, name), requested, config.frames)
        drives += found.drives
        absent += found.absent
    return AvailableObjects(drives, absent)


def _published_of(
    drive: RecordedDrive, requested: Sequence[ObjectSequence], frames: int | None
) -> AvailableObjects:
    """Find objects in the drive of their name."""
    if truth_files(drive) is not None:
        return AvailableObjects((), [AbsentObject(one, "a synthetic drive") for one in requested])
    if not drive.has_labels:
        reason = f"no labels of sequence {drive.name}"
        return AvailableObjects((), [AbsentObject(one, reason) for one in requested])
    labelled, objects, absent = DriveObjects.of(drive), [], []
    for one in requested:
        cut = _cut(one, drive, labelled, frames)
        if cut is None:
            absent.append(AbsentObject(one, "not labelled in the frames here"))
        else:
            objects.append(cut)
    return AvailableObjects([DriveTargets(drive, objects)] if objects else [], absent)


def _cut(
    requested: ObjectSequence, drive: RecordedDrive, labelled: DriveObjects, frames: int | None
) -> TargetObject | None:
    """Return the object in the available frames, or None where it has fewer than two."""
    last = min(requested.last_frame, frame_count(drive, frames) - 1)
    cut = replace(requested, last_frame=last)
    truth = labelled.track(cut)
    return TargetObject(cut, truth, requested.frame_count) if len(truth) >= 2 else None


def _is_requested(one: ObjectSequence, config: ObjectSetConfig) -> bool:
    return config.track_id is None or config.track_id == one.track_id


def _open(config: ObjectSetConfig, sequence: str | None) -> RecordedDrive:
    drive = open_drive(config.root, sequence=sequence, config=config.reading)
    if not drive.is_sequence:
        raise DriveError(
            drive.root,
            expected="a sequence of frames",
            found="object frames",
            advice="name tracking sequences, or a drive that `trifuse synth` wrote",
        )
    return drive


@cache
def table_3_2() -> tuple[ObjectSequence, ...]:
    """Return the 8 sequences on which the thesis evaluates its fusion tracker."""
    printed: dict[str, dict[str, dict[str, float]]] = {}
    for row in table_rows("tables_7_6_7_7.csv"):
        number, metric = row.pop("number"), row.pop("metric")
        errors = {tracker: float(error) for tracker, error in row.items() if error}
        printed.setdefault(f"3.2 ({number})", {})[metric] = errors
    sequences = _read("table_3_2.csv", "3.2 ({})")
    return tuple(replace(one, printed=printed[one.name]) for one in sequences)


@cache
def table_a_1() -> tuple[ObjectSequence, ...]:
    """Return the 50 sequences of the thesis' benchmark of 3D object tracking in driving environments."""
    return _read("table_a_1.csv", "OTD {}")


def unique_sequences(sequences: Sequence[ObjectSequence]) -> list[ObjectSequence]:
    """Return each sequence once, under all of its names."""
    names: dict[tuple[str, int, int, int], list[ObjectSequence]] = {}
    for one in sequences:
        key = (one.sequence, one.track_id, one.first_frame, one.last_frame)
        names.setdefault(key, []).append(one)
    return [
        replace(
            same[-1],
            name=" = ".join(one.name for one in same),
            stated={key: value for one in same for key, value in one.stated.items()},
            printed={key: errors for one in same for key, errors in one.printed.items()},
        )
        for same in names.values()
    ]


def _read(name: str, title: str) -> tuple[ObjectSequence, ...]:
    return tuple(_parse(row, title) for row in table_rows(name))


def _parse(row: dict[str, str], title: str) -> ObjectSequence:
    return ObjectSequence(
        name=title.format(row.pop("number")),
        sequence=row.pop("sequence"),
        track_id=int(row.pop("track_id")),
        kind=row.pop("kind"),
        first_frame=int(row.pop("first_frame")),
        last_frame=int(row.pop("last_frame")),
        stated=row,
    )


def run_trackers(
    drive: Drive,
    targets: Sequence[TargetObject],
    makers: TrackerMakers,
    pipeline: PipelineConfig = _PIPELINE,
    on_bad_frame: OnBadFrame = "stop",
    progress: FrameProgress = no_progress,
) -> list[dict[str, TrackerRun]]:
    """Let trackers track objects of one drive; see `track_objects`.

    Args:
        drive: Drive with the objects.
        targets: Objects to track.
        makers: Trackers by name.
        pipeline: Configuration of the pipeline up to the ground.
        on_bad_frame: Stop at a damaged frame, or skip it.
        progress: Progress bar over the frames.
    """
    limit = max((one.sequence.last_frame + 1 for one in targets), default=0)
    frames = read_frames(drive, on_bad_frame=on_bad_frame, limit=limit)
    bar = progress(frames, drive.name, frame_count(drive, limit))
    return track_objects(bar, drive.sensor, targets, makers, pipeline)


def measure_trackers(
    found: AvailableObjects,
    names: Sequence[str],
    tracker: SingleObjectTrackerConfig,
    pipeline: PipelineConfig,
    on_bad_frame: OnBadFrame,
    progress: FrameProgress,
) -> SingleObjectReport:
    """Return the metrics of trackers on all objects.

    Args:
        found: Objects.
        names: Names of the trackers.
        tracker: Their configuration.
        pipeline: Configuration of the pipeline up to the ground.
        on_bad_frame: Stop at a damaged frame, or skip it.
        progress: Progress bar over the frames.
    """
    measure = SingleObjectMeasure(names)
    for one in found.drives:
        makers = named_trackers(names, one.drive.sensor, tracker)
        runs = run_trackers(one.drive, one.objects, makers, pipeline, on_bad_frame, progress)
        for target, by_name in zip(one.objects, runs, strict=True):
            measure.update(target, by_name, one.drive.calibration)
    return measure.compute()
