"""Input image of the verifier: depth, height above the road and reflectance as three 8-bit channels.

     channel 0            channel 1               channel 2
depth, near 0, 80 m 255   height, see below    reflectance 0..1 as 0..255      0: unknown
     (6.2)                                            (B.2.1)
"""

import cv2
import numpy as np

from perception.maps.densify import DenseMaps
from perception.maps.encoding import encode_depth, encode_reflectance
from perception.types import Float64, UInt8

CHANNELS = ("depth", "height", "reflectance")
# From below the road to above a lorry, encoded as 1 to 255; 0 is unknown.
_LOWEST_M, _HIGHEST_M = -1.0, 4.0


def encode_channels(dense: DenseMaps, image_P_velo: Float64, lidar_height_m: float) -> UInt8:
    """Return the (H, W, 3) image with the channels of `CHANNELS`.

    Args:
        dense: Dense depth and reflectance maps.
        image_P_velo: (3, 4) projection of the maps from the LiDAR frame.
        lidar_height_m: Height of the LiDAR's origin above the road in metres.
    """
    height_m = heights_m(dense.depth_m, image_P_velo, lidar_height_m)
    scale = 254 / (_HIGHEST_M - _LOWEST_M)
    clipped = np.clip(height_m, _LOWEST_M, _HIGHEST_M)
    height = cv2.convertScaleAbs(clipped, alpha=scale, beta=1 - scale * _LOWEST_M)
    channels = (encode_depth(dense.depth_m), height, encode_reflectance(dense.reflectance))
    is_valid = dense.is_valid
    return np.asarray(cv2.merge([channel * is_valid for channel in channels]), np.uint8)


def heights_m(depth_m: np.ndarray, image_P_velo: Float64, lidar_height_m: float) -> np.ndarray:
    """Return the (H, W) heights above the road of the points at a depth along each pixel's ray.

    depth * (u, v, 1) = P p + t, hence z = depth * (r . (u, v, 1)) - r . t with r the last row of the
    inverse of P.
    """
    row = np.linalg.inv(image_P_velo[:, :3])[2]
    v, u = np.arange(depth_m.shape[0]), np.arange(depth_m.shape[1])
    of_ray = (row[1] * v + row[2])[:, None].astype(np.float32) + (row[0] * u).astype(np.float32)
    offset_m = np.float32(lidar_height_m - row @ image_P_velo[:, 3])
    return np.asarray(depth_m * of_ray + offset_m, np.float32)
