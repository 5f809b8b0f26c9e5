"""Images of distorted cameras, undistorted."""

import cv2
import numpy as np
import pytest

from perception.errors import CalibrationError
from perception.geometry.undistortion import Lens

SIZE_PX = (320, 200)
MATRIX = np.array([[180.0, 0, 160], [0, 175, 100], [0, 0, 1]])
BROWN = np.array([-0.28, 0.07, 1e-3, -5e-4, 0.0])
RATIONAL = np.array([0.3, 0.05, 1e-4, 2e-4, 0.001, 0.6, 0.1, 0.002])
FISHEYE = np.array([-0.02, 0.01, -0.005, 0.001])
# Points in front of the camera, well inside its view.
POINTS_CAM = np.array([[x, y, 4.0] for x in (-2.0, 0.3, 1.8) for y in (-1.0, 0.4, 1.1)])


def distorted_px(coefficients: np.ndarray, model: str) -> np.ndarray:
    """Return the (N, 2) pixels of the points in the distorted image, by OpenCV's projection."""
    if model == "equidistant":
        pixels, _ = cv2.fisheye.projectPoints(
            POINTS_CAM[:, None], np.zeros(3), np.zeros(3), MATRIX, coefficients
        )
    else:
        pixels, _ = cv2.projectPoints(POINTS_CAM, np.zeros(3), np.zeros(3), MATRIX, coefficients)
    return pixels.reshape(-1, 2)


def brightest_px(image: np.ndarray, near_px: np.ndarray) -> np.ndarray:
    """Return the centre of brightness around a pixel."""
    x, y = np.round(near_px).astype(int)
    part = image[y - 6 : y + 7, x - 6 : x + 7, 0].astype(float)
    rows, columns = np.mgrid[y - 6 : y + 7, x - 6 : x + 7]
    return np.array([(columns * part).sum(), (rows * part).sum()]) / part.sum()


@pytest.mark.parametrize(
    ("coefficients", "model"),
    [(BROWN, "plumb_bob"), (RATIONAL, "rational_polynomial"), (FISHEYE, "equidistant")],
)
def test_points_appear_where_the_pinhole_shows_them(coefficients: np.ndarray, model: str) -> None:
    lens = Lens(MATRIX, coefficients, SIZE_PX, model)
    expected = POINTS_CAM @ lens.pinhole_matrix.T
    expected = expected[:, :2] / expected[:, 2:]
    for distorted, pinhole in zip(distorted_px(coefficients, model), expected, strict=True):
        image = np.zeros((200, 320, 3), np.uint8)
        rows, columns = np.mgrid[:200, :320]
        blob = np.exp(-((columns - distorted[0]) ** 2 + (rows - distorted[1]) ** 2) / 2)
        image[:] = np.round(255 * blob)[..., None]
        found = brightest_px(lens.undistort(image), pinhole)
        assert np.linalg.norm(found - pinhole) < 0.2


def test_pinhole_images_are_used_as_they_are() -> None:
    lens = Lens(MATRIX, np.zeros(5), SIZE_PX)
    image = np.full((200, 320, 3), 7, np.uint8)
    assert lens.undistort(image) is image
    assert np.array_equal(lens.pinhole_matrix, MATRIX)
    assert not Lens(MATRIX, np.zeros(4), SIZE_PX, "fisheye").is_pinhole


def test_rectification_and_target_matrix_are_applied() -> None:
    turn = cv2.Rodrigues(np.array([0.0, 0.02, 0.0]))[0]
    target = np.diag([150.0, 150.0, 1.0]) + np.array([[0, 0, 160], [0, 0, 100], [0, 0, 0.0]])
    lens = Lens(MATRIX, np.zeros(5), SIZE_PX, rectification=turn, target_matrix=target)
    image = np.zeros((200, 320, 3), np.uint8)
    image[98:103, 158:163] = 255  # on the axis
    pinhole = target @ turn @ np.array([0, 0, 1.0])
    found = brightest_px(lens.undistort(image), pinhole[:2] / pinhole[2])
    assert np.linalg.norm(found - pinhole[:2] / pinhole[2]) < 0.3


def test_unknown_model_is_named() -> None:
    with pytest.raises(CalibrationError, match=r"plumb_bob, .*equidistant.*found 'mirror'"):
        Lens(MATRIX, BROWN, SIZE_PX, "mirror")


def test_too_many_coefficients_are_counted() -> None:
    with pytest.raises(CalibrationError, match=r"4 coefficients of equidistant, found 5"):
        Lens(MATRIX, np.full(5, 0.1), SIZE_PX, "equidistant")


def test_broken_matrix_is_an_error() -> None:
    with pytest.raises(CalibrationError, match=r"positive focal lengths.*found 0, 0 and 320x200"):
        Lens(np.zeros((3, 3)), BROWN, SIZE_PX)


def test_image_of_another_size_is_an_error() -> None:
    with pytest.raises(CalibrationError, match=r"calibration of 100x50 images, found that of 320x"):
        Lens(MATRIX, BROWN, SIZE_PX).undistort(np.zeros((50, 100, 3), np.uint8))
