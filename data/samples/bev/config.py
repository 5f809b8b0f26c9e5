"""Settings of the training data of the bird's-eye view: split, batches, and augmentation."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from data.samples.config import AugmentationConfig, SampleDataConfig


@dataclass(frozen=True)
class BevAugmentationConfig(AugmentationConfig):
    """Magnitudes of the augmentation of a scan.

    Attributes:
        turn_rad: Largest turn about the vertical in rad.
        mirror: Probability that left and right change places.
        scale: Largest factor of all lengths, less 1.
        stretch: Largest factor of the length of a car, less 1, as cars of some countries are longer; of the width half.
        paste: Largest number of objects of another scan of the same drive that are put where nothing stands.
        thinning: Probability that every second beam is left out, of a sensor of 32 and more.
        dropout: Largest share of points that drop out, as in rain.
        reflectance: Probability that no reflectance is known.
        gain: Standard deviation of the logarithm of a factor of reflectance.
        ground_m: Standard deviation in metres of an error of the ground's height.
        tilt_rad: That of its slope along each axis, in rad.
        crop: Fraction of each side that a training map leaves out; what is left lies around an object. Steps on crops take
            less time, so that more are made.
    """

    MAX: ClassVar = {
        "mirror": 1.0,
        "scale": 0.5,
        "stretch": 0.5,
        "thinning": 1.0,
        "dropout": 0.9,
        "reflectance": 1.0,
        "crop": 0.9,
    }

    turn_rad: float = np.pi
    mirror: float = 0.5
    scale: float = 0.05
    stretch: float = 0.15
    paste: int = 0
    thinning: float = 0.3
    dropout: float = 0.3
    reflectance: float = 0.5
    gain: float = 1.5
    ground_m: float = 0.08
    tilt_rad: float = 0.002
    crop: float = 0.0


@dataclass(frozen=True)
class BevDataConfig(SampleDataConfig):
    """Training data of the bird's-eye view.

    Attributes:
        batch_size: Scans per batch.
        augmentation: Magnitudes of the augmentation.
    """

    batch_size: int = 8
    augmentation: BevAugmentationConfig = field(default_factory=BevAugmentationConfig)
