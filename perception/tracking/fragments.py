"""Parts of one thing that a detector could not join, because nothing returns between them.

A roof seen through a gap in the beams, a seat behind glass, a far end behind a post: a scan alone
does not tell that they belong together. A track knows how large its thing is.
"""

import numpy as np

from perception.geometry.footprints import Footprints
from perception.tracking.visible_sides import from_world
from perception.types import Float64, Int


def join_fragments(
    things: Footprints, centers_m: Float64, sizes_m: Float64, yaw_rad: Float64, margin_m: float
) -> Footprints:
    """Join the things whose centroids lie within one box.

    Args:
        things: F.
        centers_m: (T, 2) of boxes where tracks are expected.
        sizes_m: (T, 2) their lengths and widths.
        yaw_rad: (T,) their headings.
        margin_m: by which the boxes are grown on every side.
    """
    if len(things) < 2 or len(yaw_rad) == 0:
        return things
    away_m = np.abs(from_world(things.centroids_m[None] - centers_m[:, None], yaw_rad))
    is_inside = (away_m <= sizes_m[:, None] / 2 + margin_m).all(axis=2)
    distances_m = np.where(is_inside, np.hypot(*np.moveaxis(away_m, -1, 0)), np.inf)
    own = len(yaw_rad) + np.arange(len(things))
    whole_of = np.where(is_inside.any(axis=0), distances_m.argmin(axis=0), own)
    _, whole_of = np.unique(whole_of, return_inverse=True)
    return things if int(whole_of.max()) + 1 == len(things) else _joined(things, whole_of)


def _joined(things: Footprints, whole_of: Int) -> Footprints:
    """Return W wholes from (F,) the number of each thing's whole; every number occurs."""
    order = np.argsort(np.repeat(whole_of, things.corners), kind="stable")
    points = np.bincount(whole_of, things.points)
    sums = [np.bincount(whole_of, things.points * xy_m) for xy_m in things.centroids_m.T]
    low_m, high_m = np.full(len(points), np.inf), np.full(len(points), -np.inf)
    np.minimum.at(low_m, whole_of, things.low_m)
    np.maximum.at(high_m, whole_of, things.high_m)
    return Footprints(
        vertices_m=things.vertices_m[order],
        corners=np.bincount(whole_of, things.corners).astype(np.int64),
        centroids_m=np.column_stack(sums) / points[:, None],
        low_m=low_m,
        high_m=high_m,
        points=points.astype(np.int64),
    )
