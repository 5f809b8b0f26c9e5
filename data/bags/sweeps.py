"""Scans of one or several LiDARs of a bag, merged in the axes of the vehicle."""

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data.bags.message_stream import MessageStream
from data.clouds.cloud import Cloud, cloud_of_columns
from perception.errors import ScanError
from perception.geometry.se3 import transform_points
from perception.types import Float32, Float64, Int

# Types of fields by the numbers of sensor_msgs/PointField.
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
# Where a sensor gives both, reflectivity is calibrated, and intensity depends on the range.
_RAW_INTENSITY, _CALIBRATED = "intensity", {"reflectivity", "reflectance"}
_MAX_POINTS = 20_000_000  # a hundred times a scan; more is a damaged header
_MAX_OFFSET_S = 3.0  # of a point from the stamp of its sweep; more is a time by another clock
_NO_MESSAGE = -1


def read_point_cloud(message: Any, source: str) -> Cloud:  # noqa: ANN401 - see Bag.decode
    """Return the points of a sensor_msgs/PointCloud2 message, in its order.

    Args:
        message: Decoded message.
        source: Place of the message, for errors.

    Raises:
        ScanError: It has no x, y or z, or its sizes contradict each other.
    """
    points = _points(message, source)
    names = set(points.dtype.names or ())
    if names & _CALIBRATED:
        names.discard(_RAW_INTENSITY)
    return cloud_of_columns(
        {name: points[name] for name in points.dtype.names or () if name in names}, source
    )


def _points(message: Any, source: str) -> NDArray[Any]:  # noqa: ANN401
    """Return the (N,) records of a message, copied where they lie in rows with gaps."""
    fields = [field for field in message.fields if field.datatype in _TYPES]
    order = ">" if message.is_bigendian else "<"
    width, height, step = message.width, message.height, message.point_step
    row_step = message.row_step if height > 1 and message.row_step else width * step
    types = [np.dtype(order + _TYPES[field.datatype]) for field in fields]
    ends = [field.offset + kind.itemsize for field, kind in zip(fields, types, strict=True)]
    used = (height - 1) * row_step + width * step if width * height else 0
    if max(ends, default=0) > step or row_step < width * step or used > len(message.data):
        raise ScanError(
            source,
            expected=f"{height} rows of {width} points of {step} bytes, {used} bytes in all, and fields within a point",
            found=f"{len(message.data)} bytes, rows of {row_step} bytes, fields up to byte {max(ends, default=0)}",
        )
    if width * height > _MAX_POINTS:
        raise ScanError(source, expected=f"at most {_MAX_POINTS} points", found=str(width * height))
    record = np.dtype(
        {
            "names": [field.name for field in fields],
            "formats": types,
            "offsets": [field.offset for field in fields],
            "itemsize": max(step, 1),
        }
    )
    data = np.ascontiguousarray(message.data, np.uint8)
    rows = np.ndarray((height, width), record, data, strides=(row_step, record.itemsize))
    return rows.reshape(-1)


@dataclass(frozen=True)
class BagLidar:
    """One LiDAR of a drive.

    Attributes:
        stream: Its messages.
        velo_SE3_lidar: (4, 4) transform from its frame to the LiDAR frame of the drive.
        full_scale: Full scale of its intensity, which becomes 1.
    """

    stream: MessageStream
    velo_SE3_lidar: Float64
    full_scale: float = 1.0

    def cloud(self, index: int) -> Cloud:
        """Return the points of a message.

        Raises:
            DriveError: The bag is damaged there.
            ScanError: It is no cloud.
        """
        return read_point_cloud(self.stream.read(index), self.stream.where(index))


@dataclass(frozen=True)
class MergedScan:
    """Points of all LiDARs at the stamp of the first.

    Attributes:
        points_velo: (N, 4) x, y, z in metres and reflectance 0..1; zeros without a return.
        times_s: (N,) seconds from the stamp, or None where no LiDAR states them.
    """

    points_velo: Float32
    times_s: Float32 | None


class SweepReader:
    """Reads sweeps by their number; the one read last is kept, as points and times are asked for apart."""

    def __init__(self, lidars: Sequence[BagLidar], rows: Int) -> None:
        """Set the LiDARs.

        Args:
            lidars: LiDARs, the first of which gives the stamp.
            rows: (F, L) message of each LiDAR for each scan, -1 for none.
        """
        self.lidars, self.rows = tuple(lidars), rows
        self._lock = threading.Lock()
        self._last: tuple[int, MergedScan] | None = None

    def __reduce__(self) -> tuple[type["SweepReader"], tuple[Sequence[BagLidar], Int]]:
        """Keep no sweep for another process."""
        return SweepReader, (self.lidars, self.rows)

    def read(self, index: int) -> MergedScan:
        """Return a sweep.

        Raises:
            DriveError: The bag is damaged there.
            ScanError: A message is no cloud.
        """
        with self._lock:
            if self._last is None or self._last[0] != index:
                self._last = index, self._merge(index)
            return self._last[1]

    def where(self, index: int) -> str:
        """Return the place of a sweep, for error messages."""
        return self.lidars[0].stream.where(int(self.rows[index, 0]))

    def _merge(self, index: int) -> MergedScan:
        stamp_ns = int(self.lidars[0].stream.times.stamps_ns[self.rows[index, 0]])
        points, times = [], []
        is_timed = False
        for lidar, row in zip(self.lidars, self.rows[index].tolist(), strict=True):
            if row == _NO_MESSAGE:
                continue
            cloud = lidar.cloud(row)
            own_ns = int(lidar.stream.times.stamps_ns[row])
            own_times_s = point_times_s(cloud, own_ns)
            is_timed |= own_times_s is not None or own_ns != stamp_ns
            moved = np.zeros(len(cloud), np.float32) if own_times_s is None else own_times_s
            points.append(points_velo(cloud, lidar))
            times.append(moved + np.float32((own_ns - stamp_ns) / 1e9))
        return MergedScan(np.concatenate(points), np.concatenate(times) if is_timed else None)


def points_velo(cloud: Cloud, lidar: BagLidar) -> Float32:
    """Return (N, 4) points of a cloud in the LiDAR frame of the drive."""
    points = np.zeros((len(cloud), 4), np.float32)
    points[:, :3] = cloud.xyz
    if cloud.intensity is not None:
        # A few returns of retroreflectors may be brighter than those of the scans in which the scale was looked for.
        np.clip(cloud.intensity / np.float32(lidar.full_scale), 0, 1, out=points[:, 3])
    # Organised clouds have NaN, or zeros, where there was no return.
    is_none = np.asarray(~(np.isfinite(points).all(axis=1) & points[:, :3].any(axis=1)))
    if not np.array_equal(lidar.velo_SE3_lidar, np.eye(4)):
        points = transform_points(lidar.velo_SE3_lidar, np.where(is_none[:, None], 0, points))
    points[is_none] = 0
    return points


def point_times_s(cloud: Cloud, stamp_ns: int) -> Float32 | None:
    """Return (N,) seconds from the stamp of a message, or None where the cloud does not state them.

    Times that are neither from the stamp nor from the epoch of the stamp are by a clock of the sensor: the first point
    is taken at the stamp.
    """
    if cloud.times_s is None or len(cloud) == 0:
        return None
    times_s = np.nan_to_num(cloud.times_s)
    middle_s = float(np.median(times_s))
    if abs(middle_s - stamp_ns / 1e9) < _MAX_OFFSET_S:
        times_s = times_s - stamp_ns / 1e9
    elif abs(middle_s) > _MAX_OFFSET_S:
        times_s = times_s - times_s.min()
    return np.asarray(times_s, np.float32)
