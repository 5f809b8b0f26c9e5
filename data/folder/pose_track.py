"""Poses of a body in the world, from KITTI's and TUM's rows, tables of poses, and tables of an INS."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from data.clouds.text_table import TextTable, parse_text_table
from data.kitti.oxts import InsPacket, Mercator
from data.kitti.reading import read_bytes
from perception.errors import PoseError
from perception.geometry.se3 import from_euler, interpolate
from perception.types import Float64, Int

_KITTI_COLUMNS, _TUM_COLUMNS = 12, 8
_TUM_NAMES = ("t", "x", "y", "z", "qx", "qy", "qz", "qw")
_MIN_STEP_M = 0.5  # of a course; standing vehicles keep theirs
_WORDS = {
    "t": ("t", "time", "timestamp", "stamp"),
    "lat": ("lat", "latitude"),
    "lon": ("lon", "long", "lng", "longitude"),
    "alt": ("alt", "altitude", "height", "elevation"),
    "roll": ("roll",), "pitch": ("pitch",), "yaw": ("yaw",),
    "x": ("x", "tx", "px"), "y": ("y", "ty", "py"), "z": ("z", "tz", "pz"),
    "qx": ("qx",), "qy": ("qy",), "qz": ("qz",), "qw": ("qw",),
}  # fmt: skip
_UNITS = {"deg", "rad", "m", "s", "ms", "us", "ns"}


@dataclass(frozen=True)
class PoseTrack:
    """P poses in order of time.

    Attributes:
        world_SE3_body: (P, 4, 4) poses in the world.
        stamps_ns: (P,) times in nanoseconds, or None for one pose a scan.
        source: File, for error messages.
    """

    world_SE3_body: Float64
    stamps_ns: Int | None
    source: Path

    def at(self, row: int, stamp_ns: int, max_gap_s: float) -> Float64:
        """Return the (4, 4) pose of a scan, interpolated where its time lies between two rows.

        Args:
            row: Index of the scan, where there is one pose a scan.
            stamp_ns: Time of the scan in nanoseconds.
            max_gap_s: Time in seconds beyond the first or last pose from which a scan has none.

        Raises:
            PoseError: There is no pose at that time.
        """
        if self.stamps_ns is None:
            return np.asarray(self.world_SE3_body[row])
        after = int(np.searchsorted(self.stamps_ns, stamp_ns))
        if after < len(self.stamps_ns) and self.stamps_ns[after] == stamp_ns:
            return np.asarray(self.world_SE3_body[after])
        before, after = max(after - 1, 0), min(after, len(self.stamps_ns) - 1)
        gap_s = min(abs(stamp_ns - int(self.stamps_ns[one])) for one in (before, after)) * 1e-9
        if before == after and gap_s > max_gap_s:
            first_s, last_s = (int(self.stamps_ns[one]) * 1e-9 for one in (0, -1))
            raise PoseError(
                self.source,
                expected=f"a pose at the time of the scan, {stamp_ns * 1e-9:.3f} s",
                found=f"poses from {first_s:.3f} to {last_s:.3f} s",
                advice="state the times of the scans by the same clock, with timestamps or time_offset_s",
            )
        first, second = self.world_SE3_body[[before, after]]
        if before == after:
            return np.asarray(first)
        gap_ns = self.stamps_ns[after] - self.stamps_ns[before]
        return interpolate(first, second, float((stamp_ns - self.stamps_ns[before]) / gap_ns))


def read_pose_track(
    path: Path, kind: Literal["kitti", "tum", "csv", "ins"], scans: int
) -> PoseTrack:
    """Read the poses of a drive.

    Args:
        path: File of a pose a row.
        kind: Format of the file.
        scans: Number of scans; a file without times has as many rows.

    Raises:
        PoseError: The file is malformed, or lacks a column or rows.
    """
    table = parse_text_table(read_bytes(path, PoseError, "a table of poses"), path, PoseError)
    if not np.isfinite(table.rows).all():
        raise PoseError(path, expected="finite numbers", found="NaN or infinity")
    if kind == "kitti":
        return PoseTrack(_kitti_poses(table.rows, scans, path), None, path)
    names = _TUM_NAMES if kind == "tum" else tuple(map(pose_column, table.names))
    if len(names) != table.rows.shape[1]:
        raise PoseError(
            path,
            expected=f"{_TUM_COLUMNS} columns, {' '.join(_TUM_NAMES)}"
            if kind == "tum"
            else "a row of names",
            found=f"{table.rows.shape[1]} columns and {len(table.names)} names",
        )
    columns = dict(zip(names, table.rows.T, strict=True))
    poses = (
        _ins_poses(columns, table, path) if kind == "ins" else _table_poses(columns, table, path)
    )
    if "t" not in columns:
        return PoseTrack(_require_rows(poses, scans, path), None, path)
    stamps_ns = _stamps_ns(columns["t"], path)
    if not (np.diff(stamps_ns) > 0).all():
        raise PoseError(path, expected="times that rise from row to row", found="others")
    return PoseTrack(poses, stamps_ns, path)


def _stamps_ns(values: Float64, path: Path) -> Int:
    """Return times in nanoseconds: whole ones of 13, 16 and 19 digits are ms, us and ns."""
    scale = next(
        (s for limit, s in ((1e11, 1e9), (1e14, 1e6), (1e17, 1e3)) if abs(values[0]) < limit), 1.0
    )
    stamps_ns = np.round(values * scale)
    if not (np.abs(stamps_ns) < 2.0**63).all():
        found = f"{values[np.argmax(np.abs(values))]:g}"
        raise PoseError(path, expected="times that 64 bits of nanoseconds hold", found=found)
    return stamps_ns.astype(np.int64)


def pose_column(name: str) -> str:
    """Return which column a name of a table means; the name itself where it is another one."""
    words = re.sub(r"[^a-z0-9]+", " ", name.lower()).split()
    stem = "".join(word for word in words if word not in _UNITS or len(words) == 1)
    return next((column for column, known in _WORDS.items() if stem in known), name)


def _require_rows(poses: Float64, scans: int, path: Path) -> Float64:
    if len(poses) != scans:
        raise PoseError(
            path, expected=f"{scans} rows, one a scan, as there are no times", found=str(len(poses))
        )
    return poses


def _kitti_poses(rows: Float64, scans: int, path: Path) -> Float64:
    if rows.shape[1] != _KITTI_COLUMNS:
        raise PoseError(path, expected=f"{_KITTI_COLUMNS} numbers a row", found=str(rows.shape[1]))
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3] = rows.reshape(-1, 3, 4)
    return _require_rows(poses, scans, path)


def _require_columns(
    columns: dict[str, Float64], needed: tuple[str, ...], path: Path
) -> list[Float64]:
    if missing := [name for name in needed if name not in columns]:
        raise PoseError(
            path, expected=f"columns {', '.join(needed)}", found=f"no {', '.join(missing)}"
        )
    return [columns[name] for name in needed]


def _angles_rad(columns: dict[str, Float64], table: TextTable) -> Float64 | None:
    """Return (P, 3) roll, pitch and yaw; degrees where a name says so or a number is beyond a turn."""
    if "yaw" not in columns:
        return None
    zero = np.zeros(len(table.rows))
    angles = np.column_stack([columns.get(name, zero) for name in ("roll", "pitch", "yaw")])
    is_degrees = any("deg" in name.lower() for name in table.names)
    return np.radians(angles) if is_degrees or np.abs(angles).max() > 2 * np.pi else angles


def _table_poses(columns: dict[str, Float64], table: TextTable, path: Path) -> Float64:
    positions_m = np.column_stack(_require_columns(columns, ("x", "y", "z"), path))
    angles_rad = _angles_rad(columns, table)
    if angles_rad is not None:
        rotations = Rotation.from_euler("ZYX", angles_rad[:, ::-1]).as_matrix()
    else:
        quaternions = np.column_stack(_require_columns(columns, ("qx", "qy", "qz", "qw"), path))
        if not (np.linalg.norm(quaternions, axis=1) > 0).all():
            raise PoseError(path, expected="quaternions", found="one of zeros")
        rotations = Rotation.from_quat(quaternions).as_matrix()
    poses = np.tile(np.eye(4), (len(table.rows), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = rotations, positions_m
    return poses


def _ins_poses(columns: dict[str, Float64], table: TextTable, path: Path) -> Float64:
    """Return poses in metres around the first row; the course is the heading where there is no yaw."""
    position = np.column_stack(_require_columns(columns, ("lat", "lon", "alt"), path))
    if np.abs(position[:, 0]).max() > 89 or np.abs(position[:, 1]).max() > 180:
        raise PoseError(
            path, expected="latitudes within 89 and longitudes within 180 degrees", found="others"
        )
    world = Mercator(*position[0].tolist())
    angles_rad = _angles_rad(columns, table)
    poses = np.array(
        [
            world.world_SE3_imu(InsPacket(*row.tolist(), *angles.tolist()))
            for row, angles in zip(
                position, np.zeros_like(position) if angles_rad is None else angles_rad, strict=True
            )
        ]
    )
    return _turned_along_course(poses) if angles_rad is None else poses


def _turned_along_course(poses: Float64) -> Float64:
    turned, last = poses.copy(), 0
    yaw_rad = np.zeros(len(poses))
    for row in range(1, len(poses)):
        step_m = poses[row, :2, 3] - poses[last, :2, 3]
        if np.linalg.norm(step_m) >= _MIN_STEP_M:
            # Scans before the first step take its course.
            yaw_rad[row if last else 0 :] = np.arctan2(step_m[1], step_m[0])
            last = row
    for row, yaw in enumerate(yaw_rad):
        turned[row] = from_euler(0, 0, yaw, poses[row, :3, 3])
    return turned
