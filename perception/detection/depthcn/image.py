"""Input image of the verifier: depth, height above the road and reflectance as three 8-bit channels.

     channel 0            channel 1               channel 2
depth, near 0, 80 m 255   height, see below    reflectance 0..1 as 0..255      0: unknown
     (6.2)                                            (B.2.1)
"""

import numpy as np

from perception.kernels.crops import encode_heights
from perception.maps.densify import DenseMaps
from perception.types import Float64, UInt8

CHANNELS = ("depth", "height", "reflectance")
# From below the road to above a lorry, encoded as 1 to 255; 0 is unknown.
_LOWEST_M, _HIGHEST_M = -1.0, 4.0
_HIGHEST = 254  # steps between these two


def encode_channels(dense: DenseMaps, image_P_velo: Float64, lidar_height_m: float) -> UInt8:
    """Return the (H, W, 3) image with the channels of `CHANNELS`.

    Args:
        dense: Dense depth and reflectance maps.
        image_P_velo: (3, 4) projection of the maps from the LiDAR frame.
        lidar_height_m: Height of the LiDAR's origin above the road in metres.
    """
    steps_per_m = _HIGHEST / (_HIGHEST_M - _LOWEST_M)
    row_m, column_m, offset_m = _heights_by_depth(dense.depth_m.shape, image_P_velo)
    planes: UInt8 = np.empty((len(CHANNELS), *dense.depth_m.shape), np.uint8)
    planes[0] = dense.depth_image
    encode_heights(
        np.ascontiguousarray(dense.depth_m),
        (steps_per_m * row_m).astype(np.float32),
        (steps_per_m * column_m).astype(np.float32),
        1 + steps_per_m * (offset_m + lidar_height_m - _LOWEST_M),
        planes[1],
    )
    # Unknown depths and reflectances are 0, and so are their numbers.
    planes[1] *= dense.is_valid
    planes[2] = dense.reflectance_image
    return planes.transpose(1, 2, 0)


def _heights_by_depth(
    shape: tuple[int, ...], image_P_velo: Float64
) -> tuple[Float64, Float64, float]:
    """Return (H,) and (W,) heights above the LiDAR for each metre of depth, whose sum is a pixel's, and the height at depth 0.

    depth * (u, v, 1) = P p + t, hence z = depth * (r . (u, v, 1)) - r . t with r the last row of the
    inverse of P.
    """
    row = np.linalg.inv(image_P_velo[:, :3])[2]
    v, u = np.arange(shape[0]), np.arange(shape[1])
    return row[1] * v + row[2], row[0] * u, -float(row @ image_P_velo[:, 3])
