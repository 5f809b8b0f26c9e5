"""The scan with what the pipeline found out about each point."""

from typing import Any

import numpy as np

from data.messages.definitions import message
from data.messages.geometry import LIDAR, header
from perception.types import Int, Result

# Name, format and offset of each field of a point; offsets are multiples of the sizes, as readers in C++ want it.
_FIELDS = (
    ("x", "<f4", 0),
    ("y", "<f4", 4),
    ("z", "<f4", 8),
    ("intensity", "<f4", 12),
    ("id", "<i4", 16),
    ("class", "u1", 20),
)
# How they are written: position and intensity as one value, which is faster; the bytes behind the class are padding.
_POINT = np.dtype([("position_and_intensity", "<c16"), ("id", "<i4"), ("class", "<i4")])
# Numbers of the formats in `sensor_msgs/PointField`.
_DATATYPES = {"u1": 2, "<i4": 5, "<f4": 7}


def point_cloud(result: Result) -> Any:  # noqa: ANN401 - a message
    """Return the N points in the order of the scan.

    `class` is the `PointState`: 0 outside, 1 ground, 2 static, 3 moving. `id` is the track id of the detected vehicle
    that a point belongs to, else -1.
    """
    points = result.frame.points_velo
    rows = np.empty(len(points), _POINT)
    rows["position_and_intensity"] = np.ascontiguousarray(points[:, :4], "<f4").view("<c16")[:, 0]
    rows["id"], rows["class"] = _vehicle_ids(result), result.obstacles.point_states
    fields = [
        message(
            "sensor_msgs/PointField",
            name=name,
            offset=offset,
            datatype=_DATATYPES[kind],
            count=1,
        )
        for name, kind, offset in _FIELDS
    ]
    return message(
        "sensor_msgs/PointCloud2",
        header=header(result.frame.stamp_s, LIDAR),
        height=1,
        width=len(rows),
        fields=fields,
        point_step=rows.itemsize,
        row_step=rows.nbytes,
        data=rows.view(np.uint8),
        is_dense=True,
    )


def _vehicle_ids(result: Result) -> Int:
    """Return (N,) the id of the vehicle that each point belongs to, or -1."""
    if result.vehicles is None:
        return np.full(len(result.frame.points_velo), -1)
    # The last entry is that of the points of no vehicle, whose owner is -1.
    ids = np.append(result.vehicles.ids, -1).astype(np.int32)
    return ids.take(result.vehicles.owners, mode="wrap")
