"""Annotated boxes of a scene at any time: those of the key frames, and between two of them on the way from one to the other."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from data.labelled_objects import labels_of_boxes
from data.nuscenes.categories import category
from data.nuscenes.scene_tables import Annotation, SceneTables
from perception.geometry.boxes import transform_boxes
from perception.geometry.se3 import inverse, wrap
from perception.types import Boxes3D, Float64, Labels


@dataclass(frozen=True)
class SceneBoxes:
    """Boxes of a scene.

    Attributes:
        tables: Tables of the scene.
    """

    tables: SceneTables

    @property
    def is_empty(self) -> bool:
        """Whether no sample has a box."""
        return not self.tables.annotations

    @cached_property
    def track_ids(self) -> Mapping[str, int]:
        """Number of each object, from 0 in the order of their names."""
        names = {box.instance for boxes in self.tables.annotations.values() for box in boxes}
        return {name: number for number, name in enumerate(sorted(names))}

    def around(self, stamp_us: int, world_SE3_velo: Float64) -> Labels:
        """Return the labels of all objects around at a time; they have no boxes in the image.

        Args:
            stamp_us: Time in microseconds.
            world_SE3_velo: (4, 4) pose of the LiDAR in the world of the tables at that time.
        """
        boxes = self._at(stamp_us)
        kinds = [category(box.category, box.attributes).kind for box in boxes]
        boxes = [box for box, kind in zip(boxes, kinds, strict=True) if kind is not None]
        return labels_of_boxes(
            transform_boxes(inverse(world_SE3_velo), _boxes_world(boxes)),
            [kind for kind in kinds if kind is not None],
            np.array([self.track_ids[box.instance] for box in boxes], np.int64),
        )

    def _at(self, stamp_us: int) -> list[Annotation]:
        samples, stamps_us = list(self.tables.stamps_us), list(self.tables.stamps_us.values())
        after = int(np.searchsorted(stamps_us, stamp_us))
        if after < len(samples) and stamps_us[after] == stamp_us:
            return list(self.tables.annotations.get(samples[after], ()))
        if after in (0, len(samples)):
            return []  # nothing is known before the first key frame and after the last
        share = (stamp_us - stamps_us[after - 1]) / (stamps_us[after] - stamps_us[after - 1])
        here = self.tables.annotations.get(samples[after - 1], ())
        there = {box.instance: box for box in self.tables.annotations.get(samples[after], ())}
        return [_between(box, there[box.instance], share) for box in here if box.instance in there]


def _between(first: Annotation, second: Annotation, share: float) -> Annotation:
    turn = (first.world_R_box.inv() * second.world_R_box).as_rotvec()
    return Annotation(
        instance=first.instance,
        category=first.category,
        attributes=first.attributes,
        centre_m=first.centre_m + share * (second.centre_m - first.centre_m),
        size_m=first.size_m,
        world_R_box=first.world_R_box * type(first.world_R_box).from_rotvec(share * turn),
    )


def _boxes_world(boxes: list[Annotation]) -> Boxes3D:
    if not boxes:
        return Boxes3D.empty()
    return standing_boxes(
        np.stack([box.centre_m for box in boxes]),
        np.stack([box.size_m for box in boxes]),
        np.stack([box.world_R_box.as_matrix() for box in boxes]),
    )


def standing_boxes(centres_m: Float64, size_m: Float64, world_R_box: Float64) -> Boxes3D:
    """Return upright boxes in the world of the tables.

    Args:
        centres_m: (M, 3) centres.
        size_m: (M, 3) length, width, height.
        world_R_box: (M, 3, 3) rotations, whose x is the heading.
    """
    return Boxes3D(
        centres_m - world_R_box[:, :, 2] * size_m[:, 2:] / 2,
        size_m,
        wrap(np.arctan2(world_R_box[:, 1, 0], world_R_box[:, 0, 0])),
    )
