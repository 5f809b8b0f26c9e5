"""The image of DepthCN's network, and crops of its upright windows."""

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled, written
from perception.types import Float32, Float64, Int, UInt8

_BYTE, _SINGLE = np.uint8, np.float32


@compiled((array_of(_SINGLE, 2), array_of(_SINGLE), array_of(_SINGLE), _SINGLE, written(_BYTE, 2)))
def encode_heights(
    depth_m: Float32, row_slopes: Float32, column_slopes: Float32, offset: float, heights: UInt8
) -> None:
    """Fill a map with the heights of its pixels as 8-bit numbers from 1 to 255.

    Args:
        depth_m: (H, W) depths in metres.
        row_slopes: (H,) steps of the encoding for each metre of depth in a row.
        column_slopes: (W,) steps for each metre of depth beyond these in a column.
        offset: Encoded height at depth 0.
        heights: (H, W) map that is written.
    """
    for row in range(len(row_slopes)):
        for column in range(len(column_slopes)):
            depth = depth_m[row, column]
            height = depth * (row_slopes[row] + column_slopes[column]) + offset
            height = min(max(height, np.float32(1)), np.float32(255))
            heights[row, column] = np.uint8(np.rint(height))


@compiled((NUMBER, NUMBER, WHOLE, WHOLE))
def nearest_places(start: float, step: float, count: int, length: int) -> Int:
    """Return the (count,) pixels nearest to places a step apart, -1 beyond the length of the image."""
    places = np.empty(count, np.int64)
    for number in range(count):
        place = np.rint(start + step * number)
        places[number] = np.int64(place) if 0 <= place < length else -1
    return places


@compiled((array_of(_BYTE, 3), array_of(NUMBER, 3), written(_BYTE, 4)))
def crop_nearest(planes: UInt8, image_A_crops: Float64, crops: UInt8) -> None:
    """Fill crops with the nearest pixels of an image, 0 beyond its edges.

    Args:
        planes: (C, H, W) planes of the image.
        image_A_crops: (M, 3, 3) affine maps from each crop to the image, which do not turn it.
        crops: (M, C, h, w) crops that are written.
    """
    for number in range(len(crops)):
        image_A_crop, shape = image_A_crops[number], crops.shape
        columns = nearest_places(image_A_crop[0, 2], image_A_crop[0, 0], shape[3], planes.shape[2])
        rows = nearest_places(image_A_crop[1, 2], image_A_crop[1, 1], shape[2], planes.shape[1])
        for channel in range(shape[1]):
            for v in range(shape[2]):
                if rows[v] < 0:
                    crops[number, channel, v] = 0
                    continue
                line = planes[channel, rows[v]]
                for u in range(shape[3]):
                    column = columns[u]
                    crops[number, channel, v, u] = line[column] if column >= 0 else 0
