"""Input images of one frame: the camera image, or both dense maps, at the size of the network's input."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

import perception.maps
from data.array_store import Arrays
from data.frame_fingerprint import code_fingerprint
from perception.detection.detectors import image_region, modalities, network_input
from perception.detection.detectors.image_region import detection_region
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.modalities import (
    camera_image,
    fill_maps,
    map_image,
)
from perception.detection.detectors.network_input import (
    ImagePlacement,
    PixelRectangle,
    place,
    prepare_image,
)
from perception.errors import UsageError
from perception.maps.projection import project_frame
from perception.types import MODALITIES, Fit, Frame, Int, MapFilling, Modality, UInt8

_SIZE = InputSize(192, 640)


@dataclass(frozen=True)
class ImageConfig:
    """Input of an image detector.

    Attributes:
        modality: Camera image, depth map or reflectance map.
        class_names: Classes to detect, as labels spell them.
        size: Size of the input.
        filling: Method by which maps are made dense.
        jpeg_quality: Quality of a JPEG compression, 1 to 100; None for none.
        fit: Letterbox, which keeps the aspect of images, or stretch, as the thesis does.
    """

    modality: Modality
    class_names: tuple[str, ...] = ("Car",)
    size: InputSize = _SIZE
    filling: MapFilling = "default"
    jpeg_quality: int | None = None
    fit: Fit = "letterbox"

    def __post_init__(self) -> None:
        """Validate modality, class names and JPEG quality."""
        if self.modality not in MODALITIES:
            raise UsageError("modality", expected=f"one of {MODALITIES}", found=self.modality)
        lower = [name.lower() for name in self.class_names]
        if not lower or len(set(lower)) < len(lower):
            found = ", ".join(self.class_names) or "none"
            raise UsageError("class names", expected="at least one, each once", found=found)
        if self.jpeg_quality is not None and not 1 <= self.jpeg_quality <= 100:
            found = str(self.jpeg_quality)
            raise UsageError("JPEG quality", expected="from 1 to 100", found=found)

    def placement(self, region: PixelRectangle) -> ImagePlacement:
        """Return where a region of an image lies in the input."""
        return place(region, self.size, self.fit)


def image_settings(config: ImageConfig) -> dict[str, object]:
    """Return all that determines the images of a frame; the classes do not matter."""
    return {
        "filling": None if config.modality == "rgb" else config.filling,
        "size": config.size,
        "jpeg_quality": config.jpeg_quality,
        "fit": config.fit,
        "code": code_fingerprint(
            perception.maps, modalities, image_region, network_input, Path(__file__)
        ),
    }


def make_images(frame: Frame, config: ImageConfig) -> Arrays:
    """Return the input images of a frame, each (h, w, C), by modality, `size_px` and `region`.

    `size_px` is the width and height of the image, `region` what the input shows of it: left, top, right, bottom.

    Both maps are made at once, since all but the last step is the same.

    Raises:
        PerceptionError: the frame lacks the image, or the camera's calibration.
    """
    images: dict[Modality, UInt8]
    if config.modality == "rgb":
        images = {"rgb": camera_image(frame)}
    else:
        dense = fill_maps(project_frame(frame), config.filling)
        images = {"dm": map_image(dense, "dm"), "rm": map_image(dense, "rm")}
    image = next(iter(images.values()))
    region = detection_region(frame.calibration, (image.shape[1], image.shape[0]))
    placement = config.placement(region)
    arrays: dict[str, UInt8 | Int] = {
        name: prepare_image(image, name, placement, config.jpeg_quality)
        for name, image in images.items()
    }
    return {**arrays, "size_px": np.array(image.shape[1::-1]), "region": np.array(region)}
