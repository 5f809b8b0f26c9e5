"""Settings of training data: which frames train a network, and how samples are loaded and augmented."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import ClassVar, Self

from data.splits.parts import SplitBy
from perception.errors import UsageError
from perception.types import OnBadFrame


@dataclass(frozen=True)
class TrainingDrives:
    """Labelled drives that a network is trained on.

    Attributes:
        training: Drives, or folders of drives or sequences, all of which are taken; with a split, those of its drives.
        validation: Drives for validation; none keeps a share of the training frames back.
        split: Split file of `trifuse split`, whose parts train, validate and test; else a split is drawn.
        shards: Folders or URLs of shards that train in place of drives; then drives validate.
    """

    training: tuple[Path, ...] = ()
    validation: tuple[Path, ...] = ()
    split: Path | None = None
    shards: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Validate that there are drives or shards, and one choice of those for validation."""
        if self.shards:
            self._require_drives_for_validation_alone()
            return
        if not self.training and self.split is None:
            raise UsageError("drives", expected="at least one", found="none")
        if self.validation and self.split is not None:
            raise UsageError(
                "--split",
                expected="no validation drives beside a split, whose part val validates",
                found=", ".join(map(str, self.validation)),
                advice="leave --validation out",
            )

    @property
    def names(self) -> str:
        """Names of the training drives, as model files state them."""
        return ", ".join(map(str, self.shards or self.training or [self.split]))

    def _require_drives_for_validation_alone(self) -> None:
        if self.training or self.split is not None or not self.validation:
            raise UsageError(
                "--shards",
                expected="drives by --validation alone, which choose the best epoch",
                found=", ".join(map(str, [*self.training, *filter(None, [self.split])])) or "none",
                advice="pass --validation DRIVES, and neither drives nor --split for training",
            )


@dataclass(frozen=True)
class DriveDataConfig:
    """Frames of labelled drives, split into training, validation and test.

    Attributes:
        shares: Percentage of the frames or drives that train, validate and, where there are three, test, where
            neither a split nor validation drives are given.
        split_by: Unit that is drawn: single frames, or whole drives.
        on_bad_frame: Stop at a damaged frame, or skip it with a warning.
        cache: Cache folder of what is computed from the frames; else the user's cache folder.
        cache_gb: Size of the cache in GB, beyond which the least recently used entries are deleted.
        cache_workers: Processes that fill the cache; else one a core where many frames are missing.
    """

    shares: tuple[float, ...] = (80, 20)
    split_by: SplitBy = "frames"
    on_bad_frame: OnBadFrame = "stop"
    cache: Path | None = None
    cache_gb: float = 20.0
    cache_workers: int | None = None


@dataclass(frozen=True)
class SampleDataConfig(DriveDataConfig):
    """Samples in batches.

    Attributes:
        batch_size: Samples per batch.
        workers: Processes that load samples; 0 loads them in the training process. Else 0 where a CPU trains, and one
            a core, up to 8, where a GPU does.
        augment: Augment the training samples.
        training_fraction: Fraction of the training frames that is used, the first ones of each drive.
    """

    MIN_BATCH_SIZE: ClassVar[int] = 1

    batch_size: int = 16
    workers: int | None = None
    augment: bool = True
    training_fraction: float = 1.0

    def __post_init__(self) -> None:
        """Validate the batch size, the number of workers and the fraction."""
        if self.batch_size < self.MIN_BATCH_SIZE or (self.workers or 0) < 0:
            raise UsageError(
                "loading",
                expected=f"a batch size from {self.MIN_BATCH_SIZE} and workers from 0",
                found=f"{self.batch_size} and {self.workers}",
            )
        if not 0 < self.training_fraction <= 1:
            found = f"{self.training_fraction:g}"
            raise UsageError("training fraction", expected="above 0, at most 1", found=found)


@dataclass(frozen=True)
class AugmentationConfig:
    """Magnitude of each augmentation; 0 switches it off. Subclasses name the operations.

    Attributes:
        MAX: Largest magnitude of an operation; 10 where it is not named.
    """

    MAX: ClassVar[Mapping[str, float]] = {}

    def __post_init__(self) -> None:
        """Validate that each magnitude is in its range."""
        for name, magnitude in asdict(self).items():
            maximum = self.MAX.get(name, 10.0)
            if not 0 <= magnitude <= maximum:
                raise UsageError(
                    f"augmentation {name}",
                    expected=f"a magnitude from 0 to {maximum:g}",
                    found=f"{magnitude:g}",
                )

    @classmethod
    def none(cls) -> Self:
        """Return the configuration that changes nothing."""
        return cls(*[0.0] * len(fields(cls)))

    def only(self, operation: str) -> Self:
        """Return the configuration with one operation alone, at its magnitude."""
        return replace(self.none(), **{operation: getattr(self, operation)})
