"""Boxes of KITTI-360, in OpenCV's XML: static ones once, those that move at each frame.

    <opencv_storage>
      <object1>
        <label>car</label> <instanceId>7</instanceId> <timestamp>-1</timestamp>    -1: static; else the frame
        <start_frame>2</start_frame> <end_frame>282</end_frame>    window in which it was annotated
        <transform> <data> 4 x 4: mesh to world, with the size of the object </data> </transform>
        <vertices> <data> 8 x 3: mesh, x forward and z up </data> </vertices>

A drive is annotated window by window, of some 200 m each: a static box is also seen from the windows before and after.
"""

from collections import Counter
from collections.abc import Hashable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from data.kitti360.storage import StoredObject, read_storage
from perception.errors import LabelError
from perception.geometry.se3 import wrap
from perception.types import ArrayTable, Boxes3D, Float64, Int

# Types of KITTI's labels by label; what has others, such as road and building, is no object on the road. KITTI knows no
# bus: buses are trucks. A bicycle is labelled apart from its rider, who is the cyclist.
_TYPES = {
    "car": "Car", "truck": "Truck", "bus": "Truck", "train": "Tram",
    "person": "Pedestrian", "pedestrian": "Pedestrian", "rider": "Cyclist",
    "bicycle": "Misc", "motorcycle": "Misc", "caravan": "Misc", "trailer": "Misc", "unknownvehicle": "Misc",
    "trashbin": "Misc", "vendingmachine": "Misc", "box": "Misc",
}  # fmt: skip
_NAMES = {
    "label", "instanceId", "timestamp", "start_frame", "end_frame", "transform/data", "vertices/data",
}  # fmt: skip
_STATIC = -1
_MAX_GAP = 5  # frames between two boxes of an object that moves, between which it is interpolated


@dataclass(frozen=True)
class AnnotatedBoxes(ArrayTable):
    """R boxes of a drive.

    Attributes:
        boxes_world: (R) boxes in the world of the file.
        types: (R,) types of KITTI's labels.
        track_ids: (R,) ids of objects.
        frames: (R,) frame of a box that moves, -1 of a static one.
        windows: (R,) row of the window in which each was annotated.
    """

    boxes_world: Boxes3D
    types: np.ndarray
    track_ids: Int
    frames: Int
    windows: Int

    def near(self, place_m: Float64, reach_m: float) -> "AnnotatedBoxes":
        """Return the boxes within a distance of a place in metres."""
        offsets_m = self.boxes_world.bottom_m[:, :2] - place_m[:2]
        return self[np.linalg.norm(offsets_m, axis=1) <= reach_m]


@dataclass(frozen=True)
class DriveBoxes:
    """Boxes of a drive, read when they are asked for first.

    Attributes:
        path: XML file.
    """

    path: Path

    def is_annotated(self, frame: int) -> bool:
        """Return whether a frame lies in a window that was annotated.

        Raises:
            LabelError: The file cannot be read, or a box is no box.
        """
        return bool(((self._windows[:, 0] <= frame) & (frame <= self._windows[:, 1])).any())

    def at(self, frame: int) -> AnnotatedBoxes:
        """Return the boxes of a frame, static ones however far away; raise as `is_annotated`."""
        static, moving = self._static, self._moving
        spans = self._spans[static.windows]
        seen = static[(spans[:, 0] <= frame) & (frame <= spans[:, 1])]
        # Where windows overlap, an object may have been annotated in both.
        starts, ends = self._windows[seen.windows].T
        order = np.lexsort((np.maximum(starts - frame, frame - ends), seen.track_ids))
        nearest = order[np.unique(seen.track_ids[order], return_index=True)[1]]
        return AnnotatedBoxes.concatenate(
            (seen[nearest], moving[moving.frames == frame], self._interpolated(frame))
        )

    def _interpolated(self, frame: int) -> AnnotatedBoxes:
        """Return the boxes of objects that are annotated shortly before and after a frame, but not in it."""
        moving = self._moving
        is_pair = (np.diff(moving.track_ids) == 0) & (np.diff(moving.frames) <= _MAX_GAP)
        is_pair &= (moving.frames[:-1] < frame) & (frame < moving.frames[1:])
        rows = np.flatnonzero(is_pair)
        first, second = moving[rows], moving[rows + 1]
        shares = ((frame - first.frames) / (second.frames - first.frames))[:, None]
        here, there = first.boxes_world, second.boxes_world
        turns_rad = wrap(there.yaw_rad - here.yaw_rad)
        between = Boxes3D(
            here.bottom_m + shares * (there.bottom_m - here.bottom_m),
            here.size_m,
            here.yaw_rad + shares[:, 0] * turns_rad,
        )
        return AnnotatedBoxes(between, first.types, first.track_ids, first.frames, first.windows)

    @cached_property
    def _static(self) -> AnnotatedBoxes:
        return self._content[0][self._content[0].frames == _STATIC]

    @cached_property
    def _moving(self) -> AnnotatedBoxes:
        moving = self._content[0][self._content[0].frames != _STATIC]
        return moving[np.lexsort((moving.frames, moving.track_ids))]

    @property
    def _windows(self) -> Int:
        """(W, 2) first and last frames, rising."""
        return self._content[1]

    @cached_property
    def _spans(self) -> Int:
        """(W, 2) first and last frame of each window and of those that adjoin it."""
        starts, ends = self._windows.T
        adjoins = starts[1:] <= ends[:-1] + 1
        spans = self._windows.copy()
        spans[1:, 0] = np.where(adjoins, starts[:-1], starts[1:])
        spans[:-1, 1] = np.where(adjoins, np.maximum(ends[1:], ends[:-1]), ends[:-1])
        return spans

    @cached_property
    def _content(self) -> tuple[AnnotatedBoxes, Int]:
        """All boxes, and the windows of these and of all other objects."""
        collected = _BoxCollector()
        read_storage(self.path, _NAMES, collected.add)
        return collected.boxes(), np.array(collected.windows, np.int64).reshape(-1, 2)


