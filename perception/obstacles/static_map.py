"""The voxels that stood in this scan and in the last few, without what has since proved to be gone."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from perception.geometry import se3
from perception.geometry.grids import LocalArea
from perception.obstacles.voxels import KeyCounts, Keys, VoxelGrid, group_keys
from perception.types import Bool, Float32, Float64, Voxels


@dataclass(frozen=True)
class _Remembered:
    keys: Keys
    counts: Keys
    unseen_scans: Keys


class StaticMap:
    """A short memory of static voxels, in a grid that is fixed to the earth."""

    def __init__(self, grid_world: VoxelGrid, area: LocalArea, memory_scans: int) -> None:
        self._grid = grid_world
        self._area = area
        self._memory_scans = memory_scans
        nothing: Keys = np.zeros(0, np.int64)
        self._voxels = _Remembered(nothing, nothing, nothing)

    def update(
        self,
        seen: KeyCounts,
        moving: Keys,
        world_SE3_velo: Float64,
        is_seen_through: Callable[[Float32], Bool],
    ) -> Voxels:
        """Add a scan's static voxels and return all that still stand, in the scan's frame.

        Args:
            seen: static voxels of the scan.
            moving: voxels of the scan that move; nothing static is left there.
            world_SE3_velo: pose of the scan.
            is_seen_through: tells of (P, 3) places in the scan's frame which a beam of it passed.
        """
        velo_SE3_world = se3.inverse(world_SE3_velo)
        kept = self._still_standing(seen.keys, moving, velo_SE3_world, is_seen_through)
        groups = group_keys(np.concatenate([seen.keys, kept.keys]))
        counts = np.concatenate([seen.counts, kept.counts])
        unseen = np.concatenate([np.zeros_like(seen.keys), kept.unseen_scans])
        self._voxels = _Remembered(
            groups.counted.keys,
            np.bincount(groups.group_of, counts, len(groups.first)).astype(np.int64),
            unseen[groups.first],  # a voxel's first entry is the scan's own, where it has one
        )
        centers_m = self._centers_velo(self._voxels.keys, velo_SE3_world)
        return Voxels(centers_m, self._voxels.counts, self._grid.size_m)

    def _still_standing(
        self,
        seen: Keys,
        moving: Keys,
        velo_SE3_world: Float64,
        is_seen_through: Callable[[Float32], Bool],
    ) -> _Remembered:
        known = self._voxels
        unseen = np.where(np.isin(known.keys, seen, assume_unique=True), 0, known.unseen_scans + 1)
        centers_m = self._centers_velo(known.keys, velo_SE3_world)
        stands = (unseen <= self._memory_scans) & self._area.contains_xy(centers_m)
        stands &= ~np.isin(known.keys, moving, assume_unique=True)
        asked = np.flatnonzero(stands & (unseen > 0))
        stands[asked] = ~is_seen_through(centers_m[asked])
        return _Remembered(known.keys[stands], known.counts[stands], unseen[stands])

    def _centers_velo(self, keys: Keys, velo_SE3_world: Float64) -> Float32:
        centers_world = self._grid.centers_m(keys)
        return np.asarray(
            centers_world @ velo_SE3_world[:3, :3].T + velo_SE3_world[:3, 3], np.float32
        )
