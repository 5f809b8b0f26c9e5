"""Boxes of objects of which every point is labelled, as instances of SemanticKITTI are.

A box is fitted to the points of an instance in each scan. Over a drive with poses an object has one size, and one box while it is
parked; without poses each scan is on its own.
"""

import logging
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from data.derived.motion_labels import PosedLabels
from data.file_drive import FileDrive
from data.kitti.labels import empty_labels
from data.label_proposals.observations import OTHER_GROUP, Observations
from data.label_proposals.trajectory import fit_trajectory
from data.labelled_objects import labels_of_boxes
from data.labels_in_view import labels_of_camera
from data.reflectance import sample_indices
from perception.detection.bev.bev_map import BevGrid, BevMapper
from perception.detection.bev.classes import GROUPS
from perception.detection.vehicles.config import VehicleConfig
from perception.detection.vehicles.l_shape_fit import ImageSpans, Rectangles
from perception.detection.vehicles.locate import fit_outlines, likely_headings_rad
from perception.errors import LabelError
from perception.geometry.boxes import transform_boxes
from perception.geometry.se3 import inverse
from perception.tracking.vehicles.class_sizes import SizePriors
from perception.types import Boxes3D, Float64, Int, Labels, PointTruth, Progress

log = logging.getLogger(__name__)
_TYPES = {10: "Car", 11: "Bicycle", 13: "Bus", 15: "Motorcycle", 16: "Tram", 18: "Truck", 20: "Misc",
          30: "Pedestrian", 31: "Cyclist", 32: "Motorcycle"}  # fmt: skip
_MIN_POINTS = 5
_FEW_POINTS = 10.0  # of a box as good as not
_SAMPLES = 64  # points of each object that its box is fitted to
_SIZE_SHARE = 0.9  # hidden parts make a box smaller, nothing makes it larger
_FOCAL_PX, _MIDDLE_PX = 40.0, 5000  # so coarse that what hides a side counts little
# Of a camera at the place of the LiDAR.
_CAMERA = np.array(
    [[_MIDDLE_PX, -_FOCAL_PX, 0.0, 0.0], [0.0, 0.0, -_FOCAL_PX, 0.0], [1.0, 0.0, 0.0, 0.0]]
)
Unlabelled = TypeVar("Unlabelled", bound=FileDrive)
Labelled = TypeVar("Labelled", bound="InstanceLabels")


@dataclass(frozen=True)
class InstanceBoxes:
    """Boxes of the instances of a drive.

    Attributes:
        drive: The whole drive, without labels of boxes.
        progress: Progress bar over the frames to which boxes are fitted.
    """

    drive: FileDrive
    progress: Progress = field(default=iter, compare=False)

    def at(self, name: str) -> Labels:
        """Return the labels of all objects around in a frame of a name; the drive is read at the first."""
        return self._labels.get(name, empty_labels())

    @cached_property
    def _labels(self) -> Mapping[str, Labels]:
        drive, mapper = self.drive, BevMapper(self.drive.sensor, BevGrid())
        log.warning("%s: fitting boxes to the instances of all %d scans", drive.name, len(drive))
        found = [self._observe(index, mapper) for index in self.progress(range(len(drive)))]
        keys = np.concatenate([keys for keys, _ in found])
        seen = Observations.concatenate([one for _, one in found])
        if not len(seen):
            return {}
        groups = keys if drive.has_poses else np.column_stack([keys, seen.frames])
        owners = np.unique(groups, axis=0, return_inverse=True)[1].ravel()
        ids = np.unique(keys, return_inverse=True)[1]
        frames = np.arange(len(drive))
        stamps_s = np.array([drive.stamp_s(index) for index in frames.tolist()])
        boxes: dict[int, list[tuple[Boxes3D, str, int]]] = defaultdict(list)
        for rows in np.split(
            np.argsort(owners, kind="stable"), np.cumsum(np.bincount(owners))[:-1]
        ):
            whole = fit_trajectory(seen[rows], frames, stamps_s, _SIZE_SHARE)
            at = np.flatnonzero(whole.is_observed)
            for place, row in zip(at.tolist(), rows.tolist(), strict=True):
                one = whole.boxes_world[place : place + 1], str(seen.types[row]), int(ids[row])
                boxes[int(whole.frames[place])].append(one)
        return {
            drive.frame_names[index]: self._labels_of(index, ones) for index, ones in boxes.items()
        }

    def _labels_of(self, index: int, objects: list[tuple[Boxes3D, str, int]]) -> Labels:
        boxes, types, ids = zip(*objects, strict=True)
        boxes_velo = transform_boxes(
            inverse(self.drive.map_SE3_velo(index)), Boxes3D.concatenate(boxes)
        )
        return labels_of_boxes(boxes_velo, types, np.array(ids, np.int64))

    def _observe(self, index: int, mapper: BevMapper) -> tuple[Int, Observations]:
        """Return the (R,) keys of the instances of a frame, and the box of each by this scan."""
        drive, points_velo = self.drive, self.drive.points_velo(index)
        truth = drive.point_truth(index)
        of_point: Int = np.zeros(0, np.int64) if truth is None else _keys(truth)
        found, owners, counts = np.unique(of_point, return_inverse=True, return_counts=True)
        keys = found.astype(np.int64)
        order, starts = np.argsort(owners, kind="stable"), np.cumsum(counts) - counts
        rows = np.flatnonzero((keys > 0) & (counts >= _MIN_POINTS))
        if not len(rows):
            return keys[:0], Observations.empty()
        picked = (np.arange(_SAMPLES) + 0.5) / _SAMPLES * counts[rows, None]
        samples_m = points_velo[order[starts[rows, None] + picked.astype(np.int64)], :2]
        types = np.array([_TYPES[key & 0xFF] for key in keys[rows].tolist()], np.str_)
        outlines = _outlines(samples_m.astype(np.float64), SizePriors.of(types))
        tops_m = np.maximum.reduceat(points_velo[order, 2], starts)[rows]
        ground_m = mapper.ground(points_velo).height_m(outlines.centers_m)
        boxes = Boxes3D(
            np.column_stack([outlines.centers_m, ground_m]),
            np.column_stack([outlines.sizes_m, np.maximum(tops_m - ground_m, 0.1)]),
            likely_headings_rad(outlines, VehicleConfig()),
        )
        pose, count = drive.map_SE3_velo(index), len(rows)
        return keys[rows], Observations(
            frames=np.full(count, index),
            stamps_s=np.full(count, drive.stamp_s(index)),
            boxes_world=transform_boxes(pose, boxes),
            types=types,
            groups=np.array([GROUPS.get(one, OTHER_GROUP) for one in types.tolist()], np.int64),
            scores=counts[rows] / (counts[rows] + _FEW_POINTS),
            velocities_m_s=np.full((count, 2), np.nan),
            points=counts[rows],
            sensors_world=np.tile(pose[:2, 3], (count, 1)),
        )


