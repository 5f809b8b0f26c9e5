import numpy as np
import pytest

from benchmarks.reference.color_filters import ReferenceAdaptiveColors, wandering_ratios
from perception.tracking.single_object.color_model import (
    AdaptiveColorModel,
    bin_colors,
    color_bins,
    color_ratios,
)
from perception.tracking.single_object.config import ColorModelConfig
from perception.tracking.single_object.image_region import region_of

RED, GRAY, BLUE = (200, 10, 10), (100, 100, 100), (10, 10, 200)
SIZE_PX = (100, 80)
# 20 x 20 pixels in a ring of about as many.
BINS = ColorModelConfig().bins
REGION = region_of(np.array([[40.0, 30], [59, 30], [59, 49], [40, 49]]), SIZE_PX)


def bin_of(color: tuple[int, int, int]) -> int:
    return int(color_bins(np.array(color, np.uint8)))


def image_of(color: tuple[int, int, int]) -> np.ndarray:
    return np.full((80, 100, 3), color, np.uint8)


def test_bins_by_hand():
    assert bin_of((0, 0, 0)) == 0
    assert bin_of((0, 0, 32)) == 1
    assert bin_of((0, 32, 0)) == 8
    assert bin_of((31, 31, 255)) == 7
    assert bin_of((255, 255, 255)) == BINS - 1


def test_the_colour_of_a_bin_is_in_the_bin():
    np.testing.assert_array_equal(color_bins(bin_colors()), np.arange(BINS))
    np.testing.assert_array_equal(bin_colors()[bin_of(RED)], [208, 16, 16])


def test_the_colour_of_the_object_alone_distinguishes_it():
    image = image_of(GRAY)
    image[30:50, 40:60] = RED
    ratios = color_ratios(image, REGION)
    expected = np.zeros(BINS)
    expected[bin_of(RED)] = 1.0
    np.testing.assert_array_equal(ratios, expected)


def test_ratios_by_hand():
    # On the object 200 red, 100 blue and 100 grey pixels; around it 50 blue ones, the rest grey.
    image = image_of(GRAY)
    image[30:40, 40:60] = RED
    image[40:45, 40:60] = BLUE
    around = np.argwhere(REGION.is_ring)[:, ::-1] + REGION.corner_px
    image[around[:50, 1], around[:50, 0]] = BLUE
    red = np.log((200 / 400) / (1 / len(around)))
    blue = np.log((100 / 400) / (50 / len(around)))
    ratios = color_ratios(image, REGION)
    assert ratios[bin_of(RED)] == 1.0
    assert ratios[bin_of(BLUE)] == pytest.approx(blue / red)
    assert np.count_nonzero(ratios) == 2  # grey is more of the ring's


def test_one_colour_has_ratios_of_zero():
    np.testing.assert_array_equal(color_ratios(image_of(GRAY), REGION), np.zeros(BINS))


def test_an_object_that_fills_the_image_has_its_colours_as_they_are():
    image = image_of(RED)
    image[:20] = BLUE
    region = region_of(np.array([[-1.0, -1], [101, -1], [101, 81], [-1, 81]]), SIZE_PX)
    assert not region.is_ring.any()
    ratios = color_ratios(image, region)
    assert ratios[bin_of(RED)] == 1.0
    assert ratios[bin_of(BLUE)] == pytest.approx(np.log(2000) / np.log(6000))


def test_a_ring_cut_off_by_the_image_counts_by_its_share():
    # An object at the border: its ring is less than half of it, and of the same colours half and half.
    region = region_of(np.array([[0.0, 0], [59, 0], [59, 79], [0, 79]]), SIZE_PX)
    assert region.is_ring.sum() < 0.5 * region.is_inside.sum()
    image = image_of(RED)
    image[::2] = BLUE
    assert color_ratios(image, region).max() == 0


def test_a_region_outside_the_image_has_no_ratios():
    gone = REGION.shifted(np.array([500.0, 0]), SIZE_PX)
    np.testing.assert_array_equal(color_ratios(image_of(RED), gone), np.zeros(BINS))


def test_the_bank_is_a_loop_of_single_filters():
    bank, plain = AdaptiveColorModel(), ReferenceAdaptiveColors()
    for ratios in wandering_ratios(in_use=40, frames=60, seed=3):
        bank.update(ratios)
        plain.update(ratios)
        assert len(bank) == len(plain.filters)
        np.testing.assert_allclose(bank.ratios, plain.ratios, atol=1e-12)


def test_the_first_model_is_taken_as_it_is():
    bank, ratios = AdaptiveColorModel(), np.zeros(BINS)
    ratios[[3, 9]] = 1.0, 0.25
    bank.update(ratios)
    np.testing.assert_allclose(bank.ratios, ratios)


def test_colours_come_and_go_with_their_filters():
    bank = AdaptiveColorModel()
    for seen in ([3, 9], [9], [9, 30], []):
        ratios = np.zeros(BINS)
        ratios[seen] = 1.0
        bank.update(ratios)
        np.testing.assert_array_equal(np.flatnonzero(bank.ratios), seen)
        assert len(bank) == len(seen)


def test_a_step_of_the_light_is_tracked_slowly_then_fully():
    bank = AdaptiveColorModel()
    before, after = np.full(BINS, 0.0), np.full(BINS, 0.0)
    before[[3, 9]], after[[3, 9]] = (1.0, 0.2), (0.2, 1.0)
    for _ in range(20):
        bank.update(before)
    bank.update(after)
    assert bank.ratios[3] == 1.0  # one odd image does not turn the model over
    for _ in range(40):
        bank.update(after)
    np.testing.assert_allclose(bank.ratios[[3, 9]], [0.2, 1.0], atol=0.05)


def test_no_colour_at_all_ends_every_filter_and_never_gives_nan():
    bank = AdaptiveColorModel()
    for ratios in (np.zeros(BINS), np.ones(BINS), np.zeros(BINS)):
        bank.update(ratios)
        assert np.isfinite(bank.ratios).all()
    assert len(bank) == 0
    np.testing.assert_array_equal(bank.ratios, np.zeros(BINS))


def test_models_given_are_left_as_they_were():
    bank, ratios = AdaptiveColorModel(), np.linspace(0, 1, BINS)
    before = ratios.copy()
    bank.update(ratios)
    bank.update(ratios)
    np.testing.assert_array_equal(ratios, before)
