"""Settings of the image detectors' training data: split, batches, and augmentation."""

from dataclasses import dataclass, field
from typing import ClassVar

from data.samples.config import AugmentationConfig, SampleDataConfig
from perception.types import Method


@dataclass(frozen=True)
class GeometricConfig(AugmentationConfig):
    """Magnitudes of the geometric augmentation, which images and maps share.

    Attributes:
        flip: Probability of a horizontal flip.
        zoom: Largest factor, less 1, by which objects are larger and nearer, or smaller and farther.
        focal: Largest factor, less 1, by which objects are larger or smaller at the same distance.
        aspect: Largest factor, less 1, of width over height.
        shift: Largest shift as a fraction of the image, beyond the freedom that the zoom gives.
        occlusion: Probability that nearer objects hide parts of the image.
        crop: Fraction of the width that a training image leaves out; most are cut around an object. Steps on
            crops take less time, so that more are made.
    """

    MAX: ClassVar = {
        "flip": 1.0,
        "zoom": 3.0,
        "focal": 1.0,
        "aspect": 1.0,
        "shift": 0.5,
        "occlusion": 1.0,
        "crop": 0.9,
    }

    flip: float = 0.5
    zoom: float = 0.4
    focal: float = 0.1
    aspect: float = 0.08
    shift: float = 0.04
    occlusion: float = 0.4
    crop: float = 0.0


@dataclass(frozen=True)
class PhotometricConfig(AugmentationConfig):
    """Magnitudes of the photometric augmentation of camera images.

    Attributes:
        brightness: Largest factor of the values, less 1.
        contrast: Largest factor of the values' distances from the mean, less 1.
        gamma: Largest factor of the values' power, less 1.
        white_balance: Largest factor of each colour by itself, less 1.
        saturation: Largest fraction by which colours are weaker or stronger.
        hue_rad: Largest rotation of the hue in rad.
        light: Largest factor, less 1, by which brightness varies smoothly over the image.
        shadow: Probability of a shadow with an edge, down to a quarter of the light.
        filtering: Standard deviation of the weights of a random 3x3 filter beside the pixel's own: Xu et al.,
            "Robust and generalizable visual representation learning via random convolutions", ICLR 2021.
        blur_px: Largest standard deviation of a blur in pixels.
        noise: Largest standard deviation of the noise of each value of 0..255.
        jpeg: Probability of JPEG artefacts.
    """

    MAX: ClassVar = {
        "saturation": 1.0,
        "shadow": 1.0,
        "filtering": 0.5,
        "noise": 100.0,
        "jpeg": 1.0,
    }

    brightness: float = 0.5
    contrast: float = 0.5
    gamma: float = 0.4
    white_balance: float = 0.15
    saturation: float = 0.8
    hue_rad: float = 0.35
    light: float = 0.4
    shadow: float = 0.3
    filtering: float = 0.06
    blur_px: float = 1.0
    noise: float = 10.0
    jpeg: float = 0.25


@dataclass(frozen=True)
class MapAugmentationConfig(AugmentationConfig):
    """Largest magnitudes of the augmentation of depth and reflectance maps; small ones are drawn more often.

    Attributes:
        dropout: Largest fraction of the map that is lost, in cells of one size.
        fading: Largest fraction lost of the farthest (depth map) or weakest (reflectance map) returns.
        beam_dropout: Largest fraction of the rows that is lost; a filled map shows the row above instead.
        range_noise_m: Largest standard deviation of depths in metres.
        gain: Largest factor of reflectances, less 1: LiDARs scale them differently.
        gamma: Largest factor of the reflectances' power, less 1.
        speckle: Largest standard deviation of the factor of each reflectance.
    """

    MAX: ClassVar = {"dropout": 0.9, "fading": 1.0, "beam_dropout": 0.9, "speckle": 1.0}

    dropout: float = 0.15
    fading: float = 0.5
    beam_dropout: float = 0.4
    range_noise_m: float = 0.25
    gain: float = 0.6
    gamma: float = 0.4
    speckle: float = 0.25


@dataclass(frozen=True)
class DarknetAugmentationConfig(AugmentationConfig):
    """Magnitudes of Darknet's augmentation, of images and maps alike; those of yolo-voc.cfg.

    Attributes:
        flip: Probability of a horizontal flip.
        jitter: Largest move of each edge of the image, in or out, as a fraction of the image.
        hue: Largest rotation of the hue as a fraction of the circle.
        saturation: Largest factor of the saturation, less 1.
        exposure: Largest factor of the brightness, less 1.
    """

    MAX: ClassVar = {"flip": 1.0, "jitter": 0.45, "hue": 0.5}

    flip: float = 0.5
    jitter: float = 0.3
    hue: float = 0.1
    saturation: float = 0.5
    exposure: float = 0.5


@dataclass(frozen=True)
class ImageAugmentationConfig:
    """Magnitudes of all augmentations.

    Attributes:
        method: Method: default, with the first three sections; or thesis, that of Darknet, with the last.
        geometric: Geometry of images and maps.
        maps: Corruptions of depth and reflectance maps.
        photometric: Colours, light and noise of camera images.
        darknet: Crops, flips and colours of images and maps as Darknet makes them.
    """

    method: Method = "default"
    geometric: GeometricConfig = field(default_factory=GeometricConfig)
    maps: MapAugmentationConfig = field(default_factory=MapAugmentationConfig)
    photometric: PhotometricConfig = field(default_factory=PhotometricConfig)
    darknet: DarknetAugmentationConfig = field(default_factory=DarknetAugmentationConfig)


@dataclass(frozen=True)
class ImageDataConfig(SampleDataConfig):
    """Training data of an image detector.

    Attributes:
        batch_size: Images per batch.
        augmentation: Magnitudes of the augmentation.
    """

    augmentation: ImageAugmentationConfig = field(default_factory=ImageAugmentationConfig)
