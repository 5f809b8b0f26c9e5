"""Which rows of an image a detector is shown, and that padding of an image changes nothing."""

from dataclasses import replace

import numpy as np
import pytest

from perception.detection.detectors.image_region import detection_region, first_observed_row
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.detectors.network_input import PixelRectangle, place
from perception.maps.projection import VIRTUAL_CAMERA
from perception.types import Calibration
from tests.detection.bright_cells import bright_cells


def camera(size_px: tuple[int, int], focal_px: float, row_px: float) -> Calibration:
    """Return a camera that looks ahead, with its principal point in the middle column of a row."""
    image_P_cam = np.array(
        [[focal_px, 0, size_px[0] / 2, 0], [0, focal_px, row_px, 0], [0, 0, 1, 0]]
    )
    return replace(VIRTUAL_CAMERA, image_P_cam=image_P_cam, image_size_px=size_px)


def test_images_of_kitti_are_shown_as_a_whole():
    assert detection_region(VIRTUAL_CAMERA, (1242, 375)) == (0, 0, 1242, 375)


def test_without_a_calibration_the_whole_image_is_shown():
    assert detection_region(None, (1936, 1216)) == (0, 0, 1936, 1216)


@pytest.mark.parametrize(
    ("size_px", "focal_px", "rows"),
    [
        # 15 degrees up and 25 degrees down from the middle row, within the image.
        ((1936, 1216), 1450, (219, 1216)),
        ((1936, 1216), 1000, (340, 1075)),
        ((1280, 720), 640, (188, 659)),
    ],
)
def test_sky_and_bonnet_are_left_out(size_px, focal_px, rows):
    width, height = size_px
    region = detection_region(camera(size_px, focal_px, height / 2), size_px)
    assert region == (0, rows[0], width, rows[1])


@pytest.mark.parametrize("turned_rad", [0.0, 1.5, 3.0])
def test_a_camera_to_the_side_or_back_has_the_same_rows(turned_rad):
    cosine, sine = np.cos(turned_rad), np.sin(turned_rad)
    turn = np.array([[cosine, -sine, 0, 0], [sine, cosine, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    ahead = camera((1280, 720), 640, 360)
    turned = replace(ahead, cam_SE3_velo=ahead.cam_SE3_velo @ turn)
    assert detection_region(turned, (1280, 720)) == detection_region(ahead, (1280, 720))


def test_a_camera_that_is_tilted_up_keeps_its_whole_image():
    up = np.array([[0, 0, -1, 0], [0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
    tilted = replace(VIRTUAL_CAMERA, cam_SE3_velo=VIRTUAL_CAMERA.cam_SE3_velo @ up)
    assert detection_region(tilted, (1242, 375)) == (0, 0, 1242, 375)


def test_an_object_has_the_same_box_in_a_padded_image(tmp_path):
    path = tmp_path / "bright.onnx"
    path.write_bytes(bright_cells("rgb"))
    detector = ModalityDetector(path)
    rng = np.random.default_rng(3)
    image = rng.integers(0, 200, (375, 1242, 3), dtype=np.uint8)
    image[150:300, 400:700] = 255
    padded = np.pad(image, ((200, 201), (0, 0), (0, 0)))  # to 776 rows: 16:10
    found = detector.detect(image)
    shown = detector.detect(
        padded, detection_region(None, (1242, 375))._replace(top=200, bottom=575)
    )
    # At the borders of an image, boxes end at the centres of the outermost pixels.
    expected = np.clip(shown.boxes_px - [0, 200, 0, 200], 0, [1241, 374] * 2)
    np.testing.assert_allclose(expected, found.boxes_px, atol=1e-6)
    np.testing.assert_array_equal(shown.scores, found.scores)


@pytest.mark.parametrize("below_px", [0, 160])
def test_an_object_is_shown_at_the_same_scale_whatever_is_above_the_region(below_px):
    low = camera((1280, 560 + below_px), 640, 360)
    high = camera((1280, 960 + below_px), 640, 760)
    region, higher = (detection_region(one, one.image_size_px) for one in (low, high))
    assert (higher.top - region.top, higher.bottom - region.bottom) == (400, 400)


def test_rows_above_all_but_few_returns_are_not_observed():
    is_measured = np.zeros((10, 100), bool)
    is_measured[4:] = True
    assert first_observed_row(is_measured) == 4
    is_measured[1, :12] = True  # 12 of 612: less than 2 %
    assert first_observed_row(is_measured) == 4
    is_measured[1, 12] = True
    assert first_observed_row(is_measured) == 1
    assert first_observed_row(np.zeros((10, 100), bool)) == 10


@pytest.mark.parametrize(
    ("row", "height_px"), [(0, 192), (30, 192), (63, 160), (125, 128), (200, 96), (375, 32)]
)
def test_rows_without_returns_are_left_out_at_the_same_scale(row, height_px):
    whole = place(PixelRectangle(0, 0, 1242, 375), InputSize(192, 640))
    lower = whole.from_row(row)
    assert lower.size == (height_px, 640)
    assert lower.region.top <= row
    assert lower.region.bottom == 375
    assert lower.height_scale == pytest.approx(whole.height_scale, rel=0.01)
    # A box may end above the rows that are shown.
    box_px = np.array([[100.0, 20, 300, 350]])
    np.testing.assert_allclose(lower.to_image(lower.to_input(box_px)), box_px)


def test_rows_of_a_region_are_never_above_it():
    region = PixelRectangle(0, 100, 1242, 475)
    placement = place(region, InputSize(192, 640))
    assert placement.from_row(0) == placement
    assert placement.from_row(225).region == (0, 225, 1242, 475)
