"""What readers of annotated data sets share: names of categories in KITTI and SemanticKITTI, and points within boxes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perception.evaluation.nuscenes.protocol import CLASSES
from perception.geometry.boxes import points_inside
from perception.types import Boxes3D, Float, Int, Labels

_MARGIN_M = (
    0.1  # by which boxes are grown but for their bottom, as for Argoverse 2's own labels of points
)
_UNKNOWN_OCCLUSION = 3
_NO_BOX_PX = -1.0


@dataclass(frozen=True)
class ObjectCategory:
    """Names of one category of a data set in other sets.

    Attributes:
        kind: Type of a label in KITTI; None of what has no box.
        point_class: Class of a point in SemanticKITTI.
        task_class: Class in nuScenes' detection task; None of what it does not count.
    """

    kind: str | None
    point_class: int
    task_class: str | None = None


# Class in nuScenes' detection task of each type of KITTI's.
_TASK_CLASSES = {
    "Car": "car",
    "Cyclist": "bicycle",
    "Pedestrian": "pedestrian",
    "Person": "pedestrian",
    "Person_sitting": "pedestrian",
    "Truck": "truck",
    "Van": "car",
}


def task_classes(types: Sequence[str]) -> np.ndarray:
    """Return (M,) classes in nuScenes' detection task of types of KITTI's, or of its own names in any case; else empty."""
    names = [_TASK_CLASSES.get(one, one.lower().replace(" ", "_")) for one in types]
    return np.array([one if one in CLASSES else "" for one in names], np.str_)


def box_owners(boxes_velo: Boxes3D, points_velo: Float) -> Int:
    """Return (N,) the row of the box around each point, of several the smallest; -1 without one."""
    owners = np.full(len(points_velo), -1)
    for row in np.argsort(-boxes_velo.size_m.prod(axis=1), kind="stable").tolist():
        inside = points_inside(boxes_velo[row : row + 1], points_velo, _MARGIN_M)[0]
        owners[inside] = row
    return owners


def labels_of_boxes(boxes_velo: Boxes3D, types: Sequence[str], track_ids: Int) -> Labels:
    """Return the labels of M objects around the vehicle, which have no boxes in the image.

    Args:
        boxes_velo: M boxes in the LiDAR frame.
        types: M types of KITTI's labels.
        track_ids: (M,) track ids.
    """
    count = len(boxes_velo)
    return Labels(
        boxes_velo=boxes_velo,
        boxes_px=np.full((count, 4), _NO_BOX_PX),
        types=np.array(types, np.str_),
        track_ids=track_ids,
        truncation=np.zeros(count),
        occlusion=np.full(count, _UNKNOWN_OCCLUSION),
        dont_care_px=np.zeros((0, 4)),
    )
