"""Parts of messages: time, header, pose, vector and colour."""

from functools import lru_cache
from typing import Any

import numpy as np

from data.messages.definitions import message
from perception.geometry.se3 import rotation_vector
from perception.render.palette import Color
from perception.types import Float, Float64

# Frames of reference of all messages.
WORLD, LIDAR, CAMERA = "world", "lidar", "camera"


def further_camera(name: str) -> str:
    """Return the frame of reference of a further camera, and the start of its topics behind a slash."""
    return f"cameras/{name.strip('/').replace('/', '_')}"


def stamp_ns(stamp_s: float) -> int:
    """Return a time in nanoseconds; messages know no time before 0."""
    return max(round(stamp_s * 1e9), 0)


def time(stamp_s: float) -> Any:  # noqa: ANN401 - a message
    """Return a time."""
    return time_of(stamp_ns(stamp_s))


def time_of(time_ns: int) -> Any:  # noqa: ANN401 - a message
    """Return a time in nanoseconds."""
    seconds, nanoseconds = divmod(time_ns, 1_000_000_000)
    return message("builtin_interfaces/Time", sec=seconds, nanosec=nanoseconds)


def header(stamp_s: float, frame_id: str) -> Any:  # noqa: ANN401 - a message
    """Return the header of a message in one frame of reference."""
    return message("std_msgs/Header", stamp=time(stamp_s), frame_id=frame_id)


def point(position_m: Float) -> Any:  # noqa: ANN401 - a message
    """Return a (3,) position."""
    x, y, z = map(float, position_m)
    return message("geometry_msgs/Point", x=x, y=y, z=z)


def vector(values: Float) -> Any:  # noqa: ANN401 - a message
    """Return (3,) values along x, y and z."""
    x, y, z = map(float, values)
    return message("geometry_msgs/Vector3", x=x, y=y, z=z)


def quaternion(rotation: Float64) -> Any:  # noqa: ANN401 - a message
    """Return a (3, 3) rotation."""
    vector_rad = rotation_vector(rotation)
    half_rad = float(np.linalg.norm(vector_rad)) / 2
    x, y, z = (np.sinc(half_rad / np.pi) / 2 * vector_rad).tolist()
    return message("geometry_msgs/Quaternion", x=x, y=y, z=z, w=float(np.cos(half_rad)))


def yaw_quaternion(yaw_rad: float) -> Any:  # noqa: ANN401 - a message
    """Return a rotation about z."""
    half_rad = float(yaw_rad) / 2
    z, w = float(np.sin(half_rad)), float(np.cos(half_rad))
    return message("geometry_msgs/Quaternion", z=z, w=w)


def upright_pose(position_m: Float, yaw_rad: float = 0.0) -> Any:  # noqa: ANN401 - a message
    """Return the pose of something upright at a (3,) position."""
    return message(
        "geometry_msgs/Pose", position=point(position_m), orientation=yaw_quaternion(yaw_rad)
    )


@lru_cache(maxsize=512)
def color(kind: str, rgb: Color, opacity: float = 1.0) -> Any:  # noqa: ANN401 - a message
    """Return a colour; both packages that have one name its fields alike.

    Args:
        kind: `foxglove_msgs/Color` or `std_msgs/ColorRGBA`.
        rgb: Red, green and blue from 0 to 255.
        opacity: From 0 to 1.
    """
    red, green, blue = (value / 255 for value in rgb)
    return message(kind, r=red, g=green, b=blue, a=opacity)
