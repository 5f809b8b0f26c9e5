"""What readers of annotated data sets share: names of categories in KITTI and SemanticKITTI, and points within boxes."""

from dataclasses import dataclass

import numpy as np

from perception.geometry.boxes import points_inside
from perception.types import Boxes3D, Float, Int

_MARGIN_M = (
    0.1  # by which boxes are grown but for their bottom, as for Argoverse 2's own labels of points
)


@dataclass(frozen=True)
class ObjectCategory:
    """Names of one category of a data set in other sets.

    Attributes:
        kind: Type of a label in KITTI; None of what has no box.
        point_class: Class of a point in SemanticKITTI.
    """

    kind: str | None
    point_class: int


def box_owners(boxes_velo: Boxes3D, points_velo: Float) -> Int:
    """Return (N,) the row of the box around each point, of several the smallest; -1 without one."""
    owners = np.full(len(points_velo), -1)
    for row in np.argsort(-boxes_velo.size_m.prod(axis=1), kind="stable").tolist():
        inside = points_inside(boxes_velo[row : row + 1], points_velo, _MARGIN_M)[0]
        owners[inside] = row
    return owners
