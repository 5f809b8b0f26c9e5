"""Vehicle proposals: points above the ground, clustered, with a box in the image around each cluster (6.1.2).

    scan -- find_above_ground --> points -- cluster_points --> clusters -- fit_boxes --> proposals

The steps are separate functions, so that a search over the parameters of one does not repeat those before it.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from perception.detection.clustering import cluster
from perception.detection.config import PROPOSAL_CONFIGS, ProposalConfig
from perception.detection.depthcn.above_ground import AboveGroundPoints, find_above_ground
from perception.types import Bool, Calibration, Float32, Float64, Int, Method

_TOP_MARGIN_PX = 5  # the author's code: the beam above the highest return passes over the roof
_NEAR_SIDE = 0.1  # quantile of a cluster's depths
# Growth of the default's radius per metre of range, since beams diverge.
_RADIUS_PER_M = 0.025
_LONGEST_M = 5.0  # length of a car; a longer cluster may be two
_SPLIT = 0.5  # share of the radius with which a long cluster is split


@dataclass(frozen=True)
class Proposals:
    """M proposals of one scan, with the points of each.

    Attributes:
        boxes_px: (M, 4) boxes x1 y1 x2 y2 within the image.
        depths_m: (M,) depths of the near side along the optical axis in metres.
        clusters: (N,) index of the proposal of each point of the scan, or -1.
    """

    boxes_px: Float64
    depths_m: Float64
    clusters: Int

    def __len__(self) -> int:
        """Return M."""
        return len(self.boxes_px)

    def sizes_m(self, focal_px: float) -> Float64:
        """Return the (M, 2) widths and heights in the image, in metres at the depths."""
        sizes_px = self.boxes_px[:, 2:] - self.boxes_px[:, :2]
        return np.asarray(sizes_px * (self.depths_m / focal_px)[:, None])

    def has_min_size(self, min_size_m: tuple[float, float], focal_px: float) -> Bool:
        """Return the (M,) mask of the proposals of at least a width and a height in metres."""
        return np.asarray((self.sizes_m(focal_px) >= min_size_m).all(axis=1))

    def __getitem__(self, rows: Bool | Int) -> Self:
        """Return the proposals of a mask or of indices, with renumbered clusters."""
        numbers = np.full(len(self) + 1, -1)
        kept = np.arange(len(self))[rows]
        numbers[kept] = np.arange(len(kept))
        return type(self)(self.boxes_px[rows], self.depths_m[rows], numbers[self.clusters])


def propose(
    points_velo: Float32,
    calibration: Calibration,
    size_px: tuple[int, int],
    config: ProposalConfig | None = None,
    method: Method = "default",
) -> Proposals:
    """Find the proposals of a scan.

    Args:
        points_velo: (N, 4) scan in the LiDAR frame.
        calibration: Calibration of the camera.
        size_px: (width, height) of the image.
        config: Proposal parameters; else those of the method.
        method: Method of ground removal and clustering.
    """
    config = config or PROPOSAL_CONFIGS[method]
    above_ground = find_above_ground(
        points_velo, calibration, size_px, config.cell_m, config.min_variance_m2, method
    )
    labels = cluster_points(above_ground, config.radius_m, config.min_points, method)
    return fit_boxes(above_ground, labels)


def cluster_points(
    above_ground: AboveGroundPoints, radius_m: float, min_points: int, method: Method = "default"
) -> Int:
    """Return the (K,) cluster of each point above ground, from 0, or -1 for noise.

    Args:
        above_ground: Points above the ground.
        radius_m: Radius of DBSCAN's neighbourhood in metres; of the default method at the sensor.
        min_points: Number of points within the radius that make a point a core.
        method: Method of clustering.
    """
    if method == "thesis":
        return cluster(above_ground.xy_m, radius_m, min_points)
    xy_m = _compress_range(above_ground.xy_m, radius_m)
    labels = cluster(xy_m, radius_m, min_points)
    # Clusters of a smaller radius lie within those of a larger one, so that one call splits all.
    long = np.flatnonzero(_is_long(above_ground.xy_m, labels))
    parts = cluster(xy_m[long], _SPLIT * radius_m, min_points)
    labels[long] = np.where(parts >= 0, parts + labels.max(initial=-1) + 1, -1)
    return _renumbered(labels)


def fit_boxes(above_ground: AboveGroundPoints, labels: Int) -> Proposals:
    """Return a proposal around each cluster in the image.

    Left and right are the outermost points, the bottom is the lowest point or the ground below one, and the top has
    a margin.

    Args:
        above_ground: Points above the ground.
        labels: (K,) cluster of each point, or -1.
    """
    clusters = np.full(above_ground.scan_length, -1, np.int64)
    clusters[above_ground.rows] = labels
    clustered = np.flatnonzero(labels >= 0)
    if len(clustered) == 0:
        return Proposals(np.zeros((0, 4)), np.zeros(0), clusters)
    depths_m = above_ground.depths_m[clustered]
    # By cluster, then by depth: integer part and fraction of one sort key.
    order = clustered[np.argsort(labels[clustered] + depths_m / (depths_m.max() + 1))]
    counts = np.bincount(labels[clustered])
    starts = counts.cumsum() - counts
    column, row = above_ground.pixels[order].T
    boxes_px = np.column_stack(
        [
            np.minimum.reduceat(column, starts),
            np.maximum(np.minimum.reduceat(row, starts) - _TOP_MARGIN_PX, 0),
            np.maximum.reduceat(column, starts),
            np.maximum.reduceat(
                np.minimum(above_ground.ground_rows_px[order], above_ground.size_px[1] - 1), starts
            ),
        ]
    )
    near = starts + (_NEAR_SIDE * (counts - 1)).astype(np.int64)
    return Proposals(boxes_px, above_ground.depths_m[order][near], clusters)


def _compress_range(xy_m: Float64, radius_m: float) -> Float64:
    """Compress (K, 2) positions radially, so that a radius that grows with the range becomes constant."""
    growth = _RADIUS_PER_M / radius_m * np.hypot(xy_m[:, 0], xy_m[:, 1])
    # The integral of 1 / (1 + growth) over the range, divided by the range.
    return xy_m * (np.log1p(growth) / np.maximum(growth, 1e-9))[:, None]


def _is_long(xy_m: Float64, labels: Int) -> Bool:
    """Return the (K,) mask of the points in clusters longer than a car along x or y."""
    is_long: Bool = np.zeros(labels.max(initial=-1) + 2, bool)  # the last is noise
    for along_m in xy_m.T:
        low_m, high_m = np.full(len(is_long), np.inf), np.full(len(is_long), -np.inf)
        np.minimum.at(low_m, labels, along_m)
        np.maximum.at(high_m, labels, along_m)
        is_long |= high_m - low_m > _LONGEST_M
    is_long[-1] = False
    return np.asarray(is_long[labels])


def _renumbered(labels: Int) -> Int:
    """Close the gaps in the (K,) cluster numbers; -1 stays."""
    is_used = np.zeros(labels.max(initial=-1) + 2, bool)
    is_used[labels] = True
    return np.where(labels >= 0, (is_used.cumsum() - 1)[labels], -1)
