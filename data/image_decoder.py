"""Images of any format as RGB, without a line of a library on the screen.

About damaged images, OpenCV's libjpeg and libpng write to stderr, where no other code can read it. Pillow holds the same
libraries: its pixels are the same, in the same time, and its errors are exceptions. OpenCV has the further formats, whose
messages pass through its log.
"""

import io
import struct
import warnings
import zlib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
from PIL import Image, ImageOps

from perception.errors import ImageError
from perception.kernels.png_rows import restore_rows
from perception.types import UInt8

# 8192 x 8192, four times the pixels of the largest cameras of vehicles; 200 MB as RGB.
MAX_PIXELS = 1 << 26

PNG_START = b"\x89PNG\r\n\x1a\n"
_JPEG = b"\xff\xd8"
# Frame headers, which state the size; the other codes of this range are tables.
_FRAMES = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}
# Markers without a length.
_BARE = {0x01, *range(0xD0, 0xDA)}
# These are about damaged properties of an image, not about its pixels.
warnings.filterwarnings("ignore", module=r"PIL\.")
# OpenCV 5 has it elsewhere than OpenCV 4.
_set_log_level = getattr(cv2, "setLogLevel", None) or cv2.utils.logging.setLogLevel
_set_log_level(0)  # silent

_JPEG_START, _JPEG_END = b"\xff\xd8\xff", b"\xff\xd9"
# 8 bits, red, green and blue, deflated, the five filters, not interlaced.
_PLAIN = (8, 2, 0, 0, 0)
# Others, such as of orientation and animation, may change what is seen.
_HARMLESS = {b"gAMA", b"cHRM", b"sRGB", b"sBIT", b"pHYs", b"tEXt", b"tIME", b"bKGD"}


def stated_size_px(data: bytes) -> tuple[int, int] | None:
    """Return (width, height) as a PNG or JPEG image states it; None of another format, or where nothing is stated."""
    if data.startswith(PNG_START) and len(data) >= 24:
        width, height = struct.unpack(">II", data[16:24])
        return width, height
    return _jpeg_size_px(data) if data.startswith(_JPEG) else None


def _jpeg_size_px(data: bytes) -> tuple[int, int] | None:
    """Walk the segments up to the frame header."""
    place = 2
    while place + 9 <= len(data):
        if data[place] != 0xFF:  # a damaged segment; the decoder says so
            return None
        marker = data[place + 1]
        if marker == 0xFF or marker in _BARE:  # fill bytes, markers alone
            place += 1 if marker == 0xFF else 2
            continue
        if marker in _FRAMES:
            height, width = struct.unpack(">HH", data[place + 5 : place + 9])
            return width, height
        place += 2 + int.from_bytes(data[place + 2 : place + 4], "big")
    return None


def decode_image(
    data: bytes, where: Path | str, advice: str | None = None, stated_format: str | None = None
) -> UInt8:
    """Decode to (H, W, 3) RGB.

    Args:
        data: Content of an image file.
        where: Name of the image for errors.
        advice: What to do about a damaged one.
        stated_format: Format that a message states beside the data.

    Raises:
        ImageError: The image is damaged, or states a size that no camera has, for which no memory is taken.
    """
    width, height = stated_size_px(data) or (0, 0)
    if width * height > MAX_PIXELS:
        raise ImageError(
            where,
            expected=f"an image of at most {MAX_PIXELS} pixels",
            found=f"{width}x{height} in its header",
            advice=advice,
        )
    decoded = _decoded(data)
    if decoded is None:
        of_format = "" if stated_format is None else f" of format {stated_format!r}"
        raise ImageError(
            where,
            expected="a whole PNG or JPEG image",
            found=f"{len(data)} bytes{of_format} that cannot be decoded",
            advice=advice,
        )
    return decoded


def _decoded(data: bytes) -> UInt8 | None:
    """Return the image, or None of a damaged one."""
    if data.startswith(PNG_START):
        if not has_whole_chunks(data):
            return None
        plain = decode_rgb_png(data)
        return _by_pillow(data) if plain is None else plain
    if data.startswith(_JPEG_START):
        # Decoders fill up an image that was cut off, so its end is looked for first.
        return _by_pillow(data) if _JPEG_END in data[-1024:] else None
    return _by_opencv(data) if data else None


def _by_pillow(data: bytes) -> UInt8 | None:
    """Decode a JPEG or PNG image of any kind, turned as its Exif orientation says.

    Of channels of 16 bits the upper byte is kept; an alpha channel is left out.
    """
    try:
        with Image.open(io.BytesIO(data), formats=["JPEG", "PNG"]) as file:
            if file.width * file.height > MAX_PIXELS:
                return None
            is_deep = file.mode.startswith(
                "I"
            )  # grey of 16 bits, which Pillow would cut off at 255
            image = Image.fromarray((np.asarray(file) >> 8).astype(np.uint8)) if is_deep else file
            return np.array(ImageOps.exif_transpose(image).convert("RGB"))
    except Exception:
        return None


def _by_opencv(data: bytes) -> UInt8 | None:
    with suppress(cv2.error):  # of sizes beyond OpenCV's own bound
        decoded = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        return None if decoded is None else np.asarray(cv2.cvtColor(decoded, cv2.COLOR_BGR2RGB))
    return None


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
