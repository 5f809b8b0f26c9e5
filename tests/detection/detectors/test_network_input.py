"""Images in a network's input: their aspect, the way back of boxes, tiles."""

import numpy as np
import pytest

from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.network_input import (
    PixelRectangle,
    place,
    place_tiles,
    prepare_image,
)


def whole(width: int, height: int) -> PixelRectangle:
    return PixelRectangle(0, 0, width, height)


@pytest.mark.parametrize("size_px", [(1242, 375), (1936, 1216), (1280, 720), (600, 900), (97, 33)])
@pytest.mark.parametrize("size", [InputSize(192, 640), InputSize(416, 416)])
def test_content_has_the_aspect_of_the_image_to_a_pixel(size_px, size):
    content = place(whole(*size_px), size).content
    assert content.width_px == size.width_px or content.height_px == size.height_px
    scale = min(size.width_px / size_px[0], size.height_px / size_px[1])
    assert abs(content.width_px - scale * size_px[0]) <= 0.5
    assert abs(content.height_px - scale * size_px[1]) <= 0.5


@pytest.mark.parametrize("size_px", [(1242, 375), (1936, 1216), (1280, 720), (600, 900)])
def test_a_size_for_the_image_leaves_little_padding(size_px):
    size = InputSize(192, 640).for_image(size_px[1], size_px[0])
    content = place(whole(*size_px), size).content
    assert size.height_px - content.height_px < 32
    assert size.width_px - content.width_px < 64


def test_padding_is_right_and_below_or_on_all_sides():
    size, image = InputSize(4, 8), np.full((4, 4, 3), 200, np.uint8)
    corner = prepare_image(image, "rgb", place(whole(4, 4), size))
    np.testing.assert_array_equal(corner[..., 0], np.tile([200] * 4 + [114] * 4, (4, 1)))
    centered = prepare_image(image, "rgb", place(whole(4, 4), size, alignment="center"), None, 7)
    np.testing.assert_array_equal(centered[..., 2], np.tile([7] * 2 + [200] * 4 + [7] * 2, (4, 1)))


def test_padding_of_maps_is_unknown():
    shown = prepare_image(
        np.full((4, 4, 1), 9, np.uint8), "dm", place(whole(4, 4), InputSize(4, 8))
    )
    assert shown.shape == (4, 8, 1)
    assert shown[0, :, 0].tolist() == [9] * 4 + [0] * 4


@pytest.mark.parametrize("fit", ["letterbox", "stretch"])
@pytest.mark.parametrize("alignment", ["top-left", "center"])
def test_boxes_return_to_where_they_were(fit, alignment):
    region = PixelRectangle(13, 40, 1913, 940)
    placement = place(region, InputSize(192, 640), fit, alignment)
    boxes_px = np.array([[20.0, 50, 300, 400], [13, 40, 1913, 940]])
    shown_px = placement.to_input(boxes_px)
    np.testing.assert_allclose(shown_px[1], placement.content)
    np.testing.assert_allclose(placement.to_image(shown_px), boxes_px)
    np.testing.assert_allclose(placement.to_image(np.add(shown_px[1:], [-9, -9, 0, 99])), [region])


def test_the_region_alone_is_shown():
    image = np.zeros((60, 100, 1), np.uint8)
    image[20:50, 10:90] = 50
    shown = prepare_image(image, "dm", place(PixelRectangle(10, 20, 90, 50), InputSize(30, 80)))
    assert (shown == 50).all()


def test_tiles_have_the_aspect_of_the_input_overlap_and_cover_the_image():
    first, *tiles = place_tiles(whole(1242, 375), InputSize(416, 416))
    assert first.region == (0, 0, 1242, 375)
    assert [tile.region.left for tile in tiles] == [0, 217, 434, 650, 867]
    assert {(*tile.region[1::2], tile.region.width_px) for tile in tiles} == {(0, 375, 375)}
    assert all(tile.content == (0, 0, 416, 416) for tile in tiles)


def test_one_tile_is_the_image_itself():
    (placement,) = place_tiles(whole(300, 300), InputSize(416, 416))
    assert placement.region == (0, 0, 300, 300)


def test_boxes_that_a_tile_cuts():
    region, image = PixelRectangle(289, 0, 664, 375), whole(1242, 375)
    tile = place(region, InputSize(416, 416))
    boxes_px = np.array(
        [[300.0, 0, 400, 100], [289.5, 50, 400, 100], [500, 50, 663, 374], [500, 50, 600, 375]]
    )
    assert tile.is_cut(boxes_px, image).tolist() == [False, True, True, False]
    assert not tile.is_cut(boxes_px, region).any()
