"""How a picture is changed at every look at it, so that a small set resembles what roads hold.

Each view keeps its meaning: what is zoomed is nearer in a depth map and as bright in a reflectance map, and
colours change in images alone.
"""

from dataclasses import dataclass, field
from typing import Self

import numpy as np

from data.pictures.camera_changes import CameraStrengths, change_image
from data.pictures.making import ImageConfig
from data.pictures.map_changes import MapStrengths, change_depth_map, change_reflectance_map
from data.pictures.placing import PlacingStrengths, draw_placement, place, transform_targets
from data.pictures.wanted import DetectionTargets
from perception.types import UInt8


@dataclass(frozen=True)
class ImageAugmentationConfig:
    """The strengths of all operations.

    Attributes:
        placing: of all views.
        maps: of depth and reflectance maps.
        camera: of images.
    """

    placing: PlacingStrengths = field(default_factory=PlacingStrengths)
    maps: MapStrengths = field(default_factory=MapStrengths)
    camera: CameraStrengths = field(default_factory=CameraStrengths)

    @classmethod
    def none(cls) -> Self:
        """Change nothing."""
        return cls(PlacingStrengths.none(), MapStrengths.none(), CameraStrengths.none())


def changed(
    image: UInt8,
    labels: DetectionTargets,
    config: ImageConfig,
    strengths: ImageAugmentationConfig,
    rng: np.random.Generator,
) -> tuple[UInt8, DetectionTargets]:
    """Return an (h, w, C) picture and its labels as another look would show them."""
    modality, is_filled = config.modality, config.filling != "sparse"
    size_px = image.shape[1], image.shape[0]
    placement = draw_placement(strengths.placing, size_px, rng)
    placed = place(image, placement, modality, rng)
    if modality == "rgb":
        placed = change_image(placed, strengths.camera, rng)
    elif modality == "dm":
        placed = change_depth_map(placed, placement.zoom, strengths.maps, rng, is_filled=is_filled)
    else:
        placed = change_reflectance_map(placed, strengths.maps, rng, is_filled=is_filled)
    return placed, transform_targets(labels, placement, size_px)
