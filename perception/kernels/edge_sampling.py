"""Values and slopes of maps between their pixels, of many places in maps of several frames at once."""

import numpy as np

from perception.kernels.compiled import array_of, compiled
from perception.types import Float32, Float64, Int


@compiled((array_of(np.float32, 3), array_of(np.int64), array_of(np.float64), array_of(np.float64)))
def sample_maps(maps: Float32, frames: Int, columns: Float64, rows: Float64) -> Float64:
    """Return (3, K) values between four pixels, and their slopes along columns and rows.

    A place outside its map takes the value at the border, without a slope across it.

    Args:
        maps: (F, H, W) one map a frame, H and W at least 2.
        frames: (K,) frame of each place.
        columns: (K,) columns in pixels; NaN is taken for a place outside.
        rows: (K,) rows in pixels.
    """
    last_row, last_column = maps.shape[1] - 1, maps.shape[2] - 1
    sampled = np.zeros((3, len(frames)), np.float64)
    for k in range(len(frames)):
        u, v = columns[k], rows[k]
        is_beside = u >= 0 and u <= last_column
        is_between = v >= 0 and v <= last_row
        # The comparisons are false with NaN.
        u = min(u, np.float64(last_column)) if u > 0 else np.float64(0)
        v = min(v, np.float64(last_row)) if v > 0 else np.float64(0)
        j, i = min(int(u), last_column - 1), min(int(v), last_row - 1)
        right, down, frame = u - j, v - i, frames[k]
        top_left, top_right = np.float64(maps[frame, i, j]), np.float64(maps[frame, i, j + 1])
        low_left, low_right = (
            np.float64(maps[frame, i + 1, j]),
            np.float64(maps[frame, i + 1, j + 1]),
        )
        top = top_left + right * (top_right - top_left)
        low = low_left + right * (low_right - low_left)
        sampled[0, k] = top + down * (low - top)
        if is_beside:
            along_top, along_low = top_right - top_left, low_right - low_left
            sampled[1, k] = along_top + down * (along_low - along_top)
        if is_between:
            sampled[2, k] = low - top
    return sampled
