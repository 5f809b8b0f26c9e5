"""Poses of the vehicle in its city, at the times of the sweeps."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from data.argoverse2.tables import FeatherTable, read_feather
from perception.errors import PerceptionError, PoseError
from perception.types import Float64

POSE_COLUMNS = ("qw", "qx", "qy", "qz", "tx_m", "ty_m", "tz_m")


def read_poses(
    path: Path, key: str, kind: type[PerceptionError], what: str
) -> tuple[NDArray[Any], Float64]:
    """Read a table of poses.

    Args:
        path: Feather file.
        key: Column that tells the poses apart.
        kind: Type of the error.
        what: Content that is expected, for the error.

    Returns:
        (P,) keys and (P, 4, 4) transforms.

    Raises:
        PerceptionError: The table cannot be read, or a pose is no rigid transform.
    """
    table = read_feather(path, (key, *POSE_COLUMNS), kind, what)
    return table[key], rigid_transforms(table, kind)


def rigid_transforms(table: FeatherTable, kind: type[PerceptionError]) -> Float64:
    """Return (P, 4, 4) transforms of the rows of a table.

    Raises:
        PerceptionError: A number is not finite, or a quaternion is zero.
    """
    numbers = table.numbers(*POSE_COLUMNS)
    lengths = np.linalg.norm(numbers[:, :4], axis=1)
    if not np.isfinite(numbers).all() or (lengths < 0.5).any():
        raise kind(
            table.path,
            expected="quaternions and translations as finite numbers",
            found="NaN, infinity or a quaternion of length 0",
        )
    transforms = np.tile(np.eye(4), (len(numbers), 1, 1))
    if len(numbers):  # older releases of SciPy have no rotations of no rows
        transforms[:, :3, :3] = Rotation.from_quat(numbers[:, [1, 2, 3, 0]]).as_matrix()
    transforms[:, :3, 3] = numbers[:, 4:]
    return transforms


@dataclass(frozen=True)
class Trajectory:
    """Poses of the vehicle; the origin of the world is that of the first pose, so that positions keep their precision.

    Attributes:
        path: File of the poses.
        city_SE3_ego: (4, 4) pose of the vehicle in the city by time in nanoseconds.
        first_ns: Time of the first pose.
    """

    path: Path
    city_SE3_ego: dict[int, Float64]
    first_ns: int

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read the poses of a log.

        Raises:
            PoseError: The table is missing or damaged, or has no row.
        """
        stamps_ns, poses = read_poses(path, "timestamp_ns", PoseError, "poses of the vehicle")
        if not len(poses):
            raise PoseError(path, expected="poses of the vehicle", found="none")
        known = dict(zip(stamps_ns.tolist(), poses, strict=True))
        return cls(path, known, min(known))

    def in_city(self, stamp_ns: int) -> Float64:
        """Return the (4, 4) pose of the vehicle in its city.

        Raises:
            PoseError: There is no pose of that time.
        """
        pose = self.city_SE3_ego.get(stamp_ns)
        if pose is None:
            raise PoseError(
                self.path, expected=f"a pose at the sweep of {stamp_ns} ns", found="none"
            )
        return pose

    def world_SE3_ego(self, stamp_ns: int) -> Float64:
        """Return the (4, 4) pose of the vehicle in the world; raise as `in_city`."""
        pose = self.in_city(stamp_ns).copy()
        pose[:3, 3] -= self.city_SE3_ego[self.first_ns][:3, 3]
        return pose
