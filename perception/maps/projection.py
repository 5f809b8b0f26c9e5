"""Projection of the scan into the image: pixel, depth and reflectance of each return (6.1)."""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np

from perception.kernels.cropping import rows_within_planes
from perception.kernels.map_filling import project_nearest
from perception.types import SHARED, ArrayTable, Bool, Calibration, Float32, Float64, Frame, Int

# Nearer returns are those of the vehicle itself.
_NEAREST_M = 0.5
# Camera for which maps are made where a drive has none: it looks ahead, with the image, the field of view (81 x 29
# degrees) and the place beside the LiDAR of the camera that the networks of this package were trained for.
VIRTUAL_CAMERA = Calibration(
    image_P_cam=np.array([[721.5, 0, 609.5, 0], [0, 721.5, 172.9, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0, -1, 0, 0], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]]),
    image_size_px=(1242, 375),
    source="virtual camera",
)


@dataclass(frozen=True)
class SparseMaps(ArrayTable):
    """N returns in an image, at most one a pixel, the farthest first.

    Attributes:
        pixels: (N, 2) column and row.
        depth_m: (N,) along the optical axis, above zero.
        reflectance: (N,) from 0 to 1.
        size_px: (width, height) of the image.
    """

    pixels: Annotated[Int, 2]
    depth_m: Float32
    reflectance: Float32
    size_px: Annotated[tuple[int, int], SHARED]

    @cached_property
    def flat_indices(self) -> Int:
        """(N,) row * width + column."""
        return _flat_indices(self.pixels, self.size_px)

    def scattered(self, values: Float32) -> Float32:
        """Return (N,) values in an (H, W) map, 0 where there is no return."""
        dense = np.zeros(self.size_px[::-1], np.float32)
        dense[self.pixels[:, 1], self.pixels[:, 0]] = values
        return dense

    @property
    def is_measured(self) -> Bool:
        """(H, W) which pixels hold a return."""
        measured: Bool = np.zeros(self.size_px[::-1], bool)
        measured[self.pixels[:, 1], self.pixels[:, 0]] = True
        return measured


def project_scan(
    points_velo: Float32, calibration: Calibration, size_px: tuple[int, int]
) -> SparseMaps:
    """Project (N, 4) points into an image of (width, height); the nearest wins a pixel."""
    points = np.ascontiguousarray(points_velo, np.float32)
    image_P_velo = np.ascontiguousarray(calibration.image_P_velo, np.float64)
    pixels, depth_m, reflectance = project_nearest(points, image_P_velo, *size_px, _NEAREST_M)
    return SparseMaps(pixels.T, depth_m, reflectance, size_px)


def project_frame(frame: Frame) -> SparseMaps:
    """Project the scan of a frame into the image of its camera, or of the virtual camera where it has none."""
    return project_scan(frame.points_velo, *camera_of(frame))


def camera_of(frame: Frame) -> tuple[Calibration, tuple[int, int]]:
    """Return the calibration of the camera that a frame's maps are made for, and (width, height) of its image.

    A frame without a calibration has the virtual camera. Where neither image nor calibration states the size of the
    image, the principal point is assumed to be its middle.
    """
    calibration = frame.calibration or VIRTUAL_CAMERA
    size_px = calibration.image_size_px
    if frame.calibration is not None and frame.image is not None:
        size_px = frame.image.shape[1], frame.image.shape[0]
    if size_px is None:
        column, row = calibration.image_P_cam[:2, 2]
        size_px = max(1, round(2 * column)), max(1, round(2 * row))
    return calibration, size_px


def rows_near_view(points_velo: Float32, image_P_velo: Float64, size_px: tuple[int, int]) -> Int:
    """Return the indices of the returns in view, found in single precision and with a margin of one pixel.

    A revolution of the LiDAR has six times the returns that are in the image; only those are projected.
    """
    # A point is in view if it lies on the inner side of the four planes through the image's edges:
    # with depth * (u, v, 1) = P p, u > -1 is the same as depth * u + depth > 0.
    width, height = size_px
    inner = np.array([[1, 0, 1], [-1, 0, width], [0, 1, 1], [0, -1, height]]) @ image_P_velo
    # Points without a return lie at the origin, which a camera behind the LiDAR has in view: they are left out.
    points = np.ascontiguousarray(points_velo, np.float32)
    return rows_within_planes(points, inner.astype(np.float32))


def _flat_indices(pixels: Int, size_px: tuple[int, int]) -> Int:
    """Return row * width + column of (N, 2) pixels."""
    return np.asarray(pixels[:, 1] * np.int32(size_px[0]) + pixels[:, 0], np.intp)
