"""Darknet's augmentation: boxes stay with what they hold, colours within their factors, maps keep their zeros."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from data.samples.images.config import DarknetAugmentationConfig, ImageAugmentationConfig
from data.samples.images.darknet import augment_as_darknet
from data.samples.images.dataset import augment
from data.samples.images.input_images import ImageConfig
from data.samples.images.targets import DetectionTargets
from perception.errors import UsageError
from perception.types import MODALITIES, Modality
from tests.faults import fault

NONE = DarknetAugmentationConfig.none()
BOX = (60, 40, 100, 70)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def targets_of(*boxes: tuple[float, ...]) -> DetectionTargets:
    count = len(boxes)
    return DetectionTargets(
        np.array(boxes, np.float32).reshape(-1, 4), np.arange(count), np.arange(count) == 1, 4.0
    )


def even(*color: int) -> np.ndarray:
    return np.full((96, 160, len(color)), color, np.uint8)


def with_box(channels: int) -> np.ndarray:
    """Return an image that is 200 within a box, and 100 around it."""
    x1, y1, x2, y2 = BOX
    image = even(*[100] * channels)
    image[y1:y2, x1:x2] = 200
    return image


@pytest.mark.parametrize("channels", [1, 3])
def test_a_box_stays_around_what_it_holds(channels: int):
    magnitudes = replace(NONE, flip=0.5, jitter=0.3)
    widths = []
    for seed in range(40):
        image, targets = augment_as_darknet(
            with_box(channels), targets_of(BOX), magnitudes, rng(seed)
        )
        assert (image.shape, image.dtype) == ((96, 160, channels), np.uint8)
        if not len(targets):
            continue
        rows, columns = np.nonzero(image[..., 0] > 150)
        extent = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
        np.testing.assert_allclose(targets.boxes_px[0], extent, atol=1.01)
        widths.append(extent[2] - extent[0])
    assert len(widths) > 30
    # Edges move by up to 0.3: 40 pixels of 160 / (160 ± 96) as wide.
    assert 25 <= min(widths) < 34
    assert 55 < max(widths) <= 100


def test_what_the_crop_leaves_out_is_no_target():
    magnitudes = replace(NONE, jitter=0.3)
    corner, inside = (0.0, 0.0, 4.0, 3.0), BOX
    kept = [
        augment_as_darknet(with_box(1), targets_of(corner, inside), magnitudes, rng(seed))[1]
        for seed in range(20)
    ]
    assert {tuple(one.classes.tolist()) for one in kept} == {(0, 1), (1,)}
    for one in kept:
        np.testing.assert_array_equal(one.is_ignored, one.classes == 1)
        assert one.min_height_px == 4.0


def test_half_of_the_images_are_flipped():
    image = even(0)
    image[:, :80] = 200
    views = [
        augment_as_darknet(image, targets_of(), replace(NONE, flip=0.5), rng(s))[0]
        for s in range(60)
    ]
    flipped = [(view == image[:, ::-1]).all() for view in views]
    assert all(one or (view == image).all() for one, view in zip(flipped, views, strict=True))
    assert np.mean(flipped) == pytest.approx(0.5, abs=0.15)


def test_exposure_is_a_factor_of_images_and_maps():
    for image in (even(100, 100, 100), even(100)):
        views = [
            augment_as_darknet(image, targets_of(), replace(NONE, exposure=0.5), rng(seed))[0]
            for seed in range(60)
        ]
        factors = np.array([view.mean() for view in views]) / 100
        assert 0.66 <= factors.min() < 0.72
        assert 1.42 < factors.max() <= 1.5


@pytest.mark.parametrize("operation", ["hue", "saturation"])
def test_maps_have_no_colours_to_change(operation: str):
    magnitudes = replace(NONE, **{operation: 0.4})
    for seed in range(5):
        view, _ = augment_as_darknet(even(90), targets_of(), magnitudes, rng(seed))
        np.testing.assert_array_equal(view, even(90))
    colors = [
        augment_as_darknet(even(180, 90, 60), targets_of(), magnitudes, rng(seed))[0][0, 0]
        for seed in range(20)
    ]
    assert np.ptp(colors, axis=0).max() > 20


@pytest.mark.parametrize("modality", MODALITIES)
def test_a_view_depends_on_the_generator_alone(modality: Modality):
    image, targets = with_box(3 if modality == "rgb" else 1), targets_of(BOX)
    config, augmentation = ImageConfig(modality), ImageAugmentationConfig("thesis")
    torch.manual_seed(5)
    state = torch.get_rng_state()
    first, again, other = (
        augment(image, targets, config, augmentation, rng(seed)) for seed in (3, 3, 4)
    )
    np.testing.assert_array_equal(first[0], again[0])
    np.testing.assert_array_equal(first[1].boxes_px, again[1].boxes_px)
    assert (first[0] != other[0]).any()
    assert torch.equal(torch.get_rng_state(), state)


def test_a_magnitude_of_zero_leaves_the_image():
    image, targets = with_box(3), targets_of(BOX, (0.0, 0.0, 9.0, 9.0))
    view, kept = augment_as_darknet(image, targets, NONE, rng())
    np.testing.assert_array_equal(view, image)
    np.testing.assert_array_equal(kept.boxes_px, targets.boxes_px)


def test_a_magnitude_that_cannot_be_is_refused():
    with fault(UsageError, "augmentation jitter", "a magnitude from 0 to 0.45"):
        DarknetAugmentationConfig(jitter=0.5)
