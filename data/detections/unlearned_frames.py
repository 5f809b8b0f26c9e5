"""Frames that networks learned from, counted in others or left out of them."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from data.recorded_drive import RecordedDrive
from data.splits.training_frames import TrainingFrames, scan_hashes
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.errors import UsageError
from perception.types import Modality

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class LearnedCounts:
    """How many of some frames networks learned from.

    Attributes:
        frames: Number of frames.
        learned: Number of these that each network learned from; None where its file does not state them.
    """

    frames: int
    learned: Mapping[str, int | None]

    @property
    def networks(self) -> list[str]:
        """Networks that learned from one of the frames or more."""
        return [name for name, count in self.learned.items() if count]

    def warn(self, drive: str) -> None:
        """Warn where networks learned from frames of a drive on which they are measured."""
        if self.networks:
            log.warning(
                "%s: %s learned from some of these frames, where scores are too high: evaluate others, by --split and --part",
                drive,
                ", ".join(self.networks),
            )

    def __str__(self) -> str:
        """Return the counts in words: frames seen in training: 0 of 1496 (dm, rm), not known (rgb)."""
        names: dict[str, list[str]] = {}
        for name, count in self.learned.items():
            words = "not known" if count is None else f"{count} of {self.frames}"
            names.setdefault(words, []).append(name)
        counts = (f"{words} ({', '.join(of_words)})" for words, of_words in names.items())
        return f"frames seen in training: {', '.join(counts)}"


def count_learned_frames(
    networks: Mapping[str, Mapping[str, str]], drive: RecordedDrive
) -> LearnedCounts:
    """Count the frames of a drive that networks learned from.

    Args:
        networks: Metadata of each network's file.
        drive: Frames that are evaluated.
    """
    known = {name: TrainingFrames.from_metadata(one, name) for name, one in networks.items()}
    hashes = scan_hashes(drive) if any(known.values()) else []
    return LearnedCounts(
        len(drive),
        {
            name: None if frames is None else int(frames.among(hashes).sum())
            for name, frames in known.items()
        },
    )


def without_learned_frames(
    drives: Sequence[RecordedDrive], detectors: Mapping[Modality, ModalityDetector]
) -> list[RecordedDrive]:
    """Return drives without the frames that detectors learned from, whose scores are too high there.

    Args:
        drives: Labelled drives.
        detectors: Detectors that are fused.

    Raises:
        UsageError: no frame is left.
    """
    stated = {
        f"{name} ({one.model.name})": TrainingFrames.from_metadata(one.metadata, one.model.name)
        for name, one in detectors.items()
    }
    known = {name: frames for name, frames in stated.items() if frames is not None}
    if len(known) < len(stated):
        names = ", ".join(name for name in stated if name not in known)
        log.warning("not known which frames %s learned from; all are taken", names)
    left, learners, total = [], set[str](), sum(map(len, drives))
    for drive in drives:
        hashes = scan_hashes(drive) if known else [b""] * len(drive)
        is_left = np.ones(len(drive), bool)
        for name, frames in known.items():
            is_learned = frames.among(hashes)
            is_left &= ~is_learned
            learners |= {name} if is_learned.any() else set()
        if is_left.any():
            left.append(drive.select(np.flatnonzero(is_left).tolist()))
    names = ", ".join(name for name in known if name in learners)
    if not left:
        raise UsageError(
            "drives",
            expected="frames that no detector learned from",
            found=f"{total} of {total} that {names} learned from",
            advice="name other drives, or --split with the split whose part train the detectors learned from",
        )
    if learners:
        learned = total - sum(map(len, left))
        log.warning("left out %d of %d frames, which %s learned from", learned, total, names)
    return left
