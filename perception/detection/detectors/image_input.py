"""The inputs of a network: one image in the layout, type and number that the file states, and what stands beside it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np

from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.output_forms import InputFormat
from perception.detection.onnx_model import Array, ModelInput, OnnxModel
from perception.errors import ModelError
from perception.types import Float32, UInt8

SIZES = "orig_target_sizes"  # of detectors that scale their boxes to the image: width, height
MASK = "pixel_mask"  # 1 where the image is: everywhere
_BESIDE = (SIZES, MASK)
_PIXEL_TYPES = (np.uint8, np.float16, np.float32)
_MAX_NUMBERS = 1 << 26  # of one run's images: more are a damaged shape


@dataclass(frozen=True)
class ImageInput:
    """The input that takes the image.

    Attributes:
        name: Name of the input.
        entry: Type and shape of the input.
        is_channels_last: Whether rows and columns come before the channels.
        beside: Other inputs by name: size of the image, mask.
    """

    name: str
    entry: ModelInput
    is_channels_last: bool
    beside: Mapping[str, ModelInput]

    @classmethod
    def of(cls, model: OnnxModel, channels: int) -> Self:
        """Return the input of a network that takes images of some channels.

        Raises:
            ModelError: the inputs are others than an image, its size and a mask.
        """
        beside = {name: entry for name, entry in model.inputs.items() if name in _BESIDE}
        images = [(name, entry) for name, entry in model.inputs.items() if name not in _BESIDE]
        name, entry = images[0] if len(images) == 1 else ("", ModelInput(None, ()))
        shape = entry.shape
        is_last = shape[-1:] == (channels,) and shape[-3:-2] != (channels,)
        has_channels = is_last or shape[-3:-2] in ((None,), (channels,))
        is_image = len(shape) in (3, 4) and has_channels and entry.type in _PIXEL_TYPES
        fits = math.prod(length or 1 for length in shape) <= _MAX_NUMBERS
        if not (is_image and fits and all(one.type for one in beside.values())):
            raise ModelError(
                model.name,
                expected=f"one image (batch, {channels}, height, width) or (batch, height, width, {channels}) of uint8, "
                f"float16 or float32 as input, and at most {' and '.join(_BESIDE)} beside it",
                found=", ".join(f"{name} {entry}" for name, entry in model.inputs.items())
                or "none",
                advice="export the network with the image as its only input",
            )
        return cls(name, entry, is_last, beside)

    @property
    def fixed_size(self) -> InputSize | None:
        """Size of the images, None for any."""
        height, width = (self.entry.shape[axis] for axis in self.size_axes)
        return InputSize(height, width) if height and width else None

    @property
    def size_axes(self) -> tuple[int, int]:
        """Axes of height and width."""
        first = len(self.entry.shape) - (3 if self.is_channels_last else 2)
        return first, first + 1

    def arrays(self, image: UInt8, how: InputFormat) -> dict[str, Array]:
        """Return the inputs of the network for an (h, w, C) image, which fills the whole batch."""
        planes = _normalized(image, how, self.entry.type)
        if self.is_channels_last:
            planes = np.ascontiguousarray(np.moveaxis(planes, 0, -1))
        if len(self.entry.shape) > planes.ndim:
            planes = (
                planes[None] if self._batch == 1 else np.repeat(planes[None], self._batch, axis=0)
            )
        inputs = {self.name: planes}
        for name, entry in self.beside.items():
            if name == SIZES:
                # Boxes in pixels of the input, from where they are scaled as those of every network.
                inputs[name] = np.tile(np.array(image.shape[1::-1], entry.type), (self._batch, 1))
            else:
                axes = zip(entry.shape, (self._batch, *image.shape[:2]), strict=False)
                inputs[name] = np.ones([fixed or usual for fixed, usual in axes], entry.type)
        return inputs

    @property
    def _batch(self) -> int:
        """Number of images of a run: what the file states, else one."""
        return (len(self.entry.shape) == 4 and self.entry.shape[0]) or 1


def _normalized(image: UInt8, how: InputFormat, kind: type[np.generic] | None) -> Array:
    """Return the (C, h, w) planes of an image as (scale * pixel - mean) / std, of bytes as they are."""
    count = image.shape[2]
    planes: UInt8 = np.empty((count, *image.shape[:2]), np.uint8)
    cv2.split(image, list(planes[::-1] if how.color_order == "BGR" else planes))
    if kind is np.uint8:
        return planes
    stds, means = np.resize(how.std, count), np.resize(how.mean, count)
    normalized: Float32 = np.empty((count, *image.shape[:2]), np.float32)
    for k, plane in enumerate(planes):
        np.multiply(plane, np.float32(how.scale / stds[k]), out=normalized[k])
        normalized[k] -= np.float32(means[k] / stds[k])
    return normalized.astype(kind, copy=False)
