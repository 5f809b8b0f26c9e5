"""What the network sees of a window, against a plain loop over pixels."""

import cv2
import numpy as np
import pytest

from perception.detection.depthcn.crops import crop_windows
from perception.errors import PerceptionError

SHAPE = (66, 112)


def smooth_image(channels: int = 3) -> np.ndarray:
    rows, columns = np.mgrid[:120, :400]
    ramps = [columns / 400, rows / 120, (rows + columns) / 520]
    return np.stack([np.rint(255 * ramp) for ramp in ramps[:channels]], axis=-1).astype(np.uint8)


def sampled(image: np.ndarray, window: np.ndarray) -> np.ndarray:
    """The nearest pixels, one by one."""
    x1, y1, x2, y2 = window
    crop = np.zeros((image.shape[2], *SHAPE))
    height, width = image.shape[:2]
    for row in range(SHAPE[0]):
        for column in range(SHAPE[1]):
            x = round(x1 + (column + 0.5) / SHAPE[1] * (x2 - x1))
            y = round(y1 + (row + 0.5) / SHAPE[0] * (y2 - y1))
            if 0 <= x < width and 0 <= y < height:
                crop[:, row, column] = image[y, x]
    return crop


@pytest.mark.parametrize(
    "window",
    [
        pytest.param((100.0, 30, 180, 77), id="inside"),
        pytest.param((100.4, 30.7, 133.9, 50.2), id="between pixels"),
        pytest.param((-40.0, -20, 60, 50), id="beyond the upper left"),
        pytest.param((350.0, 90, 460, 160), id="beyond the lower right"),
        pytest.param((200.0, 60, 202, 61), id="tiny"),
        pytest.param((-900.0, -500, 1300, 800), id="huge"),
    ],
)
def test_a_crop_shows_the_nearest_pixels_of_the_window(window):
    image = smooth_image()
    crop = crop_windows(image, np.array([window]))[0]
    error = np.abs(crop.astype(float) - sampled(image, np.array(window)))
    # OpenCV rounds places to a fraction of a pixel: half-way between two, either may be taken.
    assert (error > 0).mean() < 0.03
    assert (error > 3).mean() < 0.01


def test_a_window_of_the_crops_size_copies_pixels():
    image = np.random.default_rng(0).integers(0, 256, (120, 400, 3), np.uint8)
    # Pixel 0 spreads from -0.5 to 0.5.
    crop = crop_windows(image, np.array([[49.5, 19.5, 161.5, 85.5]]))[0]
    np.testing.assert_array_equal(crop, image[20:86, 50:162].transpose(2, 0, 1))


def test_crops_of_the_thesis_are_resized_by_cubic_interpolation():
    image = np.random.default_rng(0).integers(0, 256, (120, 400, 1), np.uint8)
    crop = crop_windows(image, np.array([[99.5, 29.5, 155.5, 62.5]]), "thesis")[0, 0]
    expected = cv2.resize(image[30:63, 100:156], (112, 66), interpolation=cv2.INTER_CUBIC)
    # Beyond the window the image goes on, where the resized part repeats its edge.
    np.testing.assert_allclose(crop[4:-4, 4:-4], expected[4:-4, 4:-4], atol=8)


def test_crops_are_empty_outside_the_image():
    crops = crop_windows(
        np.full((50, 60, 3), 200, np.uint8),
        np.array([[-300.0, -300, -200, -200], [1e9, 1e9, 2e9, 2e9], [-56.5, -0.5, 55.5, 49.5]]),
    )
    assert crops[:2].max() == 0
    assert (crops[2][:, :, :56] == 0).all()
    assert (crops[2][:, 1:-1, 56:] == 200).all()


@pytest.mark.parametrize("channels", [1, 2, 3])
def test_channels_come_first(channels):
    image = smooth_image()[..., :channels]
    windows = np.array([[10.0, 10, 90, 60], [20, 20, 60, 50]])
    crops = crop_windows(image, windows)
    assert crops.shape == (2, channels, *SHAPE)
    for channel in range(channels):
        alone = crop_windows(image[..., [channel]], windows)[:, 0]
        assert np.abs(crops[:, channel].astype(int) - alone).max() <= 3


def test_no_windows_give_no_crops():
    assert crop_windows(smooth_image(), np.zeros((0, 4))).shape == (0, 3, *SHAPE)


def test_a_box_without_width_is_seen_one_pixel_wide():
    image = smooth_image()
    crop = crop_windows(image, np.array([[100.0, 20, 100, 60]]))[0]
    wider = crop_windows(image, np.array([[100.0, 20, 101, 60]]))[0]
    np.testing.assert_array_equal(crop, wider)


@pytest.mark.parametrize("edge", [np.nan, np.inf])
def test_a_window_that_is_not_finite_is_refused(edge):
    with pytest.raises(PerceptionError) as error:
        crop_windows(smooth_image(), np.array([[0.0, 0, edge, 10]]))
    assert (error.value.where, error.value.expected) == ("windows_px", "finite windows")
