"""PointCloud2: any fields in any order, of any type, organised or not."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from data.clouds.cloud import Cloud, cloud_of_columns
from perception.errors import ScanError

# Types of fields by the numbers of sensor_msgs/PointField.
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
# Where a sensor gives both, reflectivity is calibrated, and intensity depends on the range.
_RAW_INTENSITY, _CALIBRATED = "intensity", {"reflectivity", "reflectance"}
_MAX_POINTS = 20_000_000  # a hundred times a scan; more is a damaged header


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
