"""The last few scans, each with its refined pose, and their union in the newest one's frame (5.1)."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from perception.geometry.grids import LocalArea
from perception.geometry.se3 import inverse, transform_points
from perception.localization.alignment import align, preprocess_points
from perception.types import Float32, Float64, UInt8


@dataclass(frozen=True)
class PosedScan:
    """One scan and where it was taken.

    Attributes:
        points_velo: (N, 4) in the scan's own frame.
        world_SE3_velo: (4, 4) refined pose.
    """

    points_velo: Float32
    world_SE3_velo: Float64


class ScanWindow:
    """The newest scan and at most m before it, oldest first."""

    def __init__(self, previous_scans: int) -> None:
        self._scans: deque[PosedScan] = deque(maxlen=previous_scans + 1)

    def push(self, scan: PosedScan) -> None:
        """Add the newest scan; the oldest falls out of a full window."""
        self._scans.append(scan)

    def pop(self) -> None:
        """Take the newest scan back."""
        self._scans.pop()

    def clear(self) -> None:
        """Forget all scans, as after a gap in the drive."""
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
        points_velo: (K, 4) in the newest scan's frame.
        age: (K,) how many scans before the newest each point was taken.
    """

    points_velo: Float32
    age: UInt8


def merge(window: ScanWindow, area: LocalArea, margin_m: float = 0.0) -> DenseCloud:
    """Move every scan into the newest one's frame and keep what lies over the area (5.1).

    The crop comes after the move: what an old scan saw far off may lie in the area now.
    """
    newest_SE3_world = inverse(window.newest.world_SE3_velo)
    clouds, ages = [], []
    for age, scan in enumerate(reversed(list(window))):
        # The newest scan is where it should be already.
        points = scan.points_velo if age == 0 else _moved(scan, newest_SE3_world)
        inside = np.flatnonzero(area.contains_xy(points, margin_m))
        clouds.append(points.take(inside, axis=0))
        ages.append(np.full(len(inside), age, np.uint8))
    return DenseCloud(np.concatenate(clouds), np.concatenate(ages))


def _moved(scan: PosedScan, dst_SE3_world: Float64) -> Float32:
    return transform_points(dst_SE3_world @ scan.world_SE3_velo, scan.points_velo)


def register_window(
    window: ScanWindow,
    voxel_size_m: float = 0.5,
    max_correspondence_m: float = 1.0,
    threads: int = 2,
) -> ScanWindow:
    """Align every scan with the newest one anew, as the thesis does for each frame (Algorithm 2).

    Args:
        window: scans with INS poses.
        voxel_size_m: edge of the box-grid filter; the thesis names none.
        max_correspondence_m: the farthest match of the point-to-point ICP; the thesis names none.
        threads: of the ICP.

    Returns:
        The same scans. A pose whose alignment fails stays the INS's.
    """
    newest = window.newest
    target = preprocess_points(newest.points_velo, voxel_size_m, threads=threads)
    newest_SE3_world = inverse(newest.world_SE3_velo)
    registered = ScanWindow(previous_scans=len(window) - 1)
    for scan in window:
        pose = scan.world_SE3_velo
        if scan is not newest:
            source = preprocess_points(scan.points_velo, voxel_size_m, threads=threads)
            found = align(
                target, source, newest_SE3_world @ pose, max_correspondence_m, threads, "ICP"
            )
            if found.is_converged:
                pose = newest.world_SE3_velo @ np.round(found.target_SE3_source, 10)
        registered.push(PosedScan(scan.points_velo, pose))
    return registered
