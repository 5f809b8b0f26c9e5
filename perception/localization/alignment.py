"""Alignment of one scan with another: box-grid filter, local covariances, ICP and GICP."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
import small_gicp

from perception.types import Bool, Float32, Float64

_MIN_POINTS = 50  # of a filtered scan; fewer do not determine six degrees of freedom
_MAX_ITERATIONS = 20
# Cells of the box filter on each side of the origin: small_gicp has 21 bits for an axis.
_GRID_CELLS = 2**20 - 1
# A smaller step ends the alignment. What it leaves is of the order of its square (measured: with steps a
# third as small, poses stay as far from the truth, for another quarter of the time).
_STEP_RAD, _STEP_M = 1e-3, 3e-3


@dataclass(frozen=True)
class PreprocessedPoints:
    """A downsampled scan with a local covariance at each point.

    Attributes:
        cloud: Points and covariances of small_gicp.
        tree: Search tree of small_gicp over the points; None without points.
    """

    cloud: Any
    tree: Any

    def __len__(self) -> int:
        """Return the number of points after the filter."""
        return int(self.cloud.size())

    @cached_property
    def places_m(self) -> Float64:
        """(P, 3) positions of the points."""
        return np.asarray(self.cloud.points())[:, :3]

    @cached_property
    def normals(self) -> Float64:
        """(P, 3) directions in which the local surfaces are thinnest."""
        return np.asarray(np.linalg.eigh(np.asarray(self.cloud.covs())[:, :3, :3])[1][:, :, 0])


@dataclass(frozen=True)
class Alignment:
    """Result of an alignment.

    Attributes:
        target_SE3_source: (4, 4) transform from the source to the target.
        inlier_ratio: Share of the source's points with a match, 0 to 1.
        cost: Mean squared error of a point, an unmatched one counting 1; lower is better.
        is_converged: Whether the last step was below the tolerances.
    """

    target_SE3_source: Float64
    inlier_ratio: float
    cost: float
    is_converged: bool


def preprocess_points(
    points: Float32, voxel_size_m: float, neighbors: int = 10, threads: int = 1
) -> PreprocessedPoints:
    """Downsample (N, 3+) points to one per voxel, and fit a covariance to each one's neighbours."""
    # small_gicp prints a line for each point outside its grid and for each empty tree, which nobody can act on.
    inside = points[_is_in_grid(points[:, :3], voxel_size_m), :3].astype(np.float64)
    # On several threads the filter keeps another set of points in each run.
    return _with_covariances(
        small_gicp.voxelgrid_sampling(inside, voxel_size_m, 1), neighbors, threads
    )


def on_surfaces(
    source: PreprocessedPoints,
    target: PreprocessedPoints,
    target_SE3_source: Float64,
    max_distance_m: float,
    neighbors: int = 10,
) -> PreprocessedPoints:
    """Return the source without the points that are off the surfaces of the target.

    Args:
        source: Points that are moved.
        target: Points that stay.
        target_SE3_source: (4, 4) transform from the source to the target.
        max_distance_m: Largest distance of a point from the surface at the nearest point of the target in metres.
        neighbors: Number of points that a local surface is fitted to.
    """
    if min(len(source), len(target)) == 0:
        return source
    rotation, translation_m = target_SE3_source[:3, :3], target_SE3_source[:3, 3]
    moved = source.places_m @ rotation.T + translation_m
    nearest, _ = target.tree.batch_nearest_neighbor_search(moved)
    away_m = ((moved - target.places_m[nearest]) * target.normals[nearest]).sum(axis=1)
    cloud = small_gicp.PointCloud(source.places_m[np.abs(away_m) < max_distance_m])
    return _with_covariances(cloud, neighbors, threads=1)


def _with_covariances(
    cloud: small_gicp.PointCloud, neighbors: int, threads: int
) -> PreprocessedPoints:
    if not cloud.size():
        return PreprocessedPoints(cloud, tree=None)
    tree = small_gicp.KdTree(cloud, num_threads=threads)
    small_gicp.estimate_covariances(cloud, tree, neighbors, threads)
    return PreprocessedPoints(cloud, tree)


def _is_in_grid(xyz: Float32, voxel_size_m: float) -> Bool:
    """Return (N,) whether a finite point lies within the grid of the box filter."""
    limit_m = _GRID_CELLS * voxel_size_m
    return np.asarray((np.abs(xyz) < limit_m).all(axis=1))


def align(
    target: PreprocessedPoints,
    source: PreprocessedPoints,
    initial_guess: Float64,
    max_correspondence_m: float,
    threads: int = 1,
    kind: Literal["ICP", "GICP"] = "GICP",
) -> Alignment:
    """Align the source with the target.

    Args:
        target: Points that stay.
        source: Points that are moved.
        initial_guess: (4, 4) first guess of `target_SE3_source`.
        max_correspondence_m: Largest distance of a match in metres.
        threads: Number of threads; more than one changes the last digits from run to run.
        kind: Point-to-point ICP as in the thesis, or GICP.
    """
    if min(len(target), len(source)) < _MIN_POINTS:
        return Alignment(initial_guess, inlier_ratio=0.0, cost=1.0, is_converged=False)
    result = small_gicp.align(
        target.cloud,
        source.cloud,
        target.tree,
        initial_guess,
        registration_type=kind,
        max_correspondence_distance=max_correspondence_m,
        num_threads=threads,
        max_iterations=_MAX_ITERATIONS,
        rotation_epsilon=_STEP_RAD,
        translation_epsilon=_STEP_M,
    )
    unmatched = len(source) - result.num_inliers
    return Alignment(
        target_SE3_source=np.asarray(result.T_target_source),
        inlier_ratio=result.num_inliers / len(source),
        cost=(result.error + unmatched) / len(source),
        is_converged=bool(result.converged),
    )
