"""What LiDAR monitors need of a scan: in which directions it has returns, and which of them are alone."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from perception.kernels.range_images import nearest_returns
from perception.obstacles.range_image import SphericalProjection
from perception.sensor import LidarModel
from perception.types import Bool, Float32, Float64, Int, UInt8

COLUMNS = 360  # a degree each
SECTORS = 72
_NEAR_M = 20.0
_FAR_M = 100.0  # of a direction without a return
# A return is alone where it is nearer than all four beside it by this share and distance.
_ALONE_RATIO, _ALONE_M = 1.3, 1.0
_BESIDE = np.array([[0, 1, 0], [1, 0, 1], [0, 1, 0]], np.uint8)
# Beams below it hit the road within some ten metres, whatever is around.
_DOWN_RAD = np.radians(-3.3)


@dataclass(frozen=True)
class ScanStatistics:
    """Statistics of one scan; a direction is a beam within a degree of azimuth.

    Attributes:
        beams: (L,) share of the directions of each beam with a return.
        sectors: (72,) share of the directions below the horizon with a return, in sectors of five degrees.
        alone: Share of all directions with a return that is near and alone.
    """

    beams: Float64
    sectors: Float64
    alone: float

    @property
    def returns(self) -> float:
        """Share of all directions with a return."""
        return float(self.beams.mean())


class ScanMeter:
    """Measures the scans of one LiDAR."""

    def __init__(self, sensor: LidarModel) -> None:
        # Range images have two firings a column.
        wide = replace(sensor, azimuth_step_rad=np.pi / COLUMNS)
        self._projection = SphericalProjection(wide, tolerance_m=1.0)
        is_down: Bool = sensor.elevations_rad < _DOWN_RAD
        self._down = is_down if is_down.any() else np.ones_like(is_down)

    def measure(self, points_velo: Float32) -> ScanStatistics:
        """Measure a scan of (N, 4) points."""
        points = np.ascontiguousarray(points_velo, np.float32)
        ranges_m = nearest_returns(points, *self._projection.numbers, self._projection.rows)
        has_return = (ranges_m < np.inf).view(np.uint8)
        of_beams = _sum(has_return, axis=1) / has_return.shape[1]
        of_columns = _sum(has_return[self._down], axis=0) / np.count_nonzero(self._down)
        of_sectors = of_columns.reshape(SECTORS, -1).mean(axis=1)
        return ScanStatistics(of_beams, of_sectors, _share_alone(ranges_m))


def _sum(values: UInt8, axis: int) -> Int:
    # OpenCV, as NumPy takes ten times as long over bytes.
    return np.asarray(cv2.reduce(values, axis, cv2.REDUCE_SUM, dtype=cv2.CV_32S), np.int32).ravel()


def _share_alone(ranges_m: Float32) -> float:
    """Return the share of the directions whose return is near, and nearer than those above, below and beside."""
    near_m = cv2.min(ranges_m, np.array(_FAR_M))
    # The first and the last beam are their own neighbours, and so never alone.
    framed = cv2.copyMakeBorder(near_m, 1, 1, 0, 0, cv2.BORDER_REPLICATE)
    framed = np.asarray(cv2.copyMakeBorder(framed, 0, 0, 1, 1, cv2.BORDER_WRAP), np.float32)
    nearest_m = np.asarray(cv2.erode(framed, _BESIDE), np.float32)
    limit_m = np.float32(_ALONE_RATIO) * framed + np.float32(_ALONE_M)
    is_alone = (framed < _NEAR_M) & (nearest_m > limit_m)
    return np.count_nonzero(is_alone[1:-1, 1:-1]) / ranges_m.size
