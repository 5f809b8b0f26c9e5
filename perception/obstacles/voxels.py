"""Occupied voxels and the points in each (thesis 2.1.2), counted on sorted integer keys.

A voxel's three indices are packed into one integer, so that counting is one sort of N numbers. The
grid is mostly air (about 1 % of its cells hold a point), which is why no dense array is laid out.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from perception.errors import UsageError
from perception.geometry.sorting import sorted_keys
from perception.kernels.voxels import cells_of_moved, moved_centers
from perception.types import Bool, Float, Float32, Float64, Voxels

Keys = NDArray[np.signedinteger[Any]]


@dataclass(frozen=True)
class KeyCounts:
    """K different keys, rising, and the number of occurrences of each.

    Attributes:
        keys: (K,) keys of `VoxelGrid.keys`.
        counts: (K,) at least 1.
    """

    keys: Keys
    counts: Keys


@dataclass(frozen=True)
class VoxelGrid:
    """A block of cubes: cell (i, j, k) begins at corner_m + (i, j, k) * size_m.

    Attributes:
        corner_m: (3,) smallest x, y, z.
        shape: Number of cells along x, y and z.
        size_m: Edge of a voxel in metres (υ).
    """

    corner_m: Float64
    shape: tuple[int, int, int]
    size_m: float

    def __post_init__(self) -> None:
        """Validate the edge, and that the keys fit in 64 bits."""
        if not self.size_m > 0:
            raise UsageError("voxel size_m", expected="a positive edge", found=str(self.size_m))
        if not 0 < float(np.prod(np.asarray(self.shape, np.float64))) < 2**62:
            raise UsageError(
                "voxel grid",
                expected="between 1 and 2^62 cells",
                found=f"{self.shape}",
                advice="choose larger voxels or a smaller area",
            )

    @classmethod
    def covering(cls, points: Float, size_m: float) -> "VoxelGrid":
        """Return the smallest grid around (N, 3+) points whose corners are multiples of the edge."""
        if not size_m > 0:
            raise UsageError("voxel size_m", expected="a positive edge", found=str(size_m))
        if len(points) == 0:
            return cls(np.zeros(3), (1, 1, 1), size_m)
        low = np.floor(points[:, :3].min(axis=0) / np.float64(size_m))
        high = np.floor(points[:, :3].max(axis=0) / np.float64(size_m))
        x, y, z = (int(cells) for cells in high - low + 1)
        return cls(low * size_m, (x, y, z), size_m)

    def keys(self, points: Float) -> Keys:
        """Return (N,) the key of the cell of each (N, 3+) point; points beyond go to the border."""
        cells = np.floor((points[:, :3] - self.corner_m) / self.size_m).astype(np.int64)
        np.clip(cells, 0, np.asarray(self.shape) - 1, out=cells)
        keys = (cells[:, 0] * self.shape[1] + cells[:, 1]) * self.shape[2] + cells[:, 2]
        fits = np.prod(np.asarray(self.shape, np.int64)) < 2**31
        # Half the bytes sort in half the time.
        return keys.astype(np.int32) if fits else keys

    def groups_of_moved(self, points: Float32, grid_SE3_points: Float64) -> "KeyGroups":
        """Group (N, 3+) points by the cell that holds them after a motion; points beyond go to the border."""
        nothing: Keys = np.zeros(0, np.int64)
        if len(points) == 0:
            return KeyGroups(KeyCounts(nothing, nothing), nothing, nothing)
        pose = np.ascontiguousarray(grid_SE3_points, np.float64)
        keys, counts, first, group_of = cells_of_moved(
            points, pose, self.corner_m, self.size_m, self.shape
        )
        return KeyGroups(KeyCounts(keys, counts), first, group_of)

    def moved_centers(self, keys: Keys, dst_SE3_grid: Float64) -> Float32:
        """Return (K, 3) the middle of each cell after a motion."""
        pose = np.ascontiguousarray(dst_SE3_grid, np.float64)
        return moved_centers(keys, self.shape, self.corner_m, self.size_m, pose)

    def columns(self, keys: Keys) -> Keys:
        """Return (K,) the number i * shape[1] + j of the vertical bar that holds each cell."""
        return np.asarray(keys // self.shape[2])

    def centers_m(self, keys: Keys) -> Float64:
        """Return (K, 3) the middle of each cell."""
        cells = np.stack(np.unravel_index(keys, self.shape), axis=-1)
        return np.asarray(self.corner_m + (cells + 0.5) * self.size_m)

    def voxels(self, occupied: KeyCounts) -> Voxels:
        """Return counted keys as voxels."""
        return Voxels(
            self.centers_m(occupied.keys).astype(np.float32), occupied.counts, self.size_m
        )


def count_keys(keys: Keys) -> KeyCounts:
    """Count how often each key occurs."""
    ordered = sorted_keys(keys)[0]
    if len(ordered) == 0:
        return KeyCounts(ordered, np.zeros(0, np.int64))
    starts = np.flatnonzero(np.concatenate(([True], ordered[1:] != ordered[:-1])))
    return KeyCounts(ordered[starts], np.diff(starts, append=len(ordered)))


def count_voxels(points: Float, size_m: float) -> Voxels:
    """Return the occupied voxels of (N, 3+) points and their occupancy, in rising x, y, z (2.1.2)."""
    grid = VoxelGrid.covering(points, size_m)
    return grid.voxels(count_keys(grid.keys(points)))


def is_among(keys: Keys, ordered: Keys) -> Bool:
    """Return which of K keys are among others in rising order."""
    if len(ordered) == 0:
        return np.zeros(len(keys), bool)
    at = np.minimum(np.searchsorted(ordered, keys), len(ordered) - 1)
    return np.asarray(ordered[at] == keys)


@dataclass(frozen=True)
class KeyGroups:
    """N keys grouped by value into K.

    Attributes:
        counted: The K different keys.
        first: (K,) index of the first of the N for each.
        group_of: (N,) group of each key, 0 to K - 1.
    """

    counted: KeyCounts
    first: Keys
    group_of: Keys
