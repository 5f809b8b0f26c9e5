"""What stands around a followed object: what lies where something else stood is not the object."""

from dataclasses import dataclass

import cv2
import numpy as np

from perception.types import Bool, Float64

_CELL_M = 0.15


@dataclass(frozen=True)
class _BackgroundScan:
    """The (N, 2) points in the world that one scan showed beside the object; all, where it was hidden."""

    points_xy_m: Float64
    is_hidden: bool


@dataclass(frozen=True)
class BackgroundModel:
    """The last scans without the object.

    While the object is seen, whatever else is there is something else at once. While it is hidden it
    may be among the rest, and only what stays is something else.

    Attributes:
        scans: newest first.
        recent: how far back what was seen beside the object counts.
        kept: how many scans are kept to see what stays.
        min_hidden: so many scans tell what stays.
        static_share: in this share of them.
    """

    scans: tuple[_BackgroundScan, ...] = ()
    recent: int = 4
    kept: int = 10
    min_hidden: int = 6
    static_share: float = 0.7

    def seen(self, points_xy_m: Float64, *, is_hidden: bool) -> "BackgroundModel":
        """Return the surroundings after one more scan."""
        scans = (_BackgroundScan(points_xy_m, is_hidden), *self.scans)[: self.kept]
        return BackgroundModel(scans, self.recent, self.kept, self.min_hidden, self.static_share)

    def contains(self, points_xy_m: Float64) -> Bool:
        """Tell which (N, 2) points lie where something else stood."""
        if not self.scans or not len(points_xy_m):
            return np.zeros(len(points_xy_m), bool)
        low_m = points_xy_m.min(axis=0) - 2 * _CELL_M
        shape = tuple(np.floor((points_xy_m.max(axis=0) - low_m) / _CELL_M).astype(int) + 3)
        own = np.floor((points_xy_m - low_m) / _CELL_M).astype(np.int64)
        beside = [scan for scan in self.scans[: self.recent] if not scan.is_hidden]
        contains = _count(beside, low_m, shape)[own[:, 0], own[:, 1]] > 0
        hidden = [scan for scan in self.scans if scan.is_hidden]
        if len(hidden) >= self.min_hidden:
            static_counts = _count(hidden, low_m, shape)[own[:, 0], own[:, 1]]
            contains |= static_counts >= self.static_share * len(hidden)
        return np.asarray(contains)


def _count(scans: list[_BackgroundScan], low_m: Float64, shape: tuple[int, ...]) -> Float64:
    """Return in how many scans something was in each cell or beside it."""
    counts = np.zeros(shape)
    for scan in scans:
        cells = np.floor((scan.points_xy_m - low_m) / _CELL_M).astype(np.int64)
        cells = cells[((cells >= 0) & (cells < shape)).all(axis=1)]
        occupied = np.zeros(shape, np.uint8)
        occupied[cells[:, 0], cells[:, 1]] = 1
        counts += cv2.dilate(occupied, np.ones((3, 3), np.uint8))
    return counts
