"""Plain PNG images, beside OpenCV and a reference of the five filters."""

import struct
import zlib

import cv2
import numpy as np
import pytest

from data.image_decoder import decode_rgb_png

IMAGE = np.random.default_rng(0).integers(0, 256, (11, 7, 3)).astype(np.uint8)
IMAGE[:, 3:] = IMAGE[:, 2:3] + np.arange(4, dtype=np.uint8)[:, None]


def nearest(left: int, upper: int, corner: int) -> int:
    estimate = left + upper - corner
    return min((left, upper, corner), key=lambda value: abs(estimate - value))


def filtered(image: np.ndarray, kinds: list[int]) -> bytes:
    """Return the rows of an image as differences, by one kind after another."""
    rows = image.reshape(len(image), -1).astype(int)
    data = bytearray()
    for number, row in enumerate(rows):
        kind = kinds[number % len(kinds)]
        above = rows[number - 1] if number else np.zeros_like(row)
        data.append(kind)
        for i, value in enumerate(row):
            left, corner = (row[i - 3], above[i - 3]) if i >= 3 else (0, 0)
            mean, nearest_one = (left + above[i]) // 2, nearest(left, above[i], corner)
            data.append((value - (0, left, above[i], mean, nearest_one, 0)[kind]) % 256)
    return bytes(data)


def chunk(name: bytes, content: bytes) -> bytes:
    checksum = zlib.crc32(name + content)
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", checksum)


def png(rows: bytes, *, depth: int = 8, interlaced: int = 0, more: bytes = b"") -> bytes:
    height, width = IMAGE.shape[:2]
    header = struct.pack(">IIBBBBB", width, height, depth, 2, 0, 0, interlaced)
    deflated = zlib.compress(rows)
    parts = [chunk(b"IDAT", deflated[:40]), chunk(b"IDAT", deflated[40:])]
    start = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header)
    return start + more + b"".join(parts) + chunk(b"IEND", b"")


@pytest.mark.parametrize("kinds", [[0], [1], [2], [3], [4], [4, 3, 2, 1, 0]])
def test_each_kind_of_row_equals_opencv(kinds: list[int]) -> None:
    data = png(filtered(IMAGE, kinds))
    decoded = decode_rgb_png(data)
    assert decoded is not None
    np.testing.assert_array_equal(decoded, IMAGE)
    by_opencv = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    np.testing.assert_array_equal(decoded[..., ::-1], by_opencv)


def test_an_image_that_opencv_wrote_is_the_same() -> None:
    image = cv2.GaussianBlur(np.tile(IMAGE, (9, 20, 1)), (5, 5), 1.0)
    decoded = decode_rgb_png(cv2.imencode(".png", image)[1].tobytes())
    assert decoded is not None
    np.testing.assert_array_equal(decoded[..., ::-1], image)


ROWS = filtered(IMAGE, [4])


@pytest.mark.parametrize(
    "data",
    [
        b"",
        png(ROWS)[:-12],
        png(ROWS)[:-30],
        png(ROWS)[:60] + b"\x00" + png(ROWS)[61:],
        png(ROWS, depth=16),
        png(ROWS, interlaced=1),
        png(ROWS, more=chunk(b"eXIf", b"MM")),
        png(ROWS[:-1]),
        png(ROWS + b"\x00"),
        png(b"\x05" + ROWS[1:]),
        cv2.imencode(".png", IMAGE[..., 0])[1].tobytes(),
        cv2.imencode(".jpg", IMAGE)[1].tobytes(),
    ],
    ids=[
        "empty", "without end", "cut off", "damaged", "16 bits", "interlaced", "orientation", "too few rows",
        "too many rows", "unknown kind", "grey", "JPEG",
    ],
)  # fmt: skip
def test_other_forms_are_left_to_opencv(data: bytes) -> None:
    assert decode_rgb_png(data) is None
