"""A street between two walls, painted all over, seen by a LiDAR and a camera that drive through it."""

from functools import cache

import cv2
import numpy as np
from scipy import ndimage

from perception.geometry.se3 import from_euler, inverse
from perception.sensor import HDL_64E
from perception.types import Calibration, Frame

SIZE_PX = (621, 188)
IMAGE_P_CAM = np.array([[360.0, 0, 310.0, 0], [0, 360.0, 70.0, 0], [0, 0, 1, 0]])
CAM_SE3_VELO = np.array([[0, -1.0, 0, 0], [0, 0, -1.0, -0.08], [1.0, 0, 0, -0.27], [0, 0, 0, 1.0]])
TRUE = Calibration(IMAGE_P_CAM, CAM_SE3_VELO, SIZE_PX, "street")
# Normals and distances of ground, left wall, right wall and the wall at the end, n . x = d.
PLANES = np.array([[0, 0, 1, -1.7], [0, 1, 0, 6], [0, 1, 0, -7], [1, 0, 0, 60.0]])
_TEXELS_PER_M, _TEXELS = 12, 1024


def pose(travelled_m, turn_rad=0.0):
    return from_euler(0, 0, turn_rad, np.array([travelled_m, 0.002 * travelled_m**2, 0]))


def cast(origin, directions):
    """Return (K, 3) points where rays meet the nearest plane, and its number."""
    with np.errstate(divide="ignore"):
        lengths = (PLANES[:, 3] - PLANES[:, :3] @ origin) / (directions @ PLANES[:, :3].T)
    lengths[lengths <= 0] = np.inf
    nearest = lengths.argmin(axis=1)
    return origin + directions * lengths[np.arange(len(directions)), nearest, None], nearest


def scan(world_SE3_velo):
    azimuths = np.arange(-0.8, 0.8, HDL_64E.azimuth_step_rad)
    azimuth, elevation = (a.ravel() for a in np.meshgrid(azimuths, HDL_64E.elevations_rad))
    directions = (
        np.column_stack([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)])
        @ world_SE3_velo[:3, :3].T
    )
    points, _ = cast(world_SE3_velo[:3, 3], directions)
    velo_SE3_world = inverse(world_SE3_velo)
    points = points @ velo_SE3_world[:3, :3].T + velo_SE3_world[:3, 3]
    return np.column_stack([points, np.full(len(points), 0.3)]).astype(np.float32)


@cache
def textures(seed):
    noise = np.random.default_rng(seed).integers(0, 256, (len(PLANES), _TEXELS, _TEXELS))
    smooth = [cv2.GaussianBlur(one.astype(np.float32), (0, 0), 2.0) for one in noise]
    return [cv2.normalize(one, None, 0, 255, cv2.NORM_MINMAX) for one in smooth]


def image(world_SE3_velo, seed=0):
    """Return the image of the true calibration."""
    world_SE3_cam = world_SE3_velo @ inverse(CAM_SE3_VELO)
    columns, rows = np.meshgrid(*map(np.arange, SIZE_PX))
    pixels = np.stack([columns.ravel(), rows.ravel(), np.ones(columns.size)])
    rays = (world_SE3_cam[:3, :3] @ np.linalg.inv(IMAGE_P_CAM[:, :3]) @ pixels).T
    points, planes = cast(world_SE3_cam[:3, 3], rays)
    grey = np.zeros(len(points), np.float32)
    for number, (normal, texture) in enumerate(zip(PLANES[:, :3], textures(seed), strict=True)):
        of_plane = planes == number
        along = points[of_plane][:, normal == 0] * _TEXELS_PER_M % (_TEXELS - 1)
        grey[of_plane] = ndimage.map_coordinates(texture, along.T, order=1)
    return np.repeat(grey.reshape(SIZE_PX[::-1]).astype(np.uint8)[:, :, None], 3, axis=2)


def drive(count, step_m=0.5, turn_rad=0.0):
    """Return frames at 10 Hz with their poses."""
    frames = []
    for index in range(count):
        world_SE3_velo = pose(index * step_m, index * turn_rad)
        frames.append(
            Frame(
                index, 0.1 * index, scan(world_SE3_velo), image(world_SE3_velo),
                world_SE3_velo=world_SE3_velo, calibration=TRUE,
            )
        )  # fmt: skip
    return frames
