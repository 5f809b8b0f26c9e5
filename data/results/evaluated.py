"""What the JSON report of an evaluation states beside the metrics: data, protocol, split and networks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from data.derived.obstacle_sequences import SequenceSet
from perception.types import Drive

_NO_SPLIT = "none: no frame was trained on, and none left out between the first and the last"


@dataclass(frozen=True)
class EvaluatedDrive:
    """Frames that the metrics of one drive rest on.

    Attributes:
        root: Folder of the drive.
        drive: Name of the drive or sequence.
        sensor: Name of the LiDAR model.
        frames: Number of frames of the drive.
        first_frames: Number of frames asked for, from the start.
        frames_evaluated: Number of these frames that could be read.
    """

    root: Path
    drive: str
    sensor: str
    frames: int
    first_frames: int
    frames_evaluated: int

    @classmethod
    def of(cls, drive: Drive, frames: int | None, evaluated: int) -> "EvaluatedDrive":
        """Describe a drive of which the first frames were evaluated, all where `frames` is None."""
        asked = len(drive) if frames is None else min(frames, len(drive))
        root = drive.root.resolve()
        return cls(root, drive.name, drive.sensor.name, len(drive), asked, evaluated)

    def __str__(self) -> str:
        """Return the drive, its frames and its LiDAR in one line."""
        return f"{self.drive}: {self.frames_evaluated} of {self.frames} frames, {self.sensor}"


@dataclass(frozen=True)
class EvaluatedSet:
    """Sequences of a set that the metrics rest on.

    Attributes:
        root: Folder of the sequences.
        set: Name of the set.
        drives: Frames of each evaluated sequence, by its name in the set.
        absent: Names of the sequences that the folder does not hold.
    """

    root: Path
    set: SequenceSet
    drives: Mapping[str, EvaluatedDrive]
    absent: Sequence[str]

    def __str__(self) -> str:
        """Return the numbers of sequences and frames, and the absent sequences, in one line."""
        total = len(self.drives) + len(self.absent)
        frames = sum(drive.frames_evaluated for drive in self.drives.values())
        absent = f", absent: {', '.join(self.absent)}" if self.absent else ""
        return f"{self.set}: {len(self.drives)} of {total} sequences{absent}; {frames} frames"


@dataclass(frozen=True)
class EvaluationDocument:
    """Everything that `--json` states beside the metrics, so that they can be reproduced.

    Attributes:
        measure: Name of the command, such as ground.
        data: Frames or files that were evaluated.
        protocol: Rules of the measure in words and values.
        split: Data that were trained on or left out, in words.
        networks: Metadata of each network.
    """

    measure: str
    data: object
    protocol: Mapping[str, Any]
    split: str = _NO_SPLIT
    networks: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    @classmethod
    def of_networks(
        cls,
        measure: str,
        data: object,
        protocol: Mapping[str, Any],
        networks: Mapping[str, Mapping[str, str]],
    ) -> "EvaluationDocument":
        """Return the document of a measure of networks.

        Args:
            measure: Name of the command.
            data: Frames that were evaluated.
            protocol: Rules of the measure in words and values.
            networks: Metadata of each network; the hashes of its training frames are too long for a report.
        """
        from data.splits.training_frames import ENTRY

        split = "; ".join(
            f"{name} was trained on: {one.get('training_data', 'not known')}"
            for name, one in networks.items()
        )
        short = {
            name: {key: value for key, value in one.items() if key != ENTRY}
            for name, one in networks.items()
        }
        return cls(measure, data, protocol, split or _NO_SPLIT, short)
