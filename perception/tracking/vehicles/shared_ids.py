"""Common ids of detected vehicles and moving objects: one object has one id in both lists.

All ids come from one counter. A moving object gets the next id when it is first reported, a vehicle when it is
confirmed. If they overlap then, the later one takes the id of the earlier one. If both have an id already and overlap
for some time, the moving object takes the vehicle's. The id of a vehicle never changes, and that of a moving object at
most once for each vehicle that it turns out to be. They stay bound until they have been apart for as long.
"""

from dataclasses import replace

import numpy as np

from perception.geometry.box_overlap import iou_bev
from perception.tracking.association import assign_hungarian
from perception.tracking.track_table import ROUNDING_S
from perception.types import Bool, Boxes3D, Float64, Int, Tracks

_MIN_IOU = 0.15  # minimum IoU on the ground of the vehicle and the track
# Time from the first to the last of some scans in a row, together before two ids become one, apart before one becomes two.
_LASTING_S = 0.2
# Maximum number of moving objects whose ids are remembered: more than are ever reported within a minute.
_REMEMBERED = 1000


class SharedIds:
    """Assigns ids to vehicles and to moving objects, scan after scan."""

    def __init__(self) -> None:
        self._next_id = 0
        self.clear()

    def clear(self) -> None:
        """Forget all assignments; ids are not used again."""
        # Id of each moving object, by its number in its tracker; an object that is not reported may be again.
        self._id_of: dict[int, int] = {}
        # Time since which a vehicle's id and a tracker's number have been together.
        self._together: dict[tuple[int, int], float] = {}
        # Time since which a moving object has been apart from its vehicle.
        self._apart: dict[int, float] = {}

    def share(
        self, stamp_s: float, vehicle_ids: Int, is_new: Bool, boxes: Boxes3D, tracks: Tracks
    ) -> tuple[Int, Tracks]:
        """Return the ids of V vehicles, and the moving objects with their common ids.

        Args:
            stamp_s: Time of the scan.
            vehicle_ids: (V,) present ids; -1 of vehicles without one.
            is_new: (V,) whether a vehicle without an id gets one.
            boxes: (V) boxes of the vehicles; rows of NaN where they are not known.
            tracks: Moving objects in the same frame, with the ids of their own tracker.
        """
        numbers = tracks.ids.tolist()
        overlap = _overlap(boxes, tracks.boxes)
        partners = self._partners(overlap)
        ids = self._with_new(vehicle_ids, is_new, partners, numbers)
        self._bind_new(ids, partners, numbers)
        lasting_s = stamp_s - _LASTING_S + ROUNDING_S
        self._bind_lasting(ids, partners, numbers, stamp_s, lasting_s)
        self._split(ids, overlap, numbers, stamp_s, lasting_s)
        shared = np.array([self._id_of[number] for number in numbers], np.int64)
        return ids, replace(tracks, ids=shared)[np.argsort(shared)]

    def _take_next(self) -> int:
        self._next_id += 1
        return self._next_id - 1

    def _partners(self, overlap: Float64) -> dict[int, int]:
        """Return the row of the moving object that each vehicle overlaps."""
        pairs = assign_hungarian(1.0 - overlap, overlap >= _MIN_IOU)
        return dict(zip(pairs.tracks.tolist(), pairs.detections.tolist(), strict=True))

    def _with_new(
        self, vehicle_ids: Int, is_new: Bool, partners: dict[int, int], numbers: list[int]
    ) -> Int:
        """Give ids to new vehicles: that of the overlapping moving object, unless another vehicle has it."""
        ids = vehicle_ids.copy()
        for row in np.flatnonzero(is_new).tolist():
            number = numbers[partners[row]] if row in partners else None
            shared = None if number is None else self._id_of.get(number)
            ids[row] = self._take_next() if shared is None or shared in ids else shared
        return ids

    def _bind_new(self, ids: Int, partners: dict[int, int], numbers: list[int]) -> None:
        """Give ids to new moving objects: that of the overlapping vehicle, unless another one has it."""
        rows = {track: vehicle for vehicle, track in partners.items()}
        for track, number in enumerate(numbers):
            if number in self._id_of:
                continue
            vehicle_id = int(ids[rows[track]]) if track in rows else -1
            is_free = vehicle_id >= 0 and vehicle_id not in self._ids_in_use(numbers)
            self._assign_id(number, vehicle_id if is_free else self._take_next())

    def _bind_lasting(
        self,
        ids: Int,
        partners: dict[int, int],
        numbers: list[int],
        stamp_s: float,
        lasting_s: float,
    ) -> None:
        """Give moving objects the id of a vehicle that they have overlapped for some time."""
        together: dict[tuple[int, int], float] = {}
        for row, track in partners.items():
            vehicle, number = int(ids[row]), numbers[track]
            if vehicle < 0 or self._id_of[number] == vehicle or self._id_of[number] in ids:
                continue
            pair = (vehicle, number)
            together[pair] = self._together.get(pair, stamp_s)
            if together[pair] <= lasting_s and vehicle not in self._ids_in_use(numbers):
                self._assign_id(number, vehicle)
                del together[pair]
        self._together = together

    def _split(
        self, ids: Int, overlap: Float64, numbers: list[int], stamp_s: float, lasting_s: float
    ) -> None:
        """Give a new id to a moving object that has been apart from the vehicle of its id for some time."""
        row_of = {vehicle: row for row, vehicle in enumerate(ids.tolist()) if vehicle >= 0}
        apart: dict[int, float] = {}
        for track, number in enumerate(numbers):
            row = row_of.get(self._id_of[number])
            if row is None or overlap[row, track] > 0.0:
                continue
            apart[number] = self._apart.get(number, stamp_s)
            if apart[number] <= lasting_s:
                self._assign_id(number, self._take_next())
                del apart[number]
        self._apart = apart

    def _assign_id(self, number: int, shared: int) -> None:
        """Give an id to a moving object; an unreported one that had it loses it."""
        others = {key: value for key, value in self._id_of.items() if value != shared}
        latest = list(others.items())[-_REMEMBERED:]
        self._id_of = {**dict(latest), number: shared}

    def _ids_in_use(self, numbers: list[int]) -> set[int]:
        return {self._id_of[number] for number in numbers if number in self._id_of}


def _overlap(vehicles: Boxes3D, objects: Boxes3D) -> Float64:
    """Return (V, T) IoU on the ground; NaN of a vehicle whose box is not known."""
    overlap = np.full((len(vehicles), len(objects)), np.nan)
    known = np.flatnonzero(np.isfinite(vehicles.bottom_m).all(axis=1))
    if len(known) and len(objects):
        overlap[known] = iou_bev(vehicles[known], objects)
    return overlap
