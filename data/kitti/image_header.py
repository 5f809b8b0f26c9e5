"""The size that a PNG or JPEG image states, read without decoding it: a small file may state a huge one."""

import struct

# 8192 x 8192, four times the pixels of the largest cameras of vehicles; 200 MB as RGB.
MAX_PIXELS = 1 << 26

PNG_START = b"\x89PNG\r\n\x1a\n"
_JPEG = b"\xff\xd8"
# Frame headers, which state the size; the other codes of this range are tables.
_FRAMES = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}
# Markers without a length.
_BARE = {0x01, *range(0xD0, 0xDA)}


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
