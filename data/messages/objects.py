"""Objects with 3D boxes in three forms: values for programs, and what Foxglove and RViz draw."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from data.messages.definitions import message
from data.messages.geometry import (
    LIDAR,
    color,
    header,
    point,
    time,
    upright_pose,
    vector,
)
from perception.render.palette import Color, track_color
from perception.types import Float64, Tracks

_OPACITY = 0.5
_TEXT_M = 0.8  # height of a label, and its distance above the box
_ARROW_M = 0.15  # diameter of a velocity's shaft
# Of visualization_msgs/Marker.
_ARROW, _CUBE, _TEXT, _DELETE_ALL = 0, 1, 9, 3
_ALL = 1  # of foxglove_msgs/SceneEntityDeletion


@dataclass(frozen=True)
class _Object:
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
    def of(cls, tracks: Tracks) -> Iterator[Self]:
        """Yield the objects that have a box."""
        for row in np.flatnonzero(np.isfinite(tracks.boxes.bottom_m).all(axis=1)):
            size_m = tracks.boxes.size_m[row]
            yield cls(
                id=int(tracks.ids[row]),
                name=str(tracks.types[row]) or "object",
                score=float(tracks.scores[row]),
                center_m=tracks.boxes.bottom_m[row] + np.array([0, 0, size_m[2] / 2]),
                size_m=size_m,
                yaw_rad=float(tracks.boxes.yaw_rad[row]),
                velocity_m_s=np.nan_to_num(tracks.velocities_m_s[row]),
                covariance=tracks.covariances[row],
                yaw_std_rad=float(tracks.box_deviations.yaw_rad[row]),
                is_observed=bool(tracks.is_observed[row]),
            )

    @property
    def speed_m_s(self) -> float:
        return float(np.hypot(*self.velocity_m_s))

    @property
    def label(self) -> str:
        number = f" {self.id}" if self.id >= 0 else ""
        return f"{self.name}{number} {self.speed_m_s:.1f} m/s"

    @property
    def rgb(self) -> Color:
        return track_color(self.id)

    @property
    def label_m(self) -> Float64:
        above_m = np.array([0, 0, self.size_m[2] / 2 + _TEXT_M])
        return np.asarray(self.center_m + above_m)


def detection_array(stamp_s: float, tracks: Tracks) -> Any:  # noqa: ANN401 - a message
    """Return the values of the objects as `vision_msgs/Detection3DArray`; ids as text, empty before tracking."""
    return message(
        "vision_msgs/Detection3DArray",
        header=header(stamp_s, LIDAR),
        detections=[_detection(stamp_s, one) for one in _Object.of(tracks)],
    )


def scene(stamp_s: float, tracks: Tracks) -> Any:  # noqa: ANN401 - a message
    """Return the objects as Foxglove draws them, in place of those of the frame before."""
    everything = message("foxglove_msgs/SceneEntityDeletion", timestamp=time(stamp_s), type=_ALL)
    entities = [_entity(stamp_s, row, one) for row, one in enumerate(_Object.of(tracks))]
    return message("foxglove_msgs/SceneUpdate", deletions=[everything], entities=entities)


def markers(stamp_s: float, tracks: Tracks) -> Any:  # noqa: ANN401 - a message
    """Return the objects as RViz draws them, in place of those of the frame before: box, label and velocity."""
    rows = [_marker(stamp_s, "", 0, action=_DELETE_ALL)]
    for row, one in enumerate(_Object.of(tracks)):
        tip_m = one.center_m + np.array([*one.velocity_m_s, 0.0])
        pose = upright_pose(one.center_m, one.yaw_rad)
        shown = {"rgb": one.rgb, "type": _CUBE, "pose": pose, "scale": vector(one.size_m)}
        rows.append(_marker(stamp_s, "boxes", row, **shown))
        shown = {"rgb": one.rgb, "type": _TEXT, "pose": upright_pose(one.label_m)}
        height = vector(np.array([0, 0, _TEXT_M]))
        rows.append(_marker(stamp_s, "labels", row, **shown, scale=height, text=one.label))
        thickness = vector(np.array([_ARROW_M, 2 * _ARROW_M, 0]))
        shown = {"rgb": one.rgb, "type": _ARROW, "scale": thickness}
        ends = [point(one.center_m), point(tip_m)]
        rows.append(_marker(stamp_s, "velocities", row, **shown, points=ends))
    return message("visualization_msgs/MarkerArray", markers=rows)


def _detection(stamp_s: float, one: _Object) -> Any:  # noqa: ANN401 - a message
    pose = upright_pose(one.center_m, one.yaw_rad)
    covariance = np.zeros((6, 6))
    if np.isfinite(one.covariance[:2, :2]).all():
        covariance[:2, :2] = one.covariance[:2, :2]
        covariance[5, 5] = np.nan_to_num(one.yaw_std_rad) ** 2
    hypothesis = message("vision_msgs/ObjectHypothesis", class_id=one.name, score=one.score)
    with_covariance = message(
        "geometry_msgs/PoseWithCovariance", pose=pose, covariance=covariance.ravel()
    )
    return message(
        "vision_msgs/Detection3D",
        header=header(stamp_s, LIDAR),
        results=[
            message(
                "vision_msgs/ObjectHypothesisWithPose", hypothesis=hypothesis, pose=with_covariance
            )
        ],
        bbox=message("vision_msgs/BoundingBox3D", center=pose, size=vector(one.size_m)),
        id=str(one.id) if one.id >= 0 else "",
    )


def _entity(stamp_s: float, row: int, one: _Object) -> Any:  # noqa: ANN401 - a message
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
        pose=upright_pose(one.center_m, one.yaw_rad),
        size=vector(one.size_m),
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


def _marker(
    stamp_s: float,
    namespace: str,
    number: int,
    *,
    rgb: Color = (0, 0, 0),
    **fields: Any,  # noqa: ANN401
) -> Any:  # noqa: ANN401 - a message
    opacity = _OPACITY if fields.get("type") == _CUBE else 1.0
    defaults = {
        "header": header(stamp_s, LIDAR),
        "ns": namespace,
        "id": number,
        "type": _CUBE,
        "pose": upright_pose(np.zeros(3)),
        "scale": vector(np.ones(3)),
        "color": color("std_msgs/ColorRGBA", rgb, opacity),
        "texture": message("sensor_msgs/CompressedImage", header=header(stamp_s, LIDAR)),
    }
    return message("visualization_msgs/Marker", **{**defaults, **fields})
