"""What camera monitors need of a frame: grey levels of a sample of pixels, how sharp each part is, and what is near there."""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import cv2
import numpy as np

from perception.geometry.camera import project
from perception.geometry.se3 import transform_points
from perception.types import Calibration, Float32, Float64, Frame, UInt8

_STEP_PX = 4
_GRID = (6, 16)  # cells, down and across
_WIDTH_PX = 1242  # width of an image, at which the steps below are as they stand
_FINE_PX, _COARSE_PX = 2, 8
_GREEN = 1
_SAMPLED_RETURNS = 5_000
_NEAREST_M, _MAX_BELOW_CAMERA_M = 0.5, 1.2  # a camera is higher above the road
_LOW, _HIGH = 0.005, 0.995


@dataclass(frozen=True)
class ImageStatistics:
    """Statistics of one image.

    Attributes:
        sample: (h, w) every fourth pixel of every fourth row, green.
        low: Grey level that one pixel in 200 is below.
        median: Median grey level.
        high: Grey level that one pixel in 200 is above.
        fine: (6, 16) mean difference of neighbouring pixels in each cell, in grey levels.
        coarse: (6, 16) mean difference of pixels four times as far apart.
        mean: (6, 16) mean grey level of each cell.
    """

    sample: UInt8
    low: float
    median: float
    high: float
    fine: Float32
    coarse: Float32
    mean: Float32

    @classmethod
    def of(cls, image: UInt8) -> Self:
        """Measure an (H, W, 3) image."""
        rows = np.asarray(cv2.extractChannel(image[::_STEP_PX], _GREEN), np.uint8)
        sample = np.ascontiguousarray(rows[:, ::_STEP_PX])
        counts = cv2.calcHist([sample], [0], None, [256], [0, 256]).ravel()
        shares = np.cumsum(counts, dtype=np.float64) / sample.size
        low, median, high = np.searchsorted(shares, (_LOW, 0.5, _HIGH))
        scale = max(1, round(image.shape[1] / _WIDTH_PX))
        fine_px, coarse_px = scale * _FINE_PX, scale * _COARSE_PX
        ends = rows[:, :-coarse_px]
        fine = _differences(rows[:, fine_px : fine_px - coarse_px], ends)
        coarse = _differences(rows[:, coarse_px:], ends)
        return cls(
            sample,
            float(low),
            float(median),
            float(high),
            fine=_cells(fine),
            coarse=_cells(coarse),
            mean=_cells(sample),
        )


@dataclass(frozen=True)
class SampledReturns:
    """A sample of a scan; its depths in the image are computed when they are needed.

    Attributes:
        points_velo: (P, 3) points.
        calibration: Calibration of the camera, or None.
        width_px: Width of the image, 0 without one.
    """

    points_velo: Float32
    calibration: Calibration | None
    width_px: int

    @classmethod
    def of(cls, frame: Frame) -> Self:
        """Sample the scan of a frame."""
        step = max(len(frame.points_velo) // _SAMPLED_RETURNS, 1)
        width_px = 0 if frame.image is None else frame.image.shape[1]
        return cls(frame.points_velo[::step, :3].copy(), frame.calibration, width_px)

    @cached_property
    def nearest_m(self) -> Float64:
        """(16,) depths of the nearest returns above the ground in the columns of cells.

        Columns without a return, and all without a calibration or an image, are infinitely far.
        """
        nearest_m = np.full(_GRID[1], np.inf)
        if self.calibration is None or not self.width_px:
            return nearest_m
        in_camera = transform_points(
            self.calibration.cam_SE3_velo, self.points_velo.astype(np.float64)
        )
        is_near = (in_camera[:, 2] > _NEAREST_M) & (in_camera[:, 1] < _MAX_BELOW_CAMERA_M)
        pixels, depths_m = project(self.calibration.image_P_cam, in_camera[is_near])
        columns = np.floor(pixels[:, 0] * _GRID[1] / self.width_px)
        is_inside = (columns >= 0) & (columns < _GRID[1])
        np.minimum.at(nearest_m, columns[is_inside].astype(np.int64), depths_m[is_inside])
        return nearest_m


def _differences(ends: UInt8, starts: UInt8) -> UInt8:
    # OpenCV has none of an image that is narrower than a step.
    return np.asarray(cv2.absdiff(ends, starts), np.uint8) if starts.size else starts


def _cells(values: UInt8) -> Float32:
    """Return the mean of each cell of the grid; rows and columns beyond whole cells are left out."""
    down, across = _GRID
    height, width = max(values.shape[0] // down, 1), max(values.shape[1] // across, 1)
    whole = values[: height * down, : width * across]
    if whole.shape != (height * down, width * across):  # an image smaller than the grid
        return np.zeros(_GRID, np.float32)
    # Sums of whole numbers, as a copy in floats is memory that is new to the process, which costs more than the arithmetic.
    of_bands = np.add.reduce(whole.reshape(down, height, -1), axis=1, dtype=np.uint32)
    sums = np.add.reduce(of_bands.reshape(down, across, width), axis=2)
    return np.asarray(sums / (height * width), np.float32)
