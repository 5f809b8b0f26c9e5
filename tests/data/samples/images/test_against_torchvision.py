"""Our augmentation does what torchvision's transforms do, where these do the same."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from torchvision import tv_tensors
from torchvision.transforms import v2
from torchvision.transforms.v2 import functional

from data.samples.images.config import PhotometricConfig
from data.samples.images.geometric import GeometricTransform, transform_targets, warp_image
from data.samples.images.photometric import transform_image
from data.samples.images.targets import DetectionTargets
from perception.detection.depthcn.crops import crop_windows

NONE = PhotometricConfig.none()
NEAREST = v2.InterpolationMode.NEAREST
WIDTH, HEIGHT = 160, 96
BOXES = np.array([[40, 30, 60, 50], [70, 24, 110, 72]], np.float32)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def noise(channels: int) -> np.ndarray:
    return rng().integers(0, 256, (HEIGHT, WIDTH, channels), np.uint8)


def as_tensor(image: np.ndarray) -> torch.Tensor:
    return torch.from_numpy(image.transpose(2, 0, 1).copy())


def as_image(tensor: torch.Tensor) -> np.ndarray:
    return tensor.numpy().transpose(1, 2, 0)


def moved_by_torchvision(transform, channels):
    """Return the image of noise and the boxes as torchvision moves them."""
    boxes = tv_tensors.BoundingBoxes(
        torch.from_numpy(BOXES), format="XYXY", canvas_size=(HEIGHT, WIDTH)
    )
    return as_image(transform(as_tensor(noise(channels)))), transform(boxes).numpy()


def doubled(part):
    """Return the middle of an image or of boxes, twice as large."""
    return functional.resized_crop(
        part, HEIGHT // 4, WIDTH // 4, HEIGHT // 2, WIDTH // 2, [HEIGHT, WIDTH], NEAREST
    )


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (GeometricTransform((-1.0, 1.0), (WIDTH, 0.0)), functional.horizontal_flip),
        (GeometricTransform((2.0, 2.0), (-WIDTH / 2, -HEIGHT / 2)), doubled),
    ],
    ids=["flip", "zoom"],
)
def test_images_and_boxes_are_moved_alike(ours, theirs, channels: int):
    expected, expected_boxes_px = moved_by_torchvision(theirs, channels)
    # As a map, whose pixels are not mixed.
    np.testing.assert_array_equal(warp_image(noise(channels), ours, "rm", rng()), expected)
    targets = DetectionTargets(BOXES, np.zeros(2, int), np.zeros(2, bool))
    found = transform_targets(targets, ours, (WIDTH, HEIGHT))
    np.testing.assert_allclose(found.boxes_px, expected_boxes_px)


@pytest.mark.parametrize("seed", range(4))
def test_brightness_is_that_of_torchvision(seed: int):
    magnitudes = replace(NONE, brightness=0.8)
    factor = transform_image(np.full((4, 4, 3), 100, np.uint8), magnitudes, rng(seed)).mean() / 100
    expected = as_image(functional.adjust_brightness(as_tensor(noise(3)), factor))
    found = transform_image(noise(3), magnitudes, rng(seed))
    # The factor is known to half a grey level of 100.
    np.testing.assert_allclose(found.astype(int), expected, atol=3)


@pytest.mark.parametrize("seed", range(4))
def test_gamma_is_that_of_torchvision(seed: int):
    magnitudes = replace(NONE, gamma=0.8)
    grey = transform_image(np.full((4, 4, 3), 128, np.uint8), magnitudes, rng(seed)).mean()
    gamma = math.log(grey / 255) / math.log(128 / 255)
    expected = as_image(functional.adjust_gamma(as_tensor(noise(3)), gamma))
    found = transform_image(noise(3), magnitudes, rng(seed))
    np.testing.assert_allclose(found.astype(int), expected, atol=3)


def test_a_crop_of_depthcn_is_that_of_torchvision():
    image = noise(3)
    found = crop_windows(image, np.array([[9.5, 19.5, 65.5, 52.5]]))[0]
    expected = functional.resized_crop(
        as_tensor(image), 20, 10, 33, 56, [66, 112], v2.InterpolationMode.NEAREST_EXACT
    )
    np.testing.assert_array_equal(found, expected.numpy())
