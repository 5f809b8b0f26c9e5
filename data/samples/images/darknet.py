"""Darknet's augmentation, by which the thesis' detectors are trained (7.2.2), as transforms of torchvision (v2).

    crop ── flip ── brightness, saturation, hue

Darknet sees maps as grey images: they get its brightness, and have no colours to change.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torchvision import tv_tensors  # type: ignore[import-untyped]
from torchvision.transforms import v2  # type: ignore[import-untyped]
from torchvision.transforms.v2 import functional  # type: ignore[import-untyped]

from data.samples.images.config import DarknetAugmentationConfig
from data.samples.images.targets import DetectionTargets
from perception.types import UInt8

_MIN_BOX_PX = 1.0  # width and height of what is left of a cropped object


class RandomEdgeCrop(v2.Transform):  # type: ignore[misc]
    """Move each edge of an image in or out, and resize what is within to the image's size; beyond the image is 0."""

    def __init__(self, jitter: float) -> None:
        """Take the largest move of an edge as a fraction of the image's width or height."""
        super().__init__()
        self._jitter = jitter

    def make_params(self, flat_inputs: list[Any]) -> dict[str, Any]:
        """Draw the crop: top, left, height and width."""
        height, width = v2.query_size(flat_inputs)
        limits_px = self._jitter * torch.tensor([height, width, height, width])
        moves_px = (limits_px * (2 * torch.rand(4) - 1)).round().int()
        top, left, bottom, right = moves_px.tolist()
        return {
            "window": (top, left, height - top - bottom, width - left - right),
            "size": [height, width],
        }

    def transform(self, inpt: Any, params: dict[str, Any]) -> Any:  # noqa: ANN401 - what torchvision takes
        """Return the crop of an image or of boxes."""
        window, size = params["window"], params["size"]
        return self._call_kernel(functional.resized_crop, inpt, *window, size=size)


def augment_as_darknet(
    image: UInt8,
    targets: DetectionTargets,
    magnitudes: DarknetAugmentationConfig,
    rng: np.random.Generator,
) -> tuple[UInt8, DetectionTargets]:
    """Return an augmented (h, w, C) image and its targets, without those that the crop leaves out."""
    sample = {
        "image": tv_tensors.Image(torch.from_numpy(image.transpose(2, 0, 1).copy())),
        "boxes_px": tv_tensors.BoundingBoxes(
            torch.from_numpy(targets.boxes_px), format="XYXY", canvas_size=image.shape[:2]
        ),
        "classes": torch.from_numpy(targets.classes),
        "is_ignored": torch.from_numpy(targets.is_ignored),
    }
    with _torch_seeded_by(rng):
        augmented = {name: part.numpy() for name, part in _transform(magnitudes)(sample).items()}
    pixels = augmented.pop("image").transpose(1, 2, 0)
    return pixels, DetectionTargets(**augmented, min_height_px=targets.min_height_px)


@cache
def _transform(magnitudes: DarknetAugmentationConfig) -> v2.Transform:
    factors = {"brightness": magnitudes.exposure, "saturation": magnitudes.saturation}
    ranges = {name: (1 / (1 + factor), 1 + factor) for name, factor in factors.items()}
    return v2.Compose(
        [
            RandomEdgeCrop(magnitudes.jitter),
            v2.RandomHorizontalFlip(magnitudes.flip),
            v2.ColorJitter(**ranges, hue=magnitudes.hue),
            v2.SanitizeBoundingBoxes(_MIN_BOX_PX, labels_getter=_parts_of_boxes),
        ]
    )


def _parts_of_boxes(sample: dict[str, Tensor]) -> tuple[Tensor, Tensor]:
    """Return what torchvision drops together with a box."""
    return sample["classes"], sample["is_ignored"]


@contextmanager
def _torch_seeded_by(rng: np.random.Generator) -> Iterator[None]:
    """Seed torch's own generator, from which torchvision draws, and restore its state afterwards."""
    generator = torch.default_generator
    state = generator.get_state()
    generator.manual_seed(int(rng.integers(2**63)))
    try:
        yield
    finally:
        generator.set_state(state)
