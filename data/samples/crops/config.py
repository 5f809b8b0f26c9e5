"""Settings of DepthCN's training data (6.1.4): crops of proposals, jittered labels, and their augmentation."""

from dataclasses import dataclass, field, fields
from typing import ClassVar

from data.samples.config import AugmentationConfig, SampleDataConfig
from perception.errors import UsageError


@dataclass(frozen=True)
class CropAugmentationConfig(AugmentationConfig):
    """Magnitudes of the crops' augmentation; the thesis names the operations, not how strong they are.

    Attributes:
        scale: Largest factor of the content's size, less 1: closer and farther objects.
        depth: Largest factor of the depths, less 1: closer and farther objects.
        flip: Probability of a horizontal flip: driving in the opposite direction.
        jitter: Largest shift as a fraction of the window: errors of calibration and labels.
        aspect: Largest factor of the ratio of width to height, less 1: errors of calibration and labels.
        occlusion: Largest fraction of the width of every second object that is hidden by a nearer one.
        rotation_rad: Largest rotation in rad, either way: other positions on the road.
        row_shift_px: Largest shift of each row of the crop in pixels, either way: noise of the dense maps.
        reflectance: Largest fraction by which returns are weaker: other LiDARs; not among the thesis' eight.
    """

    MAX: ClassVar = {
        "flip": 1.0,
        "jitter": 0.5,
        "occlusion": 0.9,
        "rotation_rad": 0.5,
        "reflectance": 1.0,
    }

    scale: float = 0.12
    depth: float = 0.25
    flip: float = 0.5
    jitter: float = 0.06
    aspect: float = 0.12
    occlusion: float = 0.4
    rotation_rad: float = 0.035
    row_shift_px: float = 1.0
    reflectance: float = 0.9


OPERATIONS = tuple(one.name for one in fields(CropAugmentationConfig))


@dataclass(frozen=True)
class CropSamplingConfig:
    """Labelled vehicles that are added beside the proposals, with jittered boxes.

    Attributes:
        jittered_copies: Jittered copies of each labelled vehicle.
        max_jitter: Largest shift of a box's edges, as a fraction of its size, 0 to 0.25.
        min_points: Minimum number of LiDAR points on a vehicle that is added.
    """

    jittered_copies: int = 2
    max_jitter: float = 0.1
    min_points: int = 20

    def __post_init__(self) -> None:
        """Validate that boxes stay on their vehicles."""
        if self.jittered_copies < 0 or not 0 <= self.max_jitter <= 0.25 or self.min_points < 1:
            raise UsageError(
                "crop sampling",
                expected="jittered_copies >= 0, max_jitter from 0 to 0.25, min_points >= 1",
                found=f"{self.jittered_copies}, {self.max_jitter:g}, {self.min_points}",
            )


@dataclass(frozen=True)
class CropDataConfig(SampleDataConfig):
    """Training data of DepthCN's network.

    Attributes:
        batch_size: Crops per batch, half of them vehicles (7.2.1).
        samples_per_epoch: Crops per epoch; else as many as there are.
        sampling: Labelled vehicles that are added beside the proposals.
        augmentation: Magnitudes of the augmentation.
    """

    MIN_BATCH_SIZE: ClassVar[int] = 2

    batch_size: int = 128
    samples_per_epoch: int | None = None
    sampling: CropSamplingConfig = field(default_factory=CropSamplingConfig)
    augmentation: CropAugmentationConfig = field(default_factory=CropAugmentationConfig)
