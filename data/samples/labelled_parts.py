"""Drives with the frames that train, validate and test a network."""

import difflib
import logging
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from data.open_drive import open_drives
from data.recorded_drive import RecordedDrive
from data.samples.config import DriveDataConfig, TrainingDrives
from data.splits.draw import draw_split
from data.splits.files import read_split
from data.splits.frame_split import FrameSplit
from data.splits.training_frames import ENTRY, UNKNOWN, TrainingFrames
from perception.errors import LabelError
from perception.evaluation.detection.protocol import RECALL_STEPS

log = logging.getLogger(__name__)
_NO_SPLIT, _NO_FRAMES = "none", TrainingFrames(frozenset())


def require_classes(class_names: Sequence[str], labels: Counter[str], where: str) -> None:
    """Validate that each class has labels, in any case of letters.

    Args:
        class_names: Classes that are asked for.
        labels: Number of labels of each type.
        where: Labels in words, for the error.

    Raises:
        LabelError: a class has none; its advice is the labelled type of the nearest name.
    """
    types = {name.lower(): name for name, count in labels.items() if count}
    missing = [name for name in class_names if name.lower() not in types]
    if not missing:
        return
    near = [
        types[name]
        for one in missing
        for name in difflib.get_close_matches(one.lower(), types, n=1)
    ]
    raise LabelError(
        where,
        expected=f"at least one {' and one '.join(missing)}",
        found=", ".join(f"{count} {name}" for name, count in labels.most_common()) or "no object",
        advice=f"write {', '.join(near)}"
        if near
        else "choose drives with such labels, or classes by --model.classes",
    )


def warn_of_missing(class_names: Sequence[str], labels: Counter[str], where: str) -> None:
    """Warn of classes without labels, which a network does not learn.

    Raises:
        LabelError: No class has labels.
    """
    missing = [name for name in class_names if not labels[name]]
    if len(missing) == len(class_names):
        require_classes(missing, labels, where)
    if missing:
        log.warning("%s: no %s, which will not be detected", where, ", no ".join(missing))


def warn_of_few(class_names: Sequence[str], labels: Counter[str], where: str) -> None:
    """Warn of classes with too few objects for KITTI's average precision, which samples as many recalls."""
    counts = Counter[str]()
    for name, count in labels.items():
        counts[name.lower()] += count
    few = [
        f"{counts[name.lower()]} {name}"
        for name in class_names
        if counts[name.lower()] <= RECALL_STEPS
    ]
    if few:
        log.warning(
            "%s: expected more than %d objects of each class, for an average precision to rely on, found %s",
            where,
            RECALL_STEPS,
            ", ".join(few),
        )


@dataclass(frozen=True)
class LabelledParts:
    """Drives of each part, with its frames alone.

    Attributes:
        train: Drives to learn from.
        val: Drives that choose the best epoch.
        test: Drives on which the result is measured, maybe none.
        split: Fingerprint of the split.
        streamed: Frames of the shards to learn from beside the drives; None where they are not known.
    """

    train: Sequence[RecordedDrive]
    val: Sequence[RecordedDrive]
    test: Sequence[RecordedDrive] = ()
    split: str = _NO_SPLIT
    streamed: TrainingFrames | None = _NO_FRAMES

    @classmethod
    def of(cls, split: FrameSplit, drives: Sequence[RecordedDrive]) -> "LabelledParts":
        """Return the parts of some drives, of which train and val must have frames.

        Raises:
            UsageError: A part has none.
            DriveError: A drive lacks a frame of the split.
        """
        train, val = split.require_part(drives, "train"), split.require_part(drives, "val")
        return cls(train, val, split.select(drives, "test"), split.fingerprint)

    def provenance(self, earlier: TrainingFrames | None = _NO_FRAMES) -> dict[str, str]:
        """Return what a model file states of the frames that it learned from.

        Args:
            earlier: Frames that its initial weights learned from; None where they are not known.
        """
        frames = UNKNOWN
        if earlier is not None and self.streamed is not None:
            frames = TrainingFrames.of(self.train).joined(earlier).joined(self.streamed).text
        return {"split": self.split, "part": "train", ENTRY: frames}


def open_parts(sources: TrainingDrives, config: DriveDataConfig, seed: int) -> LabelledParts:
    """Open the drives of a training: of a split file, of the drives named for each part, or of a drawn split.

    Args:
        sources: Drives, or a split.
        config: Shares of a drawn split.
        seed: Seed of the draw.

    Raises:
        UsageError: The split is of other drives, or leaves a part without frames.
        DriveError: A folder holds no drive, or lacks a frame of the split.
    """
    if sources.shards:
        return LabelledParts((), open_drives(sources.validation))
    if sources.split is not None:
        split = read_split(sources.split)
        return LabelledParts.of(split, split.open(sources.training))
    drives = open_drives(sources.training)
    if sources.validation:
        return LabelledParts(drives, open_drives(sources.validation))
    drawn = draw_split(drives, config.shares, by=config.split_by, seed=seed)
    return LabelledParts.of(drawn, drives)


def first_frames(drives: Sequence[RecordedDrive], fraction: float) -> list[RecordedDrive]:
    """Return the first frames of each drive, a fraction of them."""
    return [drive.select(range(math.ceil(fraction * len(drive)))) for drive in drives]