class _BoxCollector:
    """Collects the objects of a file."""

    def __init__(self) -> None:
        self._windows: set[tuple[int, int]] = set()
        self._objects: list[_BoxOfObject] = []
        self._track_ids: dict[Hashable, int] = {}
        self._counts: Counter[Hashable] = Counter()

    def add(self, stored: StoredObject) -> None:
        """Add an object.

        Raises:
            LabelError: It lacks an element, or is no box.
        """
        first, last = window = stored.whole("start_frame"), stored.whole("end_frame")
        if first > last:
            expected, found = "a start_frame up to the end_frame", f"{first} and {last}"
            raise LabelError(stored.where, expected=expected, found=found)
        self._windows.add(window)
        label = "".join(filter(str.isalnum, stored.text("label").lower()))
        if label not in _TYPES:
            return
        frame, instance = max(stored.whole("timestamp"), _STATIC), stored.whole("instanceId")
        # An object may be put together of several boxes, which are told apart by their order.
        place = (label, instance, frame, window if frame == _STATIC else None)
        self._counts[place] += 1
        name = (label, instance, frame == _STATIC) if instance > 0 else place
        key = (name, self._counts[place])
        track_id = self._track_ids.setdefault(key, len(self._track_ids))
        self._objects.append(_BoxOfObject(_box(stored), _TYPES[label], track_id, frame, window))

    @property
    def windows(self) -> list[tuple[int, int]]:
        """First and last frames of all windows, rising."""
        return sorted(self._windows)

    def boxes(self) -> AnnotatedBoxes:
        """Return all boxes."""
        row_of = {window: row for row, window in enumerate(self.windows)}
        numbers = np.array([one.numbers for one in self._objects]).reshape(-1, 7)
        return AnnotatedBoxes(
            Boxes3D(numbers[:, :3], numbers[:, 3:6], numbers[:, 6]),
            np.array([one.kind for one in self._objects], np.str_),
            np.array([one.track_id for one in self._objects], np.int64),
            np.array([one.frame for one in self._objects], np.int64),
            np.array([row_of[one.window] for one in self._objects], np.int64),
        )


class _BoxOfObject(NamedTuple):
    """A row of `AnnotatedBoxes`, its box as (7,) numbers."""

    numbers: Float64
    kind: str
    track_id: int
    frame: int
    window: tuple[int, int]


def _box(stored: StoredObject) -> Float64:
    """Return (7,) bottom centre, length, width, height and yaw of an object.

    Raises:
        LabelError: Its mesh or its transform has no size.
    """
    transform, mesh_m = stored.rows("transform", 4), stored.rows("vertices", 3)
    axes = transform[:3, :3]
    scales = np.linalg.norm(axes, axis=0)
    size_m = np.ptp(mesh_m, axis=0) * scales
    if len(transform) != 4 or not (size_m > 0).all():
        expected = "a transform of 4 x 4 numbers, and a box with a size"
        found = f"{len(transform)} x 4 numbers and {size_m.round(2).tolist()} m"
        raise LabelError(stored.where, expected=expected, found=found)
    centre_m = axes @ (mesh_m.min(axis=0) + mesh_m.max(axis=0)) / 2 + transform[:3, 3]
    up = axes[:, 2] / scales[2]
    bottom_m = centre_m - np.copysign(size_m[2] / 2, up[2]) * up
    return np.array([*bottom_m, *size_m, np.arctan2(axes[1, 0], axes[0, 0])])
