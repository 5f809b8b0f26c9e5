"""Voxels as solid cubes in perspective: the visible cube and face of each pixel.

Every cube is splatted as a square, far to near, so that the nearest stays on top. The visible face of a
pixel is then found by intersecting its ray with that cube. The loop runs over a few dozen cube sizes in
pixels, never over cubes.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from perception.geometry.camera import project
from perception.render.canvas import is_inside
from perception.types import Float32, Float64, Int, UInt8, Voxels

_NO_CUBE = -1
_NEAREST_M = 0.6
# A cube at an angle is broader than its edge; a full diagonal would hide the cubes behind it.
_SPREAD = 1.2
# Rays are cached for this number of image rows, or a multiple.
_ROWS = 64


@dataclass(frozen=True)
class CubeImage:
    """Pixels of an image that show a cube, in row-major order.

    Attributes:
        pixels: (K,) indices of the pixels in the flattened image.
        cubes: (K,) indices of the nearest cubes.
        faces: (K,) visible faces: 0 across x, 1 across y, 2 across z.
    """

    pixels: Int
    cubes: Int
    faces: UInt8


def render_cubes(image_P_velo: Float64, size_px: tuple[int, int], voxels: Voxels) -> CubeImage:
    """Render cubes into an image of (width, height) pixels; cubes behind the camera are left out."""
    canvas = _splat(image_P_velo, size_px, voxels)
    pixels = np.flatnonzero(canvas != _NO_CUBE)
    cubes = canvas.reshape(-1)[pixels]
    return CubeImage(pixels, cubes, _faces(image_P_velo, size_px[0], voxels, pixels, cubes))


def _splat(image_P_velo: Float64, size_px: tuple[int, int], voxels: Voxels) -> Int:
    width, height = size_px
    pixels, depth_m = project(image_P_velo, voxels.centers_m)
    focal_px = np.linalg.norm(np.cross(image_P_velo[0, :3], image_P_velo[2, :3]))
    focal_px /= np.linalg.norm(image_P_velo[2, :3])
    edge_px = _SPREAD * focal_px * voxels.size_m / np.maximum(depth_m, _NEAREST_M)
    edge_px = np.maximum(np.rint(edge_px), 1).astype(np.int64)
    visible = is_inside(pixels, size_px, edge_px // 2) & (depth_m > _NEAREST_M)
    number = np.flatnonzero(visible)
    number = number[np.argsort(-depth_m[number], kind="stable")]
    # A border as broad as the largest cube makes clipping unnecessary.
    border = int(edge_px[number].max(initial=1)) + 1
    canvas = np.full((height + 2 * border, width + 2 * border), _NO_CUBE, np.int32)
    corner = np.rint(pixels[number] - (edge_px[number, None] - 1) / 2).astype(np.int64) + border
    _fill_squares(canvas, corner[:, 1] * canvas.shape[1] + corner[:, 0], edge_px[number], number)
    return np.ascontiguousarray(canvas[border : border + height, border : border + width])


def _fill_squares(canvas: Int, first: Int, edge_px: Int, number: Int) -> None:
    """Write numbers into squares, ordered far to near: edges in pixels then never decrease."""
    flat, stride = canvas.reshape(-1), canvas.shape[1]
    edges, starts = np.unique(edge_px, return_index=True)
    stops = np.append(starts, len(number))[1:]
    for edge, start, stop in zip(edges, starts, stops, strict=True):
        square = (np.arange(edge)[:, None] * stride + np.arange(edge)).ravel()
        # Where squares overlap, NumPy keeps the value assigned last, the nearest.
        flat[(first[start:stop, None] + square).ravel()] = np.repeat(
            number[start:stop], edge * edge
        )


def _faces(image_P_velo: Float64, width: int, voxels: Voxels, pixels: Int, cubes: Int) -> UInt8:
    """Find the face through which each pixel's ray enters its cube."""
    camera_m = -np.linalg.inv(image_P_velo[:, :3]) @ image_P_velo[:, 3]
    last_row = int(pixels[-1]) // width if len(pixels) else 0
    slower = _slowness(image_P_velo.tobytes(), width, last_row // _ROWS + 1).take(pixels, axis=1)
    from_camera = np.ascontiguousarray((voxels.centers_m - camera_m).T, np.float32)
    # A ray enters a slab half an edge before its middle, and the cube with its last slab.
    enters = from_camera.take(cubes, axis=1) * slower - np.abs(slower) * np.float32(
        voxels.size_m / 2
    )
    face: UInt8 = (enters[1] > enters[0]).astype(np.uint8)
    face[enters[2] > np.maximum(enters[0], enters[1])] = 2
    return face


@lru_cache(maxsize=4)
def _slowness(projection: bytes, width: int, row_blocks: int) -> Float32:
    """Return the (3, pixels) reciprocal direction of each pixel's ray; cached, since a drive has few cameras.

    Args:
        projection: Bytes of the (3, 4) projection in double precision.
        width: Width of the image in pixels.
        row_blocks: Number of blocks of rows from the top.
    """
    image_P_velo = np.frombuffer(projection).reshape(3, 4)
    velo_R_image = np.linalg.inv(image_P_velo[:, :3]).astype(np.float32)
    v, u = np.mgrid[: row_blocks * _ROWS, :width].astype(np.float32).reshape(2, -1)
    rays = velo_R_image @ np.stack([u, v, np.ones_like(u)])
    rays[np.abs(rays) < 1e-9] = 1e-9
    return np.asarray(1 / rays, np.float32)
