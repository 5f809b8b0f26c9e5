"""Which objects of the thesis' sets, or of a drive, are there to be followed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from data.derived.object_truth import DriveObjects
from data.derived.single_object import ObjectSequence, table_3_2, table_a_1, unique_sequences
from data.frames import frame_count
from data.kitti.objects import ObjectFrames
from data.kitti.sequence import KittiSequence
from data.open_drive import open_drive, sequences_in
from data.synthetic.truth_files import truth_files
from perception.cli.evaluations.otd_steps import TargetObject
from perception.errors import DriveError, UsageError

ObjectSet = Literal["table-3.2", "3d-otd", "all", "present"]


@dataclass(frozen=True)
class ObjectSetConfig:
    """Which objects are asked for, and of which drives.

    Attributes:
        root: of KITTI's tracking data, or of a synthetic drive.
        objects: a set of the thesis, both together, or every labelled track of the drives at hand.
        sequence: only this drive, or None for all.
        track_id: only this object, or None for all.
        frames: only so many from the start of each drive, or None for all.
        sensor: name of a LiDAR model or a .json file, or None for what the drive says.
        min_frames: in which an object of the set `present` is labelled.
    """

    root: Path
    objects: ObjectSet = "all"
    sequence: str | None = None
    track_id: int | None = None
    frames: int | None = None
    sensor: str | None = None
    min_frames: int = 15

    def __post_init__(self) -> None:
        """Refuse no frames."""
        if self.frames is not None and self.frames < 2:
            raise UsageError("--frames", expected="at least 2", found=str(self.frames))


@dataclass(frozen=True)
class AbsentObject:
    """An object that was asked for and cannot be followed.

    Attributes:
        sequence: which.
        reason: what is not there.
    """

    sequence: ObjectSequence
    reason: str


@dataclass(frozen=True)
class DriveTargets:
    """One drive with objects to follow.

    Attributes:
        drive: whose frames are read.
        objects: at least one.
    """

    drive: KittiSequence
    objects: Sequence[TargetObject]


@dataclass(frozen=True)
class AvailableObjects:
    """What there is of a request.

    Attributes:
        drives: with objects to follow.
        absent: of the thesis' sets, what is not there.
    """

    drives: Sequence[DriveTargets]
    absent: Sequence[AbsentObject]


def find_objects(config: ObjectSetConfig) -> AvailableObjects:
    """Open the drives of a request and find its objects in them.

    Raises:
        DriveError: there is no object to follow.
        PerceptionError: a drive cannot be opened, or its labels not be read.
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
            advice="follow whatever is labelled with --set present" if reasons else None,
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
    drive: KittiSequence, requested: Sequence[ObjectSequence], frames: int | None
) -> AvailableObjects:
    """Look for objects in the drive whose name they give."""
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
    requested: ObjectSequence, drive: KittiSequence, labelled: DriveObjects, frames: int | None
) -> TargetObject | None:
    """Return the object in the frames at hand, or None where there are less than two of it."""
    last = min(requested.last_frame, frame_count(drive, frames) - 1)
    cut = replace(requested, last_frame=last)
    truth = labelled.track(cut)
    return TargetObject(cut, truth, requested.frame_count) if len(truth) >= 2 else None


def _is_requested(one: ObjectSequence, config: ObjectSetConfig) -> bool:
    return config.track_id is None or config.track_id == one.track_id


def _open(config: ObjectSetConfig, sequence: str | None) -> KittiSequence:
    drive = open_drive(config.root, sequence=sequence, sensor=config.sensor)
    if isinstance(drive, ObjectFrames):
        raise DriveError(
            drive.root,
            expected="frames that follow each other",
            found="object frames",
            advice="name tracking sequences, or a drive that `trifuse synth` wrote",
        )
    return drive
