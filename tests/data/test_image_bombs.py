"""Images whose headers state more pixels than any camera has, in few bytes."""

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from data.image_decoder import MAX_PIXELS, decode_image, stated_size_px
from data.kitti.sensor_files import read_image
from perception.errors import ImageError
from tests.faults import fault
from tests.fuzz.refusal import memory_bound


def png(width: int, height: int) -> bytes:
    """Return a whole PNG of black pixels, as small as it can be."""

    def chunk(name: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        )

    header = struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)
    rows = zlib.compress(bytes(min(height, 1 << 12) * (1 + (width + 7) // 8)), 9)
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")
    )


def jpeg(width: int, height: int) -> bytes:
    """Return a JPEG whose frame header states a size."""
    data = bytearray(cv2.imencode(".jpg", np.zeros((8, 8, 3), np.uint8))[1].tobytes())
    start = data.index(b"\xff\xc0")
    data[start + 5 : start + 9] = struct.pack(">HH", height, width)
    return bytes(data)


@pytest.mark.parametrize("make", [png, jpeg])
def test_sizes_are_read_from_the_header(make):
    assert stated_size_px(make(640, 48)) == (640, 48)


def test_other_formats_and_cut_ones_state_no_size():
    image = jpeg(640, 48)
    assert [stated_size_px(data) for data in (b"", b"BM", png(9, 9)[:20], image[:30])] == [None] * 4
    assert stated_size_px(b"\xff\xd8" + bytes(20)) is None
    assert stated_size_px(b"\xff\xd8" + b"\xff" * 99) is None


@pytest.mark.parametrize("make", [png, jpeg])
def test_an_image_of_more_pixels_than_any_camera_is_refused(make, tmp_path):
    path = Path(tmp_path / "bomb.png")
    path.write_bytes(make(60_000, 50_000))
    assert path.stat().st_size < 50_000
    with fault(ImageError, where=str(path), expected=str(MAX_PIXELS), found="60000x50000"):
        read_image(path)


def test_the_largest_cameras_are_read():
    assert decode_image(png(8192, 256), "image").shape == (256, 8192, 3)


def test_formats_without_a_known_header_end_in_one_sentence():
    image = b"P6 100000 100000 255\n" + bytes(100)
    with fault(ImageError, where="image.ppm", found="121 bytes that cannot be decoded"):
        decode_image(image, "image.ppm")


def test_a_chunk_that_states_more_bytes_than_the_file_has_is_refused(tmp_path):
    whole = cv2.imencode(".png", np.zeros((6, 9, 3), np.uint8))[1].tobytes()
    start = whole.index(b"IDAT") - 4
    path = tmp_path / "chunk.png"
    path.write_bytes(whole[:start] + b"\x7f\xff\xff\xff" + whole[start + 4 :])
    with memory_bound(64 << 20), fault(ImageError, str(path), expected="a whole PNG or JPEG image"):
        read_image(path)
