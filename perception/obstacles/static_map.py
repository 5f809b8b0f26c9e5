"""Static map: the static voxels of this scan and the last few, without those that a beam has passed since."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from perception.geometry import se3
from perception.geometry.grids import LocalArea
from perception.kernels.voxels import merge_voxels
from perception.obstacles.voxels import KeyCounts, Keys, VoxelGrid, is_among
from perception.types import Bool, Float32, Float64, Voxels


@dataclass(frozen=True)
class _StaticVoxels:
    """R voxels by rising key, their centres in the frame of the scan that was added last."""

    keys: Keys
    counts: Keys
    unseen_scans: Keys
    centers_velo: Float32


class StaticMap:
    """A short memory of static voxels, in a grid that is fixed to the earth."""

    def __init__(self, grid_world: VoxelGrid, area: LocalArea, memory_scans: int) -> None:
        self._grid = grid_world
        self._area = area
        self._memory_scans = memory_scans
        nothing: Keys = np.zeros(0, np.int64)
        self._known = _StaticVoxels(nothing, nothing, nothing, np.zeros((0, 3), np.float32))
        self._world_SE3_velo = np.eye(4)

    def update(
        self,
        seen: KeyCounts,
        moving: Keys,
        world_SE3_velo: Float64,
        is_free: Callable[[Float32], Bool],
    ) -> Voxels:
        """Add a scan's static voxels, and return all that are still static, in the scan's frame.

        Args:
            seen: Static voxels of the scan.
            moving: Moving voxels of the scan, rising; nothing static is kept there.
            world_SE3_velo: (4, 4) pose of the scan.
            is_free: Function that tells through which (P, 3) positions, in the scan's frame, a beam of it passed.
        """
        velo_SE3_world = se3.inverse(world_SE3_velo)
        known = self._known
        centers_velo = se3.transform_points(
            velo_SE3_world @ self._world_SE3_velo, known.centers_velo
        )
        is_observed = is_among(known.keys, seen.keys)
        stays = (
            (is_observed | (known.unseen_scans < self._memory_scans))
            & self._area.contains_xy(centers_velo)
            & ~is_among(known.keys, moving)
        )
        queried = np.flatnonzero(stays & ~is_observed)
        stays[queried] = ~is_free(centers_velo[queried])
        self._known = _StaticVoxels(
            *merge_voxels(
                known.keys,
                known.counts,
                known.unseen_scans,
                centers_velo,
                stays,
                np.asarray(seen.keys, np.int64),
                seen.counts,
                self._centers_velo(seen.keys, velo_SE3_world),
            )
        )
        self._world_SE3_velo = world_SE3_velo
        return Voxels(self._known.centers_velo, self._known.counts, self._grid.size_m)

    def _centers_velo(self, keys: Keys, velo_SE3_world: Float64) -> Float32:
        rotation, translation_m = velo_SE3_world[:3, :3], velo_SE3_world[:3, 3]
        centers_world = self._grid.centers_m(keys)
        return np.asarray(centers_world @ rotation.T + translation_m, np.float32)
