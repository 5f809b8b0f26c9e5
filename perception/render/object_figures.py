"""Objects as lines and faces in the LiDAR frame, before projection."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

import numpy as np

from perception.geometry.boxes import corners, edges
from perception.render import palette
from perception.render.ego_vehicle import vehicle_outline_m
from perception.render.palette import Color
from perception.render.scene import SceneObjects
from perception.types import Bool, Boxes3D, Float64, Int

_ARROW_S = 1.0
_ARROW_HEAD_M = 0.6
# Share of a box's top that is filled, from its front.
_FRONT_SHARE = 0.22
_PREDICTED_LIGHT = 0.55


class ObjectPart(IntEnum):
    """Part of an object that a line belongs to, in drawing order."""

    OLD_PATH = 0
    PATH = 1
    NEW_PATH = 2
    BOX = 3
    ARROW = 4


@dataclass(frozen=True)
class ObjectFigures:
    """Lines and faces of T objects.

    Attributes:
        objects: (T) objects, the farthest first.
        segments_m: (S, 2, 3) end points of the lines in the LiDAR frame.
        numbers: (S,) part * T + row of the object of each line.
        faces_m: (F, 4, 3) corners of the fronts and of the front parts of the tops, clockwise from outside.
        face_rows: (F,) row of the object of each face.
    """

    objects: SceneObjects
    segments_m: Float64
    numbers: Int
    faces_m: Float64
    face_rows: Int

    @cached_property
    def colors(self) -> list[Color]:
        """Colour of each object, faint of one that is not observed."""
        objects = self.objects
        return [
            palette.dimmed(
                palette.TRACKED_OBJECT if is_selected else _color(number, name),
                1.0 if is_observed else _PREDICTED_LIGHT,
            )
            for number, name, is_selected, is_observed in zip(
                objects.colors.tolist(),
                objects.types.tolist(),
                objects.is_selected.tolist(),
                objects.is_observed.tolist(),
                strict=True,
            )
        ]

    @cached_property
    def texts(self) -> dict[int, tuple[str, Color, str, bool, Color | None]]:
        """Content of the label of each object by its row: the selected one first, then what moves, the nearest first."""
        objects = self.objects
        ranks = (objects.distances_m, ~objects.is_moving, ~objects.is_selected)
        return {
            row: (
                _name(objects, row),
                self.colors[row],
                _details(objects, row),
                not objects.is_observed[row],
                palette.CLASSES.get(str(objects.types[row])),
            )
            for row in np.lexsort(ranks).tolist()
        }


def object_figures(objects: SceneObjects, paths_velo: Sequence[Float64]) -> ObjectFigures:
    """Return the lines and faces of objects.

    Args:
        objects: (T) objects in the LiDAR frame.
        paths_velo: (K, 3) path of each object in the LiDAR frame.
    """
    rows = np.argsort(-objects.distances_m, kind="stable")
    objects, count = objects[rows], len(objects)
    paths_m, path_numbers = _paths([paths_velo[row] for row in rows])
    arrows_m, arrow_rows = _arrows(objects)
    box_rows = np.flatnonzero(objects.has_box)
    boxes_m = edges(objects.boxes[box_rows])
    lines = (
        path_numbers,
        ObjectPart.BOX * count + np.repeat(box_rows, boxes_m.shape[1]),
        ObjectPart.ARROW * count + arrow_rows,
    )
    front_rows = np.flatnonzero(objects.has_box & objects.has_front)
    return ObjectFigures(
        objects,
        np.concatenate([paths_m, boxes_m.reshape(-1, 2, 3), arrows_m]),
        np.concatenate(lines).astype(np.int64),
        _fronts(objects.boxes[front_rows]),
        np.tile(front_rows, 2),
    )


def _paths(paths_velo: Sequence[Float64]) -> tuple[Float64, Int]:
    """Return the segments of all paths and their numbers: thirds of old, middle and new segments."""
    pieces = [np.stack([path[:-1], path[1:]], axis=1) for path in paths_velo]
    numbers = [
        np.arange(len(piece)) * 3 // max(len(piece), 1) * len(pieces) + row
        for row, piece in enumerate(pieces)
    ]
    paths_m = np.concatenate([np.zeros((0, 2, 3)), *pieces])
    # The vehicle hides the segments below it.
    is_free = ~_is_under_vehicle(paths_m).all(axis=1)
    return paths_m[is_free], np.concatenate([np.zeros(0, np.int64), *numbers])[is_free]


def _is_under_vehicle(points_velo: Float64) -> Bool:
    outline = vehicle_outline_m()
    low, high = outline.min(axis=0), outline.max(axis=0)
    return np.asarray(((points_velo[..., :2] > low) & (points_velo[..., :2] < high)).all(axis=-1))


def _arrows(objects: SceneObjects) -> tuple[Float64, Int]:
    """Return shaft and two barbs of the velocity arrow of each moving object, and their rows.

    An arrow lies on the ground, starts at the side of the box, and is as long as the path of one second.
    """
    rows = np.flatnonzero(objects.is_moving & objects.has_box)
    moving = objects[rows]
    speeds_m_s = moving.speeds_m_s[:, None]
    along = np.pad(moving.velocities_m_s / speeds_m_s, ((0, 0), (0, 1)))
    left = along[:, [1, 0, 2]] * (-1, 1, 0)
    tail = moving.boxes.bottom_m + _inside_m(moving.boxes, along) * along
    length_m = _ARROW_S * speeds_m_s
    tip = tail + length_m * along
    head_m = np.minimum(_ARROW_HEAD_M, 0.4 * length_m)
    barbs = [tip - head_m * along + side * 0.6 * head_m * left for side in (1, -1)]
    segments = np.stack([np.stack([end, tip], axis=1) for end in (tail, *barbs)], axis=1)
    return segments.reshape(-1, 2, 3), np.repeat(rows, 3)


def _inside_m(boxes: Boxes3D, along: Float64) -> Float64:
    """Return the (M, 1) distance from the centre of each box to its side along a direction."""
    turn_rad = np.arctan2(along[:, 1], along[:, 0]) - boxes.yaw_rad
    share = np.abs(np.column_stack([np.cos(turn_rad), np.sin(turn_rad)]))
    distances_m = boxes.size_m[:, :2] / 2 / np.maximum(share, 1e-9)
    return np.asarray(distances_m.min(axis=1, keepdims=True))


def _fronts(boxes: Boxes3D) -> Float64:
    """Return the front faces of all boxes, then the front parts of all tops."""
    points = corners(boxes)
    top, rear_top = points[:, [4, 7]], points[:, [5, 6]]
    behind = top + _FRONT_SHARE * (rear_top - top)
    return np.concatenate([points[:, [0, 3, 7, 4]], np.hstack([top, behind[:, ::-1]])])


def _color(number: int, name: str) -> Color:
    """Return the colour of a track, or of a class where there is no track."""
    return palette.track_color(number) if number >= 0 else palette.class_color(name)


def _name(objects: SceneObjects, row: int) -> str:
    """Return class and distance, as far as they are known."""
    distance_m = objects.distances_m[row]
    parts = [str(objects.types[row]), f"{distance_m:.0f} m" if np.isfinite(distance_m) else ""]
    return " ".join(part for part in parts if part)


def _details(objects: SceneObjects, row: int) -> str:
    """Return id, speed and status, as far as they are known."""
    status, track = str(objects.statuses[row]), int(objects.ids[row])
    parts = [f"#{track}"] if track >= 0 else []
    if objects.is_moving[row]:
        parts.append(f"{objects.speeds_m_s[row]:.1f} m/s")
    if status and not objects.is_observed[row]:
        parts.append(status)
    return "  ".join(parts)
