"""Footprints: outlines of clusters in top view, and their heights.

A footprint keeps the extent of a cluster along every direction, which a box would lose. So a tracker that knows
the heading later can fit the box then.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from perception.errors import PerceptionError
from perception.geometry.sorting import sorted_keys
from perception.kernels.outlines import convex_outlines
from perception.types import Bool, Float, Float64, Int


@dataclass(frozen=True)
class Footprints:
    """F clusters of one scan, in any upright frame.

    Attributes:
        vertices_m: (K, 2) corners of the convex outlines, one cluster after another.
        corners: (F,) number of corners of each cluster, at least one.
        centroids_m: (F, 2) mean of each cluster's points.
        low_m: (F,) lowest z.
        high_m: (F,) highest z.
        points: (F,) number of points of each cluster.
    """

    vertices_m: Float64
    corners: Int
    centroids_m: Float64
    low_m: Float64
    high_m: Float64
    points: Int

    def __post_init__(self) -> None:
        """Validate lengths, and that each cluster has a corner."""
        lengths = {
            len(column)
            for column in (self.corners, self.centroids_m, self.low_m, self.high_m, self.points)
        }
        fits = len(lengths) == 1 and int(self.corners.sum()) == len(self.vertices_m)
        if not fits or (self.corners < 1).any():
            raise PerceptionError(
                "Footprints",
                expected="columns of one length and as many vertices as corners in all",
                found=f"lengths {sorted(lengths)} and {len(self.vertices_m)} vertices",
            )

    def __len__(self) -> int:
        """Return F."""
        return len(self.corners)

    def __getitem__(self, rows: Bool | Int) -> Self:
        """Return the clusters of a mask or of indices."""
        kept = np.arange(len(self))[rows]
        counts = self.corners[kept]
        # Row numbers of the kept outlines: each outline's start, and on from there.
        within = np.arange(counts.sum()) - np.repeat(_starts(counts), counts)
        return type(self)(
            self.vertices_m[np.repeat(_starts(self.corners)[kept], counts) + within],
            counts,
            self.centroids_m[kept],
            self.low_m[kept],
            self.high_m[kept],
            self.points[kept],
        )

    @classmethod
    def empty(cls) -> Self:
        """Return no clusters."""
        none = np.zeros(0, np.int64)
        return cls(np.zeros((0, 2)), none, np.zeros((0, 2)), np.zeros(0), np.zeros(0), none)

    def extents_m(self, yaw_rad: Float64) -> tuple[Float64, Float64]:
        """Return the extent of each cluster along a heading of its own and to the left of it.

        Args:
            yaw_rad: (F,) headings.

        Returns:
            (F, 2) smallest and (F, 2) largest coordinate along heading and left, from the frame's origin.
        """
        if len(self) == 0:
            return np.zeros((0, 2)), np.zeros((0, 2))
        cos = np.repeat(np.cos(yaw_rad), self.corners)
        sin = np.repeat(np.sin(yaw_rad), self.corners)
        x, y = self.vertices_m.T
        turned = np.column_stack([cos * x + sin * y, cos * y - sin * x])
        starts = _starts(self.corners)
        return np.minimum.reduceat(turned, starts), np.maximum.reduceat(turned, starts)

    def moved(self, dst_SE3_src: Float64) -> Self:
        """Return the clusters in another frame, by a transform that keeps them upright to a few degrees."""
        heights = np.column_stack([self.centroids_m, (self.low_m + self.high_m) / 2])
        centers = heights @ dst_SE3_src[:3, :3].T + dst_SE3_src[:3, 3]
        half_m = (self.high_m - self.low_m) / 2
        vertices = np.column_stack([self.vertices_m, np.repeat(heights[:, 2], self.corners)])
        return type(self)(
            (vertices @ dst_SE3_src[:3, :3].T + dst_SE3_src[:3, 3])[:, :2],
            self.corners,
            centers[:, :2],
            centers[:, 2] - half_m,
            centers[:, 2] + half_m,
            self.points,
        )


def footprints_of(points_m: Float, cluster_of: Int, clusters: int) -> Footprints:
    """Return the footprints of clusters of points.

    Args:
        points_m: (N, 3+) points of all clusters, in any order.
        cluster_of: (N,) number of each point's cluster, 0 to clusters - 1; every number occurs.
        clusters: Number of clusters.
    """
    if clusters == 0:
        return Footprints.empty()
    _, order = sorted_keys(cluster_of)
    points = np.asarray(points_m.take(order, axis=0)[:, :3], np.float64)
    counts = np.bincount(cluster_of, minlength=clusters)
    starts, places_m = _starts(counts), np.ascontiguousarray(points[:, :2])
    rows, corners = convex_outlines(places_m, np.append(starts, len(points)))
    return Footprints(
        vertices_m=places_m.take(rows, axis=0),
        corners=corners,
        centroids_m=np.add.reduceat(places_m, starts) / counts[:, None],
        low_m=np.minimum.reduceat(points[:, 2], starts),
        high_m=np.maximum.reduceat(points[:, 2], starts),
        points=counts,
    )


def _starts(counts: Int) -> Int:
    """Return the first row of each of some runs of rows, by the runs' lengths."""
    return np.asarray(np.cumsum(counts) - np.asarray(counts, np.int64), np.int64)
