"""Rows of PNG images, from their differences to what is left and above (PNG specification, third edition, 9)."""

import numpy as np

from perception.kernels.compiled import WHOLE, array_of, compiled, written
from perception.types import UInt8

_CHANNELS = 3
_NONE, _LEFT, _ABOVE, _MEAN, _NEAREST = range(5)


@compiled((array_of(np.uint8, 2), written(np.uint8, 2)))
def restore_rows(filtered: UInt8, rows: UInt8) -> bool:
    """Restore the rows of an image of three channels of 8 bits.

    Args:
        filtered: (H, 1 + 3 W) kind of the differences of each row, and these.
        rows: (H, 3 W) rows that are written.

    Returns:
        Whether all kinds are known; else the image is damaged.
    """
    count = rows.shape[1]
    above = np.zeros(count, np.uint8)
    for number in range(len(rows)):
        kind, differences, row = filtered[number, 0], filtered[number, 1:], rows[number]
        if kind == _NONE:
            row[:] = differences
        elif kind == _LEFT:
            row[:_CHANNELS] = differences[:_CHANNELS]
            for i in range(_CHANNELS, count):
                row[i] = differences[i] + row[i - _CHANNELS]
        elif kind == _ABOVE:
            for i in range(count):
                row[i] = differences[i] + above[i]
        elif kind == _MEAN:
            for i in range(count):
                left = np.int64(row[i - _CHANNELS]) if i >= _CHANNELS else 0
                row[i] = differences[i] + (left + np.int64(above[i])) // 2
        elif kind == _NEAREST:
            _restore_nearest(differences, above, row)
        else:
            return False
        above = row
    return True


@compiled((WHOLE, WHOLE, WHOLE))
def _nearest(left: int, upper: int, corner: int) -> int:
    """Return which of three is nearest to left + upper - corner, the first of equals (Paeth)."""
    to_left, to_upper = upper - corner, left - corner
    to_corner = abs(to_left + to_upper)
    to_left, to_upper = abs(to_left), abs(to_upper)
    nearest = upper if to_upper <= to_corner else corner
    return left if to_left <= to_upper and to_left <= to_corner else nearest


@compiled((array_of(np.uint8), array_of(np.uint8), written(np.uint8)))
def _restore_nearest(differences: UInt8, above: UInt8, row: UInt8) -> None:
    """Restore the differences to one of the left, upper and upper left values."""
    # Three chains side by side: each value waits for the one to its left.
    red = green = blue = 0
    red_corner = green_corner = blue_corner = 0
    for i in range(0, len(row), _CHANNELS):
        red_above, green_above, blue_above = int(above[i]), int(above[i + 1]), int(above[i + 2])
        red = (int(differences[i]) + _nearest(red, red_above, red_corner)) & 255
        green = (int(differences[i + 1]) + _nearest(green, green_above, green_corner)) & 255
        blue = (int(differences[i + 2]) + _nearest(blue, blue_above, blue_corner)) & 255
        red_corner, green_corner, blue_corner = red_above, green_above, blue_above
        row[i], row[i + 1], row[i + 2] = red, green, blue
