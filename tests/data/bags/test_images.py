"""Image messages of any encoding, read back as RGB."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from data.bags.images import read_image_message
from perception.errors import ImageError
from tests.bag_writer import BagWriter

RGB = np.zeros((8, 12, 3), np.uint8)
RGB[:, :6], RGB[:, 6:] = (200, 40, 10), (20, 60, 180)
RED = np.full((8, 12, 3), (240, 30, 5), np.uint8)  # one colour: a mosaic is exact


def mosaic(image: np.ndarray, pattern: str) -> np.ndarray:
    """Return the (H, W) values that a sensor with this pattern of colours has."""
    values = np.empty(image.shape[:2], np.uint8)
    for place, colour in enumerate(pattern):
        row, column = divmod(place, 2)
        values[row::2, column::2] = image[row::2, column::2, "rgb".index(colour)]
    return values


def message(
    writer: BagWriter, encoding: str, rows: np.ndarray, *, is_big: bool = False, pad: int = 0
):
    data = rows.reshape(len(rows), -1).view(np.uint8)
    data = np.pad(data, ((0, 0), (0, pad)))
    return writer.make(
        "sensor_msgs/Image",
        header=writer.header(0, "camera"),
        height=8,
        width=12,
        encoding=encoding,
        is_bigendian=int(is_big),
        step=data.shape[1],
        data=data.ravel(),
    )


@pytest.fixture
def writer(tmp_path: Path) -> BagWriter:
    return BagWriter(tmp_path / "bag")


@pytest.mark.parametrize(
    ("encoding", "rows"),
    [
        ("rgb8", RGB),
        ("bgr8", RGB[..., ::-1].copy()),
        ("8UC3", RGB[..., ::-1].copy()),
        ("rgba8", cv2.cvtColor(RGB, cv2.COLOR_RGB2RGBA)),
        ("bgra8", cv2.cvtColor(RGB, cv2.COLOR_RGB2BGRA)),
        ("rgb16", RGB.astype("<u2") * 256 + 9),
    ],
)
def test_colours_are_exact(writer: BagWriter, encoding: str, rows: np.ndarray) -> None:
    assert np.array_equal(read_image_message(message(writer, encoding, rows, pad=5), "image"), RGB)


@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
def test_mosaics_become_colours(writer: BagWriter, pattern: str) -> None:
    rows = mosaic(RED, pattern)
    found = read_image_message(message(writer, f"bayer_{pattern}8", rows), "image")
    assert np.array_equal(found[2:-2, 2:-2], RED[2:-2, 2:-2])


def test_grey_images_have_three_equal_channels(writer: BagWriter) -> None:
    grey = RGB[..., 0].copy()
    found = read_image_message(message(writer, "mono8", grey), "image")
    assert np.array_equal(found, np.repeat(grey[..., None], 3, axis=2))
    deep = (grey.astype("u2") * 256).astype(">u2")
    assert np.array_equal(
        read_image_message(message(writer, "mono16", deep, is_big=True), "image"), found
    )


def test_yuv_images_are_near_their_colours(writer: BagWriter) -> None:
    luma, u, v = cv2.cvtColor(RED, cv2.COLOR_RGB2YUV)[0, 0]
    rows = np.tile(np.array([u, luma, v, luma], np.uint8), (8, 6))
    found = read_image_message(message(writer, "yuv422", rows), "image").astype(int)
    assert np.abs(found - RED).max() < 40  # of the television's range of values


def test_compressed_images_are_decoded(writer: BagWriter) -> None:
    data = cv2.imencode(".png", RGB[..., ::-1])[1].ravel()
    sent = writer.make(
        "sensor_msgs/CompressedImage", header=writer.header(0, "c"), format="png", data=data
    )
    assert np.array_equal(read_image_message(sent, "image"), RGB)
    sent.data = data[:-30]
    with pytest.raises(ImageError, match=r"^image: expected a whole PNG or JPEG.*format 'png'"):
        read_image_message(sent, "image")


def test_unknown_encodings_are_named(writer: BagWriter) -> None:
    with pytest.raises(ImageError, match=r"encoding of rgb8, .*, found 32FC1"):
        read_image_message(message(writer, "32FC1", RGB), "image")


def test_too_few_bytes_are_an_error(writer: BagWriter) -> None:
    sent = message(writer, "rgb8", RGB)
    sent.data = sent.data[:-1]
    with pytest.raises(ImageError, match=r"8 rows of 12 pixels, 36 bytes each, found 287 bytes"):
        read_image_message(sent, "image")
