"""Settings of training data: which frames train a network, and how samples are loaded and augmented."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import ClassVar, Literal, Self

from perception.errors import UsageError
from perception.types import OnBadFrame

SplitBy = Literal["frames", "drives"]


@dataclass(frozen=True)
class TrainingDrives:
    """Labelled drives that a network is trained on.

    Attributes:
        training: Drives, or folders of drives or sequences, all of which are taken.
        validation: Drives for validation; none keeps a fraction of the training frames back.
    """

    training: tuple[Path, ...]
    validation: tuple[Path, ...] = ()

    @property
    def parts(self) -> list[tuple[Path, ...]]:
        """Paths of the training drives, and of the validation drives where there are some."""
        return [self.training, *([self.validation] if self.validation else [])]

    @property
    def names(self) -> str:
        """Names of the training drives, as model files state them."""
        return ", ".join(str(path) for path in self.training)


@dataclass(frozen=True)
class DriveDataConfig:
    """Frames of labelled drives, split into training and validation.

    Attributes:
        validation_fraction: Fraction of the frames or drives kept back for validation, where no
            validation drives are given.
        split_by: Unit of the split: single frames, or whole drives.
        on_bad_frame: Stop at a damaged frame, or skip it with a warning.
        cache: Cache folder of what is computed from the frames; else the user's cache folder.
        cache_gb: Size of the cache in GB, beyond which the least recently used entries are deleted.
    """

    validation_fraction: float = 0.2
    split_by: SplitBy = "frames"
    on_bad_frame: OnBadFrame = "stop"
    cache: Path | None = None
    cache_gb: float = 20.0


@dataclass(frozen=True)
class SampleDataConfig(DriveDataConfig):
    """Samples in batches.

    Attributes:
        batch_size: Samples per batch.
        workers: Processes that load samples; 0 loads them in the training process.
        augment: Augment the training samples.
    """

    MIN_BATCH_SIZE: ClassVar[int] = 1

    batch_size: int = 16
    workers: int = 0
    augment: bool = True

    def __post_init__(self) -> None:
        """Validate the batch size and the number of workers."""
        if self.batch_size < self.MIN_BATCH_SIZE or self.workers < 0:
            raise UsageError(
                "loading",
                expected=f"a batch size from {self.MIN_BATCH_SIZE} and workers from 0",
                found=f"{self.batch_size} and {self.workers}",
            )


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
