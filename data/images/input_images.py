"""One frame as pictures of a network's input size, and the key under which a store keeps them.

To make a picture takes long: it is kept at the size of the input, under a key of all that makes it: the frame's
files, the settings, and the code itself. Depth and reflectance map are made, and kept, together.
"""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

import perception.maps
from data.array_store import Arrays, entry_key
from data.frame_fingerprint import code_fingerprint, frame_fingerprint
from perception.detection.detectors import input_size, modalities
from perception.detection.detectors.input_size import InputSize, stretch
from perception.detection.detectors.modalities import (
    MapFilling,
    camera_image,
    fill_maps,
    map_image,
)
from perception.errors import UsageError
from perception.maps.projection import project_frame
from perception.types import MODALITIES, Drive, Frame, Int, Modality, UInt8

_SIZE = InputSize(192, 640)


@dataclass(frozen=True)
class ImageConfig:
    """What a frame is turned into.

    Attributes:
        modality: which view of the road.
        class_names: what is looked for, by its type in the labels.
        size: of the network's input, to which pictures are stretched.
        filling: how maps are made.
        jpeg_quality: pictures are pressed through JPEG of this quality, 1 to 100, as the thesis' were of 75
            (7.2.2); None leaves them as they are.
    """

    modality: Modality
    class_names: tuple[str, ...] = ("Car",)
    size: InputSize = _SIZE
    filling: MapFilling = "default"
    jpeg_quality: int | None = None

    def __post_init__(self) -> None:
        """Refuse what no picture could be made by."""
        if self.modality not in MODALITIES:
            raise UsageError("modality", expected=f"one of {MODALITIES}", found=self.modality)
        lower = [name.lower() for name in self.class_names]
        if not lower or len(set(lower)) < len(lower):
            found = ", ".join(self.class_names) or "none"
            raise UsageError("class names", expected="at least one, each once", found=found)
        if self.jpeg_quality is not None and not 1 <= self.jpeg_quality <= 100:
            found = str(self.jpeg_quality)
            raise UsageError("JPEG quality", expected="from 1 to 100", found=found)


def image_key(drive: Drive, index: int, config: ImageConfig) -> str:
    """Return the key of a frame's pictures; the classes that are looked for do not matter."""
    return entry_key(
        what="camera picture" if config.modality == "rgb" else ["map pictures", config.filling],
        size=config.size,
        jpeg_quality=config.jpeg_quality,
        code=code_fingerprint(perception.maps, modalities, input_size, Path(__file__)),
        **frame_fingerprint(drive, index),
    )


def make_images(frame: Frame, config: ImageConfig) -> Arrays:
    """Return the pictures of a frame, each (h, w, C) by its modality, and (width, height) before: size_px.

    Both maps come at once, as all but the last step is the same.

    Raises:
        PerceptionError: the frame lacks the image, or the camera's calibration, that they are made of.
    """
    made: dict[Modality, UInt8]
    if config.modality == "rgb":
        made = {"rgb": camera_image(frame)}
    else:
        dense = fill_maps(project_frame(frame), config.filling)
        made = {"dm": map_image(dense, "dm"), "rm": map_image(dense, "rm")}
    height, width = next(iter(made.values())).shape[:2]
    if (quality := config.jpeg_quality) is not None:
        made = {name: jpeg_compressed(image, quality) for name, image in made.items()}
    arrays: dict[str, UInt8 | Int] = {
        name: stretch(one, config.size, name) for name, one in made.items()
    }
    return {**arrays, "size_px": np.array([width, height])}


def jpeg_compressed(image: UInt8, quality: int) -> UInt8:
    """Return what JPEG of a quality, 1 to 100, leaves of an (H, W, C) picture."""
    # OpenCV takes BGR; the order matters, as JPEG keeps brightness better than colour.
    _, data = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    decoded = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    return np.asarray(decoded, np.uint8).reshape(image.shape)[..., ::-1]
