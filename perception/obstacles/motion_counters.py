"""Static and moving by comparing how full a voxel is over time: the thesis' method (5.1.3, Fig. 5.6).

A moving object fills other voxels in every scan, a static one the same. So voxels of the merged cloud D that one
scan alone fills have moved, and columns of the ground plane are decided by the ratio of the remaining counts.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perception.geometry import se3
from perception.geometry.grids import LocalArea
from perception.localization.scan_window import ScanWindow
from perception.obstacles.above_ground import AboveGround, split_by_ground
from perception.obstacles.config import MotionConfig
from perception.obstacles.motion_segmenter import MotionSegmenter
from perception.obstacles.voxels import KeyCounts, Keys, VoxelGrid, count_keys, is_among
from perception.types import Bool, Float32, Float64, GroundModel, Int, Obstacles


@dataclass(frozen=True)
class SubtractedVoxels:
    """The voxel grids before and after the preprocessing.

    Attributes:
        merged: D, all scans together.
        static: D without the voxels that one scan alone filled.
        moving: P_i, the newest scan's voxels that are not left in D.
    """

    merged: KeyCounts
    static: KeyCounts
    moving: KeyCounts


@dataclass(frozen=True)
class MotionMasks:
    """Static and moving columns of the ground plane; some are neither.

    Attributes:
        is_static: (X, Y) B_s of (5.5).
        is_moving: (X, Y) B_d of (5.5).
    """

    is_static: Bool
    is_moving: Bool


@dataclass(frozen=True)
class MotionCounters:
    """Counters and masks of one frame (Fig. 5.6).

    Attributes:
        grid: Voxel grid; its x and y cells are those of the counters.
        voxels: Voxels before and after the preprocessing.
        static_before: (X, Y) C_s of the merged cloud, Fig. 5.6 (b).
        static: (X, Y) C_s after the preprocessing (c).
        moving: (X, Y) C_d (d).
        log_ratio: (X, Y) R of (5.4) (e).
        masks: Static and moving columns (5.5).
    """

    grid: VoxelGrid
    voxels: SubtractedVoxels
    static_before: Int
    static: Int
    moving: Int
    log_ratio: Float64
    masks: MotionMasks


@dataclass(frozen=True)
class VoxelizedWindow:
    """Obstacle points of every scan of a window in the newest one's frame, and their voxels.

    Attributes:
        scans: Obstacle points of each scan, the newest last.
        grid: Voxel grid around all of them.
        keys: Voxel key of each point, scan by scan.
    """

    scans: Sequence[AboveGround]
    grid: VoxelGrid
    keys: Sequence[Keys]


def subtract(scan_keys: Sequence[Keys]) -> SubtractedVoxels:
    """Remove from the merged grid the voxels of one scan alone, then from the newest scan the voxels that stay.

    D <= P_k for some scan k means that all points of the voxel come from that scan, so it is enough to count the
    scans of a voxel.

    Args:
        scan_keys: Voxel keys of the obstacle points, scan by scan, the newest last.
    """
    scans = [count_keys(keys) for keys in scan_keys]
    reached: Keys = np.concatenate([scan.keys for scan in scans])
    filled: Keys = np.concatenate(scan_keys)
    reached_by, merged = count_keys(reached), count_keys(filled)
    stays = reached_by.counts > 1
    static = KeyCounts(merged.keys[stays], merged.counts[stays])
    newest = scans[-1]
    leaves = ~is_among(newest.keys, static.keys)
    return SubtractedVoxels(merged, static, KeyCounts(newest.keys[leaves], newest.counts[leaves]))


def column_counter(grid: VoxelGrid, voxels: KeyCounts) -> Int:
    """Sum occupancy over height into (X, Y) (5.3)."""
    across = grid.shape[:2]
    total = np.bincount(grid.columns(voxels.keys), voxels.counts, across[0] * across[1])
    return total.astype(np.int64).reshape(across)


def log_ratio(moving: Int, static: Int) -> Float64:
    """Return log(max(C_d, ε) / max(C_s, ε)) with ε = 1, negative where static (5.4)."""
    return np.asarray(np.log(np.maximum(moving, 1.0)) - np.log(np.maximum(static, 1.0)))


def classify_columns(
    static: Int, moving: Int, static_threshold: int, moving_threshold: int
) -> MotionMasks:
    """Decide the columns of the ground plane.

    As printed, (5.5) compares a log ratio with 50 and 5, which no cell reaches. Read as floors on the
    counts under the ratio, the same numbers work: a column needs T_s points to be static and T_d to
    move, the larger counter wins, and a rival of fewer than T_d points counts as ε = 1.
    """
    static_rival = np.where(moving >= moving_threshold, moving, 1)
    moving_rival = np.where(static >= moving_threshold, static, 1)
    return MotionMasks(
        is_static=(static >= static_threshold) & (static > static_rival),
        is_moving=(moving >= moving_threshold) & (moving > moving_rival),
    )


_CONFIG = MotionConfig()


class CounterSegmenter(MotionSegmenter[VoxelizedWindow]):
    """The thesis' static-moving segmentation of a window of scans."""

    def __init__(
        self, area: LocalArea, config: MotionConfig = _CONFIG, static_threshold: int = 50
    ) -> None:
        """Make the segmenter, by default with the values of the thesis (Table 7.1).

        Args:
            area: Local area in which obstacles are reported.
            config: Motion configuration.
            static_threshold: Smallest number of points of a static column (T_s), for a window of 7 scans of an
                HDL-64E.
        """
        self._area, self._config = area, config
        self._static_threshold = static_threshold

    def voxelize(self, window: ScanWindow, ground: GroundModel) -> VoxelizedWindow:
        """Move every scan into the newest one's frame (5.1), take its ground away, and fill the voxels."""
        newest_SE3_world = se3.inverse(window.newest.world_SE3_velo)
        moved: list[Float32] = [
            se3.transform_points(newest_SE3_world @ scan.world_SE3_velo, scan.points_velo)
            for scan in window
        ]
        distance_m = self._config.counters.min_ground_distance_m
        scans = [split_by_ground(points, ground, self._area, distance_m) for points in moved]
        points = [scan.points_velo for scan in scans]
        grid = VoxelGrid.covering(np.concatenate(points), self._config.voxel_size_m)
        return VoxelizedWindow(scans, grid, [grid.keys(scan) for scan in points])

    def segment(self, voxelized: VoxelizedWindow) -> Obstacles:
        """Return the voxels under the static and the moving columns."""
        counters, grid = self.counters(voxelized), voxelized.grid
        moving = _under(counters.masks.is_moving, grid, counters.voxels.moving)
        static = _under(counters.masks.is_static, grid, counters.voxels.static)
        is_moving = is_among(voxelized.keys[-1], moving.keys)
        return Obstacles(
            point_states=voxelized.scans[-1].point_states(is_moving),
            static=grid.voxels(static),
            moving=grid.voxels(moving),
        )

    def counters(self, voxelized: VoxelizedWindow) -> MotionCounters:
        """Return the counters behind the decision for the newest scan (Fig. 5.6)."""
        grid, voxels = voxelized.grid, subtract(voxelized.keys)
        static = column_counter(grid, voxels.static)
        moving = column_counter(grid, voxels.moving)
        return MotionCounters(
            grid,
            voxels,
            column_counter(grid, voxels.merged),
            static,
            moving,
            log_ratio(moving, static),
            classify_columns(
                static, moving, self._static_threshold, self._config.counters.moving_threshold
            ),
        )


def _under(mask: Bool, grid: VoxelGrid, voxels: KeyCounts) -> KeyCounts:
    """Keep the voxels, at every height, whose column is in the mask."""
    kept = mask.ravel()[grid.columns(voxels.keys)]
    return KeyCounts(voxels.keys[kept], voxels.counts[kept])