@dataclass(frozen=True, kw_only=True)
class InstanceLabels(FileDrive):
    """A drive whose labels are the boxes of instances of points.

    Attributes:
        instance_boxes: Boxes of the whole drive.
    """

    instance_boxes: InstanceBoxes

    @property
    def has_labels(self) -> bool:
        """Whether there are labelled boxes: yes."""
        return True

    def labels(self, index: int) -> Labels:
        """Return the labels of the objects in the view of the camera, of the virtual one without a camera."""
        return labels_of_camera(self.labels_around(index), self, index)

    def labels_around(self, index: int) -> Labels:
        """Return the labels of all objects around."""
        return self.instance_boxes.at(self.frame_names[index])

    def other_labels(self) -> list[PosedLabels]:
        """Return none: all labels are of scans."""
        return []


def _outlines(samples_m: Float64, sizes: SizePriors) -> Rectangles:
    """Return F outlines by the (F, P, 2) points of each, each as a camera that faces it would show them."""
    azimuth_rad = np.arctan2(*np.median(samples_m, axis=1).T[::-1])
    cos, sin = np.cos(azimuth_rad), np.sin(azimuth_rad)
    turns = np.moveaxis(np.array([[cos, -sin], [sin, cos]]), -1, 0)  # (F, 2, 2)
    faced_m = samples_m @ turns
    columns_px = _CAMERA[0, 0] - faced_m[..., 1] / np.maximum(faced_m[..., 0], 1.0) * _FOCAL_PX
    left_right_px = np.column_stack([columns_px.min(axis=1), columns_px.max(axis=1)])
    spans = ImageSpans(left_right_px, _CAMERA, 2 * _MIDDLE_PX, np.zeros(len(sizes)))
    faced = fit_outlines(faced_m, sizes, spans)
    centers_m = (turns @ faced.centers_m[..., None])[..., 0]
    return replace(faced, centers_m=centers_m, yaw_rad=faced.yaw_rad + azimuth_rad)


def labelled_by_instances(
    drive: Unlabelled, kind: type[Labelled], progress: Progress
) -> Unlabelled | Labelled:
    """Return a drive with boxes of its instances; as it is with others, or where some scans number no object.

    Args:
        drive: The whole drive, without labels of boxes.
        kind: Class of such drives with boxes.
        progress: Progress bar over the frames to which boxes are fitted.
    """
    if drive.has_labels or not _has_instances(drive):
        return drive
    parts = {one.name: getattr(drive, one.name) for one in fields(drive) if one.init}
    return kind(**parts, instance_boxes=InstanceBoxes(drive, progress))


def _has_instances(drive: FileDrive) -> bool:
    if not drive.has_point_truth:
        return False
    for index in sample_indices(len(drive)):
        try:
            truth = drive.point_truth(index)
        except LabelError:
            continue  # reported when the frame is read
        if truth is not None and (_keys(truth) > 0).any():
            return True
    return False


def _keys(truth: PointTruth) -> Int:
    """Return the (N,) key of the instance of each point, with its class in the low 8 bits; 0 of what has no box."""
    is_object = np.isin(truth.classes, list(_TYPES)) & (truth.instances > 0)
    return np.where(is_object, truth.instances << 8 | truth.classes, 0)
