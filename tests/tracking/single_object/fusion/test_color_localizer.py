import numpy as np
import pytest

from perception.tracking.single_object.color_model import color_ratios
from perception.tracking.single_object.config import ColorModelConfig, ImageMeanShiftConfig
from perception.tracking.single_object.fusion.color_localizer import (
    confidence,
    confidence_centroid,
    image_mean_shift,
)
from perception.tracking.single_object.image_region import region_of

SIZE_PX = (160, 120)
THESIS = ImageMeanShiftConfig()
EXACT = ImageMeanShiftConfig(tolerance_px=0.01)


def square_at(column: float, row: float, half_px: float = 10.0) -> np.ndarray:
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half_px
    return corners + np.array([column, row])


def scene(column: int, row: int) -> np.ndarray:
    """A red square of 21 x 21 pixels on grey."""
    image = np.full((120, 160, 3), 90, np.uint8)
    image[max(row - 10, 0) : row + 11, max(column - 10, 0) : column + 11] = (220, 20, 20)
    return image


@pytest.fixture
def learned():
    region = region_of(square_at(60, 50), SIZE_PX)
    return region, color_ratios(scene(60, 50), region)


def test_the_confidence_is_the_ratio_of_each_pixel(learned):
    region, ratios = learned
    window = confidence(scene(60, 50), region, ratios)
    np.testing.assert_array_equal(window, region.is_inside)


def test_the_region_moves_exactly_onto_the_object(learned):
    region, ratios = learned
    found = image_mean_shift(scene(67, 45), region, ratios, EXACT)
    np.testing.assert_allclose(found.center_px, [67, 45])
    np.testing.assert_allclose(found.regions[-1].center_px, [67, 45])
    np.testing.assert_allclose(found.regions[0].center_px, [60, 50])


def test_an_object_where_it_was_takes_one_shift(learned):
    region, ratios = learned
    found = image_mean_shift(scene(60, 50), region, ratios, THESIS)
    assert len(found.regions) == 2
    np.testing.assert_allclose(found.regions[-1].hull_px, region.hull_px)


def test_the_number_of_shifts_is_limited(learned):
    region, ratios = learned
    config = ImageMeanShiftConfig(max_iterations=2, tolerance_px=0)
    assert len(image_mean_shift(scene(75, 62), region, ratios, config).regions) == 3


def test_an_uneven_colour_does_not_shift_the_region():
    # Only the left third of the object differs from what is around it.
    def striped(column: int) -> np.ndarray:
        image = np.full((120, 160, 3), 90, np.uint8)
        image[40:61, column - 10 : column - 3] = (220, 20, 20)
        return image

    region = region_of(square_at(60, 50), SIZE_PX)
    ratios = color_ratios(striped(60), region)
    start_px = confidence_centroid(striped(60), region, ratios)
    np.testing.assert_allclose(start_px, [53, 50])
    found = image_mean_shift(striped(64), region, ratios, EXACT, start_px)
    np.testing.assert_allclose(found.center_px, [57, 50])
    np.testing.assert_allclose(found.regions[-1].center_px, [64, 50])


def test_the_mean_is_weighted_and_not_divided_by_the_number_of_pixels():
    # (5.14) as printed would put the centroid of half-sure pixels near the image's corner.
    region = region_of(square_at(60, 50), SIZE_PX)
    image = scene(60, 50)
    half_sure = 0.5 * color_ratios(image, region)
    np.testing.assert_allclose(confidence_centroid(image, region, half_sure), [60, 50])


def test_an_object_half_out_of_the_image_is_found_by_what_is_left(learned):
    region, ratios = learned
    edge = region.shifted(np.array([-56.0, 0.0]), SIZE_PX)
    # Columns 0 to 12 are left of the square.
    found = image_mean_shift(scene(2, 50), edge, ratios, EXACT)
    np.testing.assert_allclose(found.center_px, [6, 50])


@pytest.mark.parametrize("iterations", [0, 4])
def test_without_any_of_its_colours_the_region_is_lost_and_stays(learned, iterations):
    region, _ = learned
    config = ImageMeanShiftConfig(max_iterations=iterations)
    found = image_mean_shift(scene(60, 50), region, np.zeros(ColorModelConfig().bins), config)
    assert found.center_px is None
    assert found.regions == (region,)


def test_outside_the_image_the_region_is_lost(learned):
    region, ratios = learned
    gone = region.shifted(np.array([-500.0, 0.0]), SIZE_PX)
    found = image_mean_shift(scene(60, 50), gone, ratios, THESIS)
    assert found.center_px is None
    assert found.regions == (gone,)


def test_image_and_model_are_left_as_they_were(learned):
    region, ratios = learned
    image = scene(66, 52)
    before = image.copy(), ratios.copy()
    image_mean_shift(image, region, ratios, THESIS)
    np.testing.assert_array_equal(image, before[0])
    np.testing.assert_array_equal(ratios, before[1])
