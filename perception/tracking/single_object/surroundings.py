"""What stood around a followed object a moment ago: what stands there still is not the object."""

from dataclasses import dataclass

import cv2
import numpy as np

from perception.types import Bool, Float64

_CELL_M = 0.15


@dataclass(frozen=True)
class Surroundings:
    """The points of the last few scans that were not the object's.

    Attributes:
        points_xy_m: of each scan (N, 2) in the world, newest first.
        scans: how many are kept.
    """

    points_xy_m: tuple[Float64, ...] = ()
    scans: int = 4

    def seen(self, points_xy_m: Float64) -> "Surroundings":
        """Return the surroundings after one more scan."""
        return Surroundings((points_xy_m, *self.points_xy_m)[: self.scans], self.scans)

    def hold(self, points_xy_m: Float64) -> Bool:
        """Tell which (N, 2) points lie where something else stood."""
        if not self.points_xy_m or not len(points_xy_m):
            return np.zeros(len(points_xy_m), bool)
        low_m = points_xy_m.min(axis=0) - 2 * _CELL_M
        shape = np.floor((points_xy_m.max(axis=0) - low_m) / _CELL_M).astype(np.int64) + 3
        stood = np.zeros(shape, np.uint8)
        cells = np.floor((np.concatenate(self.points_xy_m) - low_m) / _CELL_M).astype(np.int64)
        cells = cells[((cells >= 0) & (cells < shape)).all(axis=1)]
        stood[cells[:, 0], cells[:, 1]] = 1
        wide = cv2.dilate(stood, np.ones((3, 3), np.uint8))
        own = np.floor((points_xy_m - low_m) / _CELL_M).astype(np.int64)
        return np.asarray(wide[own[:, 0], own[:, 1]] > 0)
