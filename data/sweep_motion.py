"""How the LiDAR of a drive moved during a sweep: by the poses of its neighbours, else by registration of these."""

from typing import Protocol

import numpy as np

from perception.geometry.se3 import inverse
from perception.localization.deskew import SweepMotion
from perception.localization.located_scan import PoseOrigin
from perception.localization.odometry import LidarOdometry
from perception.types import Float32, Float64

_MAX_GAP_S = 1.0  # between two scans; over a longer one the velocity is not constant


class _Scans(Protocol):
    """What is asked of a drive."""

    def __len__(self) -> int: ...

    def points_velo(self, index: int) -> Float32: ...

    def stamp_s(self, index: int) -> float: ...

    def world_SE3_velo(self, index: int) -> Float64 | None: ...


class SweepMotions:
    """Motions of the sweeps of one drive; one after another, each scan is registered once."""

    def __init__(self) -> None:
        # Index and pose of the scan registered last, and the odometry that did.
        self._registered: tuple[int, Float64, LidarOdometry] | None = None

    def motion(self, drive: _Scans, index: int, span_s: tuple[float, float]) -> SweepMotion | None:
        """Return the motion of a sweep at constant velocity; None where neither poses nor registration tell it.

        Args:
            drive: Drive of the sweep.
            index: Index of the frame.
            span_s: Times of the first and the last point in seconds from the frame's stamp.

        Raises:
            PerceptionError: A neighbour of the scan, or its pose, is damaged.
        """
        step = _step_of_poses(drive, index) or self._step_of_registration(drive, index)
        return None if step is None else SweepMotion.steady(*step, span_s)

    def _step_of_registration(self, drive: _Scans, index: int) -> tuple[Float64, float] | None:
        """Return the pose of the scan before in the frame of a scan, and its time; of the first, that of the next."""
        if index == 0:
            return self._step_to_second(drive) if len(drive) > 1 else None
        # While it is in use, no other thread finds it.
        last, self._registered = self._registered, None
        if last is None or last[0] != index - 1:
            odometry = LidarOdometry()
            start = odometry.update(_returns(drive, index - 1), drive.stamp_s(index - 1))
            last = index - 1, start.world_SE3_velo, odometry
        _, before, odometry = last
        gap_s = drive.stamp_s(index) - drive.stamp_s(index - 1)
        if not 0 < gap_s <= _MAX_GAP_S:
            return None
        found = odometry.update(_returns(drive, index), drive.stamp_s(index))
        self._registered = index, found.world_SE3_velo, odometry
        if found.origin is not PoseOrigin.REGISTERED or found.is_reset:
            return None
        return inverse(found.world_SE3_velo) @ before, -gap_s

    def _step_to_second(self, drive: _Scans) -> tuple[Float64, float] | None:
        """Return the pose of the second scan in the frame of the first, before which there is none."""
        step = self._step_of_registration(drive, 1)
        self._registered = None
        return None if step is None else (inverse(step[0]), -step[1])


def _step_of_poses(drive: _Scans, index: int) -> tuple[Float64, float] | None:
    """Return how far the LiDAR moves from the scan before to the scan after, or from or to the scan itself."""
    around = [at for at in (index - 1, index, index + 1) if 0 <= at < len(drive)]
    known = [
        (drive.stamp_s(at), pose) for at in around if (pose := drive.world_SE3_velo(at)) is not None
    ]
    if len(known) < 2:
        return None
    (first_s, first), (last_s, last) = known[0], known[-1]
    if not 0 < last_s - first_s <= 2 * _MAX_GAP_S:
        return None
    return inverse(first) @ last, last_s - first_s


def _returns(drive: _Scans, index: int) -> Float32:
    points = drive.points_velo(index)
    is_return = np.isfinite(points).all(axis=1) & points[:, :3].any(axis=1)
    return points[is_return]
