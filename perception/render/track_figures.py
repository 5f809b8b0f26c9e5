"""What is drawn of tracks, as lines and faces in the LiDAR frame, before any camera looks at them."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

import numpy as np

from perception.geometry.boxes import corners, edges
from perception.render.ego_vehicle import vehicle_outline_m
from perception.types import Bool, Boxes3D, Float64, Int, Tracks

_ARROW_S = 1.0
_SLOWEST_M_S = 0.4
_ARROW_HEAD_M = 0.6
# The part of a box' top that is filled, from its front on.
_FRONT_SHARE = 0.22


class TrackPart(IntEnum):
    """What a line belongs to, in the order in which they are drawn."""

    OLD_PATH = 0
    PATH = 1
    NEW_PATH = 2
    BOX = 3
    ARROW = 4


@dataclass(frozen=True)
class TrackFigures:
    """The lines and faces of T tracks. A line's number tells its part and its track: part * T + row.

    Attributes:
        tracks: (T) the farthest first.
        segments_m: (S, 2, 3) lines.
        numbers: (S,) of the lines.
        faces_m: (2 T, 4, 3) front of each box, then the front of each top, clockwise from outside.
    """

    tracks: Tracks
    segments_m: Float64
    numbers: Int
    faces_m: Float64

    @cached_property
    def speeds_m_s(self) -> Float64:
        """(T,) over the ground."""
        return np.asarray(np.hypot(*self.tracks.velocities_m_s.T))


def track_figures(tracks: Tracks, paths_velo: Sequence[Float64]) -> TrackFigures:
    """Make the figures of tracks.

    Args:
        tracks: (T) the tracks.
        paths_velo: (K, 3) way of each up to now, in the same frame.
    """
    rows = np.argsort(-np.hypot(*tracks.boxes.bottom_m[:, :2].T), kind="stable")
    tracks, count = tracks[rows], len(tracks)
    paths_m, path_numbers = _paths([paths_velo[row] for row in rows])
    arrows_m, arrow_rows = _arrows(tracks)
    boxes_m = edges(tracks.boxes)
    box_rows = np.repeat(np.arange(count), boxes_m.shape[1])
    numbers: Int = np.concatenate(
        [path_numbers, TrackPart.BOX * count + box_rows, TrackPart.ARROW * count + arrow_rows]
    ).astype(np.int64)
    segments_m = np.concatenate([paths_m, boxes_m.reshape(-1, 2, 3), arrows_m])
    return TrackFigures(tracks, segments_m, numbers, _fronts(tracks.boxes))


def _paths(paths_velo: Sequence[Float64]) -> tuple[Float64, Int]:
    """Return the pieces of all ways and their numbers: a third each of old, middle and new."""
    pieces = [np.stack([path[:-1], path[1:]], axis=1) for path in paths_velo]
    numbers = [
        np.arange(len(piece)) * 3 // max(len(piece), 1) * len(pieces) + row
        for row, piece in enumerate(pieces)
    ]
    paths_m = np.concatenate([np.zeros((0, 2, 3)), *pieces])
    # Where the vehicle stands now, it hides them.
    is_free = ~_is_under_vehicle(paths_m).all(axis=1)
    return paths_m[is_free], np.concatenate([np.zeros(0, np.int64), *numbers])[is_free]


def _is_under_vehicle(points_velo: Float64) -> Bool:
    outline = vehicle_outline_m()
    low, high = outline.min(axis=0), outline.max(axis=0)
    return np.asarray(((points_velo[..., :2] > low) & (points_velo[..., :2] < high)).all(axis=-1))


def _arrows(tracks: Tracks) -> tuple[Float64, Int]:
    """Return shaft and two barbs, flat on the ground, of each track that is not slow, and their rows.

    An arrow begins at the box' side and is as long as the way of one second.
    """
    speeds_m_s = np.hypot(*tracks.velocities_m_s.T)
    rows = np.flatnonzero(speeds_m_s > _SLOWEST_M_S)
    along = np.pad(tracks.velocities_m_s[rows] / speeds_m_s[rows, None], ((0, 0), (0, 1)))
    left = along[:, [1, 0, 2]] * (-1, 1, 0)
    tail = tracks.boxes.bottom_m[rows] + _inside_m(tracks.boxes[rows], along) * along
    length_m = _ARROW_S * speeds_m_s[rows, None]
    tip = tail + length_m * along
    head_m = np.minimum(_ARROW_HEAD_M, 0.4 * length_m)
    barbs = [tip - head_m * along + side * 0.6 * head_m * left for side in (1, -1)]
    segments = np.stack([np.stack([end, tip], axis=1) for end in (tail, *barbs)], axis=1)
    return segments.reshape(-1, 2, 3), np.repeat(rows, 3)


def _inside_m(boxes: Boxes3D, along: Float64) -> Float64:
    """Return (M, 1) how far it is from each box' middle to its side, along a direction of its own."""
    turn_rad = np.arctan2(along[:, 1], along[:, 0]) - boxes.yaw_rad
    share = np.abs(np.column_stack([np.cos(turn_rad), np.sin(turn_rad)]))
    paths_m = boxes.size_m[:, :2] / 2 / np.maximum(share, 1e-9)
    return np.asarray(paths_m.min(axis=1, keepdims=True))


def _fronts(boxes: Boxes3D) -> Float64:
    """Return the front of each box, and after all of these the foremost part of each top."""
    points = corners(boxes)
    top, rear_top = points[:, [4, 7]], points[:, [5, 6]]
    behind = top + _FRONT_SHARE * (rear_top - top)
    return np.concatenate([points[:, [0, 3, 7, 4]], np.hstack([top, behind[:, ::-1]])])
