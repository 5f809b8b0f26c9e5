"""How a network is adapted to drives; imports no torch."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from perception.errors import UsageError

LearnedLabels = Literal["labels", "proposals"]


@dataclass(frozen=True)
class AdaptationConfig:
    """Adaptation.

    Attributes:
        weights: Model file to start from; by default that of this package.
        kept: Share of the frames of each drive, its last ones, that are kept apart, 0 to 1.
        gap_s: Time before these in seconds that is left out.
        scans: Number of synthetic scans of each of three sensors that are learned beside the drives.
        samples: Number of samples to learn.
        lr: Largest learning rate.
        max_lost: Points of mean average precision that the synthetic scans, or a drive of --guard, may lose.
        seed: Seed of order and augmentation.
    """

    weights: Path | None = None
    kept: float = 0.25
    gap_s: float = 2.0
    scans: int = 60
    samples: int = 1000
    lr: float = 0.0005
    max_lost: float = 1.0
    seed: int = 0

    def __post_init__(self) -> None:
        """Validate the share that is kept apart and the numbers of scans and samples."""
        if not 0 < self.kept < 1:
            raise UsageError("--kept", expected="above 0, below 1", found=f"{self.kept:g}")
        if min(self.scans, self.samples) < 1:
            found = f"{self.scans} and {self.samples}"
            raise UsageError("--scans and --samples", expected="at least 1 each", found=found)
