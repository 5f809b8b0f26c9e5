"""What happens to images: each operation does what it says, and none does nothing."""

from dataclasses import fields, replace

import numpy as np
import pytest

from data.samples.images.config import PhotometricConfig
from data.samples.images.photometric import transform_image

NONE = PhotometricConfig.none()


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def even(color: tuple[int, int, int]) -> np.ndarray:
    return np.full((48, 64, 3), color, np.uint8)


def changed_means(color: tuple[int, int, int], magnitudes: PhotometricConfig) -> np.ndarray:
    """Return (60, 3) the mean colours of an even image at 60 looks."""
    views = [transform_image(even(color), magnitudes, rng(seed)) for seed in range(60)]
    return np.array([view.mean(axis=(0, 1)) for view in views])


def test_a_magnitude_of_zero_leaves_the_image():
    image = rng().integers(0, 256, (48, 64, 3), np.uint8)
    np.testing.assert_array_equal(transform_image(image, NONE, rng()), image)


@pytest.mark.parametrize("operation", [field.name for field in fields(PhotometricConfig)])
def test_every_operation_changes_the_image_and_is_repeatable(operation: str):
    image = rng().integers(60, 200, (48, 64, 3), np.uint8)
    magnitudes = PhotometricConfig().only(operation)
    views = [transform_image(image, magnitudes, rng(seed)) for seed in range(12)]
    assert any((view != image).any() for view in views)
    for seed, view in enumerate(views):
        assert (view.shape, view.dtype) == (image.shape, np.uint8)
        np.testing.assert_array_equal(transform_image(image, magnitudes, rng(seed)), view)


def test_brightness_is_a_factor():
    factors = changed_means((80, 80, 80), replace(NONE, brightness=1.0)) / 80
    assert 0.49 < factors.min() < 0.6
    assert 1.7 < factors.max() < 2.01
    np.testing.assert_allclose(np.ptp(factors, axis=1), 0, atol=1e-9)


def test_contrast_and_gamma_leave_what_they_turn_about():
    means = changed_means((90, 90, 90), replace(NONE, contrast=1.0))
    np.testing.assert_allclose(means, 90, atol=0.51)
    for end in (0, 255):
        means = changed_means((end, end, end), replace(NONE, gamma=1.0))
        np.testing.assert_allclose(means, end)


def test_white_balance_changes_each_colour_by_itself():
    means = changed_means((100, 100, 100), replace(NONE, white_balance=0.2))
    assert (means >= 83).all()
    assert (means <= 120).all()
    assert (np.ptp(means, axis=1) > 5).mean() > 0.8


@pytest.mark.parametrize("operation", ["saturation", "hue_rad"])
def test_grey_has_no_colour_to_change(operation: str):
    grey = changed_means((120, 120, 120), replace(NONE, **{operation: 0.8}))
    np.testing.assert_allclose(grey, 120, atol=1)
    colored = changed_means((180, 90, 60), replace(NONE, **{operation: 0.8}))
    assert np.ptp(colored, axis=0).min() > 20


def test_light_and_shadow_vary_over_the_image_and_shadows_only_darken():
    views = [transform_image(even((120,) * 3), replace(NONE, light=0.5), rng(s)) for s in range(10)]
    for view in views:
        assert 79 <= view.min() < view.max() <= 181
    shadows = [
        transform_image(even((120,) * 3), replace(NONE, shadow=1.0), rng(s)) for s in range(10)
    ]
    assert max(view.max() for view in shadows) == 120
    assert min(view.min() for view in shadows) >= 120 * 0.24
    assert np.mean([view.mean() < 118 for view in shadows]) > 0.5


def test_filters_and_blur_leave_an_even_area_as_it_is():
    for magnitudes in (replace(NONE, filtering=0.1), replace(NONE, blur_px=2.0)):
        means = changed_means((100, 150, 200), magnitudes)
        np.testing.assert_allclose(means, np.tile([100, 150, 200], (60, 1)), atol=1)


def test_noise_has_the_spread_that_it_says():
    spreads = [
        transform_image(even((120,) * 3), replace(NONE, noise=20), rng(seed)).std()
        for seed in range(40)
    ]
    assert 17 < max(spreads) < 21
    assert np.median(spreads) == pytest.approx(10, abs=4)
