"""The last few scans, each with its refined pose, and their union in the newest one's frame (5.1)."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from perception.geometry.grids import LocalArea
from perception.geometry.se3 import inverse, transform_points
from perception.types import Float32, Float64, UInt8


@dataclass(frozen=True)
class PosedScan:
    """One scan and its pose.

    Attributes:
        points_velo: (N, 4) points in the frame of the scan.
        world_SE3_velo: (4, 4) refined pose.
        covariance: (6, 6) covariance of the pose beside those of the scans before, position in m and rotation vector in
            rad along the axes of the world.
        stamp_s: Time of the scan in seconds, for what asks how old it is.
    """

    points_velo: Float32
    world_SE3_velo: Float64
    covariance: Float64 = field(default_factory=lambda: np.zeros((6, 6)))
    stamp_s: float = 0.0


class ScanWindow:
    """The newest scan and at most m before it, oldest first."""

    def __init__(self, previous_scans: int) -> None:
        self._scans: deque[PosedScan] = deque(maxlen=previous_scans + 1)

    def push(self, scan: PosedScan) -> None:
        """Add the newest scan; the oldest drops out of a full window."""
        self._scans.append(scan)

    def pop(self) -> None:
        """Remove the newest scan."""
        self._scans.pop()

    def clear(self) -> None:
        """Remove all scans, as after a gap in the drive."""
        self._scans.clear()

    @property
    def newest(self) -> PosedScan:
        """The scan pushed last."""
        return self._scans[-1]

    def __len__(self) -> int:
        return len(self._scans)

    def __iter__(self) -> Iterator[PosedScan]:
        return iter(self._scans)


@dataclass(frozen=True)
class DenseCloud:
    """The scans of a window as one cloud.

    Attributes:
        points_velo: (K, 4) points in the newest scan's frame.
        age: (K,) number of scans from the point's scan to the newest.
    """

    points_velo: Float32
    age: UInt8


def merge(window: ScanWindow, area: LocalArea, margin_m: float = 0.0) -> DenseCloud:
    """Move every scan into the newest one's frame and keep the points over the area (5.1).

    Points are cropped after the move: distant points of an old scan may lie in the area now.
    """
    newest_SE3_world = inverse(window.newest.world_SE3_velo)
    clouds, ages = [], []
    for age, scan in enumerate(reversed(list(window))):
        # The newest scan is in its own frame already.
        points = scan.points_velo if age == 0 else _moved(scan, newest_SE3_world)
        inside = np.flatnonzero(area.contains_xy(points, margin_m))
        clouds.append(points.take(inside, axis=0))
        ages.append(np.full(len(inside), age, np.uint8))
    return DenseCloud(np.concatenate(clouds), np.concatenate(ages))


def _moved(scan: PosedScan, dst_SE3_world: Float64) -> Float32:
    return transform_points(dst_SE3_world @ scan.world_SE3_velo, scan.points_velo)
