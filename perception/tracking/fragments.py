"""Fragments of one object that a detector could not join, as there are no returns between them.

A roof above a gap between beams, a seat behind glass, a far end behind a post: one scan does not show that they belong
together. The track knows the size of its object.
"""

import numpy as np

from perception.geometry.footprints import Footprints
from perception.tracking.visible_sides import from_world
from perception.types import Bool, Float64, Int


def is_inside_boxes(
    positions_m: Float64, centers_m: Float64, sizes_m: Float64, yaw_rad: Float64
) -> Bool:
    """Return (T, F) whether each position lies within each box.

    Args:
        positions_m: (F, 2) positions.
        centers_m: (T, 2) centres of the boxes.
        sizes_m: (T, 2) lengths and widths of the boxes.
        yaw_rad: (T,) headings of the boxes.
    """
    away_m = np.abs(from_world(positions_m[None] - centers_m[:, None], yaw_rad))
    return np.asarray((away_m <= sizes_m[:, None] / 2).all(axis=2))


def join_fragments(clusters: Footprints, is_within: Bool, max_share: float) -> Footprints:
    """Join the small clusters within one box to the largest one there.

    Args:
        clusters: F clusters.
        is_within: (T, F) whether a cluster lies within a box; a cluster belongs to its first box.
        max_share: Maximum number of points of a fragment, as a share of those of the largest cluster.
    """
    if len(clusters) < 2 or not is_within.any():
        return clusters
    own = len(is_within) + np.arange(len(clusters))
    box_of = np.where(is_within.any(axis=0), is_within.argmax(axis=0), own)
    largest = np.zeros(int(box_of.max()) + 1, np.int64)
    np.maximum.at(largest, box_of, clusters.points)
    is_large = clusters.points > max_share * largest[box_of]
    is_largest = clusters.points == largest[box_of]
    _, whole_of = np.unique(np.where(is_large & ~is_largest, own, box_of), return_inverse=True)
    return clusters if int(whole_of.max()) + 1 == len(clusters) else _joined(clusters, whole_of)


def _joined(clusters: Footprints, whole_of: Int) -> Footprints:
    """Return W joined clusters by (F,) the number of the one that each belongs to; every number occurs."""
    order = np.argsort(np.repeat(whole_of, clusters.corners), kind="stable")
    points = np.bincount(whole_of, clusters.points)
    sums = [np.bincount(whole_of, clusters.points * xy_m) for xy_m in clusters.centroids_m.T]
    low_m, high_m = np.full(len(points), np.inf), np.full(len(points), -np.inf)
    np.minimum.at(low_m, whole_of, clusters.low_m)
    np.maximum.at(high_m, whole_of, clusters.high_m)
    return Footprints(
        vertices_m=clusters.vertices_m[order],
        corners=np.bincount(whole_of, clusters.corners).astype(np.int64),
        centroids_m=np.column_stack(sums) / points[:, None],
        low_m=low_m,
        high_m=high_m,
        points=points.astype(np.int64),
    )
