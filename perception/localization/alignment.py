"""Alignment of one scan with another: mean points and surface normals of voxels, ICP and GICP."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from perception.kernels.scan_matching import align_surfaces, distances_to_surfaces
from perception.kernels.surface_normals import (
    ALL_KNOWN,
    NormalSources,
    find_normals,
    means_and_normals,
    unfitted_surfaces,
)
from perception.kernels.voxel_table import VoxelTable, voxel_moments
from perception.types import Float32, Float64

_MIN_POINTS = 50  # of a filtered scan; fewer do not determine six degrees of freedom
_MAX_ITERATIONS = 15
_SURFACE_REACH = 4.0  # voxels in which the surface at a point is looked for
# A smaller step ends the alignment. What it leaves is of the order of its square (measured: with steps a
# third as small, poses stay as far from the truth, for another quarter of the time).
_STEPS = (1e-3, 3e-3)  # rad, m
# Ratio of the variance of a pose to that by the eighths of the surroundings, which err alike in part, as voxel means lock
# onto their grid; one number for all LiDARs.
_INFLATION = 2.0
# Off the surfaces of both sides, a match of the robust kind weighs a quarter (Geman-McClure).
_ROBUST_M = 0.1
_UNKNOWN = np.full((6, 6), np.nan)

AlignmentKind = Literal["ICP", "GICP", "robust"]


@dataclass(frozen=True)
class PreprocessedPoints:
    """A downsampled scan with the surface normal at each point.

    Attributes:
        surfaces: (M, 6) mean point of each occupied voxel, and normal of the surface there; 0 without a surface.
        table: Table of the voxels.
        voxel_size_m: Edge of a voxel in metres.
        normals: What the normals of a target are found from when its points are matched, NaN until then.
    """

    surfaces: Float64
    table: VoxelTable
    voxel_size_m: float
    normals: NormalSources = ALL_KNOWN

    def __len__(self) -> int:
        """Return the number of points after the filter."""
        return len(self.surfaces)

    def thinned(self, count: int) -> "PreprocessedPoints":
        """Return about as many of the points, evenly; they cannot be a target."""
        stride = max(-(-len(self) // count), 1)
        return replace(self, surfaces=np.ascontiguousarray(self.surfaces[::stride]))

    @property
    def as_target(self) -> tuple[Float64, VoxelTable, float, NormalSources]:
        """First arguments of the functions that match points with it."""
        return self.surfaces, self.table, self.voxel_size_m, self.normals

    @property
    def places_m(self) -> Float64:
        """(M, 3) positions of the points."""
        return self.surfaces[:, :3]


@dataclass(frozen=True)
class Alignment:
    """Result of an alignment.

    Attributes:
        target_SE3_source: (4, 4) transform from the source to the target.
        inlier_ratio: Share of the source's points with a match, 0 to 1.
        cost: Mean squared error of a point, an unmatched one counting 1; lower is better.
        is_converged: Whether the last step was below the tolerances.
        covariance: (6, 6) covariance of a small motion of the source in the target's frame, rotation vector in rad and
            translation in m, by how well the eighths of the surroundings agree; NaN where they do not determine it.
    """

    target_SE3_source: Float64
    inlier_ratio: float
    cost: float
    is_converged: bool
    covariance: Float64


def preprocess_points(points: Float32, voxel_size_m: float) -> PreprocessedPoints:
    """Downsample (N, 3+) points to one per voxel, and fit a surface to those around each."""
    moments, table = voxel_moments(np.ascontiguousarray(points, np.float32), voxel_size_m)
    return PreprocessedPoints(means_and_normals(moments, table, voxel_size_m), table, voxel_size_m)


def preprocess_target(points: Float32, voxel_size_m: float) -> PreprocessedPoints:
    """Downsample points as `preprocess_points` does, but fit surfaces to those alone that are matched, when they are."""
    moments, table = voxel_moments(np.ascontiguousarray(points, np.float32), voxel_size_m)
    surfaces, normals = unfitted_surfaces(moments, voxel_size_m)
    return PreprocessedPoints(surfaces, table, voxel_size_m, normals)


def on_surfaces(
    source: PreprocessedPoints,
    target: PreprocessedPoints,
    target_SE3_source: Float64,
    max_distance_m: float,
) -> PreprocessedPoints:
    """Return the source without the points that are off the surfaces of the target; it cannot be a target itself.

    Args:
        source: Points that are moved.
        target: Points that stay.
        target_SE3_source: (4, 4) transform from the source to the target.
        max_distance_m: Largest distance of a point from the surface at the nearest point of the target in metres.
    """
    away_m = _surface_distances_m(source, target, target_SE3_source, _SURFACE_REACH)
    return replace(source, surfaces=source.surfaces[away_m < max_distance_m])


def share_on_surfaces(
    source: PreprocessedPoints,
    target: PreprocessedPoints,
    target_SE3_source: Float64,
    max_distance_m: float,
) -> float:
    """Return the share of the source's points that are on the surfaces of the target; arguments as of `on_surfaces`."""
    away_m = _surface_distances_m(source, target, target_SE3_source, 1.0)
    return float(np.count_nonzero(away_m < max_distance_m) / max(len(away_m), 1))


