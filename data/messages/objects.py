"""Objects with 3D boxes in three forms: values for programs, and what Foxglove and RViz draw."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from math import isfinite
from typing import Any, Self

import numpy as np

from data.messages.definitions import message
from data.messages.geometry import (
    LIDAR,
    color,
    header,
    time,
    upright_pose,
    vector,
)
from perception.render.palette import Color, track_color
from perception.types import Float64, Tracks

_OPACITY = 0.5
_TEXT_M = 0.8  # height of a label, and its distance above the box
_ARROW_M = 0.15  # diameter of a velocity's shaft
_MARKER, _COLOR = "visualization_msgs/Marker", "std_msgs/ColorRGBA"
# Of visualization_msgs/Marker.
_ARROW, _CUBE, _TEXT, _DELETE_ALL = 0, 1, 9, 3
_ALL = 1  # of foxglove_msgs/SceneEntityDeletion


@dataclass(frozen=True)
class Object:
    """One row of `Tracks`, in the LiDAR frame.

    Attributes:
        id: Track id, -1 before it is tracked.
        name: Class, or `object` where no detector gave one.
        score: Score of the last detection, NaN without one.
        center_m: (3,) centre of the box.
        size_m: (3,) length, width and height.
        yaw_rad: Heading.
        velocity_m_s: (2,) over the ground; zero where it is not known.
        covariance: (4, 4) of x, y and the velocity; NaN where it is not known.
        yaw_std_rad: Standard deviation of the heading modulo pi; NaN where it is not known.
        is_observed: Whether it is measured in this scan.
    """

    id: int
    name: str
    score: float
    center_m: Float64
    size_m: Float64
    yaw_rad: float
    velocity_m_s: Float64
    covariance: Float64
    yaw_std_rad: float
    is_observed: bool

    @classmethod
    def of(cls, tracks: Tracks) -> tuple[Self, ...]:
        """Return the objects that have a box."""
        boxes = tracks.boxes
        rows = np.flatnonzero(np.isfinite(boxes.bottom_m).all(axis=1))
        centers_m, sizes_m = boxes.bottom_m[rows].astype(np.float64), boxes.size_m[rows]
        centers_m[:, 2] += sizes_m[:, 2] / 2
        columns = (
            tracks.ids[rows].tolist(),
            (name or "object" for name in tracks.types[rows].tolist()),
            tracks.scores[rows].tolist(),
            centers_m,
            sizes_m,
            boxes.yaw_rad[rows].tolist(),
            np.nan_to_num(tracks.velocities_m_s[rows]),
            tracks.covariances[rows],
            tracks.box_deviations.yaw_rad[rows].tolist(),
            tracks.is_observed[rows].tolist(),
        )
        return tuple(cls(*values) for values in zip(*columns, strict=True))

    @cached_property
    def pose(self) -> Any:  # noqa: ANN401 - a message
        """Pose of the box."""
        return upright_pose(self.center_m, self.yaw_rad)

    @cached_property
    def size(self) -> Any:  # noqa: ANN401 - a message
        """Size of the box."""
        return vector(self.size_m)

    @property
    def speed_m_s(self) -> float:
        """Speed over the ground."""
        return float(np.hypot(*self.velocity_m_s))

    @property
    def label(self) -> str:
        """Class, id and speed."""
        number = f" {self.id}" if self.id >= 0 else ""
        return f"{self.name}{number} {self.speed_m_s:.1f} m/s"

    @property
    def rgb(self) -> Color:
        """Colour of the track."""
        return track_color(self.id)

    @property
    def label_m(self) -> Float64:
        """(3,) position of the label."""
        above_m = np.array([0, 0, self.size_m[2] / 2 + _TEXT_M])
        return np.asarray(self.center_m + above_m)


def detection_array(stamp_s: float, objects: Sequence[Object]) -> Any:  # noqa: ANN401 - a message
    """Return the values of the objects as `vision_msgs/Detection3DArray`; ids as text, empty before tracking."""
    shared = header(stamp_s, LIDAR)
    return message(
        "vision_msgs/Detection3DArray",
        header=shared,
        detections=[_detection(shared, one) for one in objects],
    )


def scene(stamp_s: float, objects: Sequence[Object]) -> Any:  # noqa: ANN401 - a message
    """Return the objects as Foxglove draws them, in place of those of the frame before."""
    everything = message("foxglove_msgs/SceneEntityDeletion", timestamp=time(stamp_s), type=_ALL)
    entities = [_entity(stamp_s, row, one) for row, one in enumerate(objects)]
    return message("foxglove_msgs/SceneUpdate", deletions=[everything], entities=entities)


def markers(stamp_s: float, objects: Sequence[Object]) -> Any:  # noqa: ANN401 - a message
    """Return the objects as RViz draws them, in place of those of the frame before: box, label and velocity."""
    label_size, shaft_size, origin = _constants()
    texture = message("sensor_msgs/CompressedImage", header=header(stamp_s, LIDAR))
    shared = {"header": header(stamp_s, LIDAR), "texture": texture}
    black = color(_COLOR, (0, 0, 0))
    first = {"type": _CUBE, "pose": origin, "scale": vector(np.ones(3)), "color": black}
    rows = [message(_MARKER, **shared, **first, action=_DELETE_ALL)]
    for row, one in enumerate(objects):
        box = {"type": _CUBE, "pose": one.pose, "scale": one.size}
        box["color"] = color(_COLOR, one.rgb, _OPACITY)
        rows.append(message(_MARKER, **shared, **box, ns="boxes", id=row))
        solid = color(_COLOR, one.rgb)
        label = {"type": _TEXT, "pose": upright_pose(one.label_m), "scale": label_size}
        label |= {"color": solid, "text": one.label}
        rows.append(message(_MARKER, **shared, **label, ns="labels", id=row))
        x, y, z = one.center_m.tolist()
        tip = message(
            "geometry_msgs/Point", x=x + one.velocity_m_s[0], y=y + one.velocity_m_s[1], z=z
        )
        arrow = {"type": _ARROW, "pose": origin, "scale": shaft_size, "color": solid}
        ends = [one.pose.position, tip]
        rows.append(message(_MARKER, **shared, **arrow, ns="velocities", id=row, points=ends))
    return message("visualization_msgs/MarkerArray", markers=rows)


@cache
def _constants() -> tuple[Any, Any, Any]:
    """Return the sizes of labels and arrows, and the pose of the LiDAR."""
    return (
        vector(np.array([0, 0, _TEXT_M])),
        vector(np.array([_ARROW_M, 2 * _ARROW_M, 0])),
        upright_pose(np.zeros(3)),
    )


def _detection(shared: Any, one: Object) -> Any:  # noqa: ANN401 - messages
    covariance = np.zeros((6, 6))
    if np.isfinite(one.covariance[:2, :2]).all():
        covariance[:2, :2] = one.covariance[:2, :2]
        covariance[5, 5] = one.yaw_std_rad**2 if isfinite(one.yaw_std_rad) else 0.0
    hypothesis = message("vision_msgs/ObjectHypothesis", class_id=one.name, score=one.score)
    with_covariance = message(
        "geometry_msgs/PoseWithCovariance", pose=one.pose, covariance=covariance.ravel()
    )
    return message(
        "vision_msgs/Detection3D",
        header=shared,
        results=[
            message(
                "vision_msgs/ObjectHypothesisWithPose", hypothesis=hypothesis, pose=with_covariance
            )
        ],
        bbox=message("vision_msgs/BoundingBox3D", center=one.pose, size=one.size),
        id=str(one.id) if one.id >= 0 else "",
    )


def _entity(stamp_s: float, row: int, one: Object) -> Any:  # noqa: ANN401 - a message
    values = {
        "id": one.id,
        "class": one.name,
        "score": f"{one.score:.4f}",
        "velocity_x_m_s": f"{one.velocity_m_s[0]:.4f}",
        "velocity_y_m_s": f"{one.velocity_m_s[1]:.4f}",
        "is_observed": str(one.is_observed).lower(),
    }
    cube = message(
        "foxglove_msgs/CubePrimitive",
        pose=one.pose,
        size=one.size,
        color=color("foxglove_msgs/Color", one.rgb, _OPACITY),
    )
    course_rad = float(np.arctan2(one.velocity_m_s[1], one.velocity_m_s[0]))
    arrow = message(
        "foxglove_msgs/ArrowPrimitive",
        pose=upright_pose(one.center_m, course_rad),
        shaft_length=one.speed_m_s,
        shaft_diameter=_ARROW_M,
        head_length=3 * _ARROW_M,
        head_diameter=2 * _ARROW_M,
        color=color("foxglove_msgs/Color", one.rgb),
    )
    text = message(
        "foxglove_msgs/TextPrimitive",
        pose=upright_pose(one.label_m),
        billboard=True,
        font_size=_TEXT_M,
        color=color("foxglove_msgs/Color", one.rgb),
        text=one.label,
    )
    return message(
        "foxglove_msgs/SceneEntity",
        timestamp=time(stamp_s),
        frame_id=LIDAR,
        id=str(one.id) if one.id >= 0 else f"row {row}",
        frame_locked=True,
        metadata=[
            message("foxglove_msgs/KeyValuePair", key=key, value=str(value))
            for key, value in values.items()
        ],
        arrows=[arrow] if one.speed_m_s > 0 else [],
        cubes=[cube],
        texts=[text],
    )
