"""How a picture is changed at every look at it, so that a small set resembles what roads hold.

Each view keeps its meaning: what is zoomed is nearer in a depth map and as bright in a reflectance map, and
colours change in images alone.
"""

from dataclasses import dataclass, field
from typing import Self

import numpy as np

from data.images.geometric import (
    GeometricConfig,
    draw_geometric_transform,
    transform_targets,
    warp_image,
)
from data.images.input_images import ImageConfig
from data.images.map_transforms import (
    MapAugmentationConfig,
    transform_depth_map,
    transform_reflectance_map,
)
from data.images.photometric import PhotometricConfig, transform_image
from data.images.targets import DetectionTargets
from perception.types import UInt8


@dataclass(frozen=True)
class ImageAugmentationConfig:
    """The strengths of all operations.

    Attributes:
        geometric: of all views.
        maps: of depth and reflectance maps.
        camera: of images.
    """

    geometric: GeometricConfig = field(default_factory=GeometricConfig)
    maps: MapAugmentationConfig = field(default_factory=MapAugmentationConfig)
    camera: PhotometricConfig = field(default_factory=PhotometricConfig)

    @classmethod
    def none(cls) -> Self:
        """Change nothing."""
        return cls(GeometricConfig.none(), MapAugmentationConfig.none(), PhotometricConfig.none())


def transformed(
    image: UInt8,
    labels: DetectionTargets,
    config: ImageConfig,
    magnitudes: ImageAugmentationConfig,
    rng: np.random.Generator,
) -> tuple[UInt8, DetectionTargets]:
    """Return an (h, w, C) picture and its labels as another look would show them."""
    modality, is_filled = config.modality, config.filling != "sparse"
    size_px = image.shape[1], image.shape[0]
    geometric_transform = draw_geometric_transform(magnitudes.geometric, size_px, rng)
    warped_image = warp_image(image, geometric_transform, modality, rng)
    if modality == "rgb":
        warped_image = transform_image(warped_image, magnitudes.camera, rng)
    elif modality == "dm":
        warped_image = transform_depth_map(
            warped_image, geometric_transform.zoom, magnitudes.maps, rng, is_filled=is_filled
        )
    else:
        warped_image = transform_reflectance_map(
            warped_image, magnitudes.maps, rng, is_filled=is_filled
        )
    return warped_image, transform_targets(labels, geometric_transform, size_px)