def _surface_distances_m(
    source: PreprocessedPoints, target: PreprocessedPoints, target_SE3_source: Float64, reach: float
) -> Float64:
    """Return the (N,) distance of each point of the source from the surface at the nearest point of the target.

    It is infinite where none is within `reach` edges of the target's voxels.
    """
    if target.normals is not ALL_KNOWN:
        rows = np.flatnonzero(np.isnan(target.surfaces[:, 3]))
        find_normals(target.normals, target.table, target.voxel_size_m, rows, target.surfaces)
    return distances_to_surfaces(
        target.surfaces,
        target.table,
        target.voxel_size_m,
        source.surfaces,
        np.ascontiguousarray(target_SE3_source, np.float64),
        reach * target.voxel_size_m,
    )


def align(
    target: PreprocessedPoints,
    source: PreprocessedPoints,
    initial_guess: Float64,
    max_correspondence_m: float,
    kind: AlignmentKind = "GICP",
    prior_share: float = 0.0,
) -> Alignment:
    """Align the source with the target.

    Args:
        target: Points that stay.
        source: Points that are moved.
        initial_guess: (4, 4) first guess of `target_SE3_source`.
        max_correspondence_m: Largest distance of a match in metres, at most 15 voxels.
        kind: Point-to-point ICP as in the thesis, GICP, or GICP whose matches weigh less the farther off they are.
        prior_share: Share of the matches that, with normals along a direction, tell as much about a motion in it as
            the initial guess does, 0 to 1; 0 for no prior.
    """
    if min(len(target), len(source)) < _MIN_POINTS:
        return Alignment(initial_guess, 0.0, cost=1.0, is_converged=False, covariance=_UNKNOWN)
    if kind == "ICP":
        target, source = (_without_normals(points) for points in (target, source))
    pose, matches, error, is_converged, covariance = align_surfaces(
        *target.as_target,
        source.surfaces,
        np.ascontiguousarray(initial_guess, np.float64),
        max_correspondence_m,
        _STEPS,
        _MAX_ITERATIONS,
        prior_share,
        _ROBUST_M if kind == "robust" else 0.0,
    )
    unmatched = len(source) - matches
    cost = (error + unmatched) / len(source)
    covariance *= _INFLATION
    return Alignment(pose, matches / len(source), cost, is_converged, covariance)


def _without_normals(points: PreprocessedPoints) -> PreprocessedPoints:
    """Return points whose normals are 0: the error of a match is its distance in all directions."""
    surfaces = points.surfaces.copy()
    surfaces[:, 3:] = 0
    return replace(points, surfaces=surfaces)
