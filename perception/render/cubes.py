"""Voxels as solid cubes in perspective: the visible cube and face of each pixel.

Every cube is drawn as a square; of several in one pixel the nearest stays. Its visible face is then found by
intersecting the ray of the pixel with the cube.
"""

from dataclasses import dataclass

import numpy as np

from perception.kernels.drawing import faces_of_cubes, splat_cubes
from perception.types import Bool, Float64, Int, UInt8, Voxels

_NO_CUBE = -1


@dataclass(frozen=True)
class CubeImage:
    """What each pixel of an image shows.

    Attributes:
        cubes: (H, W) index of the nearest cube, -1 without one.
        faces: (H, W) visible face of that cube: 0 across x, 1 across y, 2 across z; 0 without one.
    """

    cubes: Int
    faces: UInt8

    @property
    def is_cube(self) -> Bool:
        """(H, W) mask of the pixels that show a cube."""
        return np.asarray(self.cubes != _NO_CUBE)


def render_cubes(image_P_velo: Float64, size_px: tuple[int, int], voxels: Voxels) -> CubeImage:
    """Render cubes into an image of (width, height) pixels; cubes behind the camera are left out."""
    cubes = np.full(size_px[::-1], _NO_CUBE, np.int32)
    faces = np.zeros(size_px[::-1], np.uint8)
    projection = np.ascontiguousarray(image_P_velo, np.float64)
    centers_m = np.ascontiguousarray(voxels.centers_m, np.float32)
    splat_cubes(cubes, projection, centers_m, voxels.size_m)
    faces_of_cubes(faces, cubes, projection, centers_m, voxels.size_m)
    return CubeImage(cubes, faces)
