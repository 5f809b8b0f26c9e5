"""Static-moving segmentation: the stage, by free space or by the thesis' occupancy counters."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from perception.geometry import se3
from perception.geometry.grids import LocalArea
from perception.kernels.voxels import merge_voxels, remembered_voxels
from perception.localization.scan_window import ScanWindow
from perception.obstacles.above_ground import AboveGround, split_by_ground
from perception.obstacles.config import MotionConfig
from perception.obstacles.free_space import FreeSpaceMemory, VisibilityHistory
from perception.obstacles.motion_counters import CounterSegmenter
from perception.obstacles.motion_segmenter import MotionSegmenter
from perception.obstacles.moving_clusters import BodiesBefore, VoxelColumns, moving_voxels
from perception.obstacles.range_image import Visibility
from perception.obstacles.rigid_bodies import OccupiedPlaces, moving_bodies
from perception.obstacles.voxels import KeyCounts, KeyGroups, Keys, VoxelGrid
from perception.sensor import HDL_64E, LidarModel
from perception.types import Bool, Float32, Float64, GroundModel, Int, Method, Obstacles, Voxels

_WORLD_CELLS = (2**20, 2**20, 2**18)  # 100 km across in voxels of 10 cm


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
        seen_keys = np.asarray(seen.keys, np.int64)
        stays, queried = remembered_voxels(
            known.keys,
            known.unseen_scans,
            centers_velo,
            seen_keys,
            np.asarray(moving, np.int64),
            self._area.rectangle,
            self._memory_scans,
        )
        stays[queried] = ~is_free(centers_velo.take(queried, axis=0))
        self._known = _StaticVoxels(
            *merge_voxels(
                known.keys,
                known.counts,
                known.unseen_scans,
                centers_velo,
                stays,
                seen_keys,
                seen.counts,
                self._grid.moved_centers(seen_keys, velo_SE3_world),
            )
        )
        self._world_SE3_velo = world_SE3_velo
        return Voxels(self._known.centers_velo, self._known.counts, self._grid.size_m)


@dataclass(frozen=True)
class VoxelizedScan:
    """Obstacle points of the newest scan and their voxels in the world.

    Attributes:
        above_ground: Obstacle points in the LiDAR frame.
        voxels: Voxels of these points.
        world_SE3_velo: (4, 4) pose of the scan.
        static_map: Static voxels of the drive so far.
    """

    above_ground: AboveGround
    voxels: KeyGroups
    world_SE3_velo: Float64
    static_map: StaticMap


class FreeSpaceSegmenter(MotionSegmenter[VoxelizedScan]):
    """Segments by free space: an object is moving where beams of earlier scans passed through its place."""

    def __init__(
        self, sensor: LidarModel, area: LocalArea, config: MotionConfig | None = None
    ) -> None:
        config = config or MotionConfig()
        self._area, self._config = area, config
        self._beam_step_rad = sensor.elevation_step_rad
        self._memory = FreeSpaceMemory(sensor, config.free_space.horizon_s, area.reach_m)
        self._grid_world: VoxelGrid | None = None
        self._static_map: StaticMap | None = None
        self._moved_before = np.zeros((0, 3), np.float32)
        self._world_SE3_before = np.eye(4)

    def voxelize(self, window: ScanWindow, ground: GroundModel) -> VoxelizedScan:
        """Take the newest scan's obstacles and their voxels, and remember its free space."""
        newest = window.newest
        grid, static_map = self._init_drive(window)
        self._memory.push(
            newest.points_velo, newest.world_SE3_velo, newest.stamp_s, newest.covariance
        )
        above_ground = split_by_ground(
            newest.points_velo, ground, self._area, self._config.free_space.min_ground_distance_m
        )
        voxels = grid.groups_of_moved(above_ground.points_velo, newest.world_SE3_velo)
        return VoxelizedScan(above_ground, voxels, newest.world_SE3_velo, static_map)

    def segment(self, voxelized: VoxelizedScan) -> Obstacles:
        """Call moving what fills free space; the rest joins the static map."""
        above_ground, voxels = voxelized.above_ground, voxelized.voxels
        pose = voxelized.world_SE3_velo
        # One measured point represents its voxel.
        places = above_ground.points_velo.take(voxels.first, axis=0)
        moved_m = se3.transform_points(
            se3.inverse(pose) @ self._world_SE3_before, self._moved_before
        )
        before = BodiesBefore.at(places, moved_m)
        history = self._memory.query(places)
        if len(places) == 0 or len(history.ages_s) == 0:
            moves = np.zeros(len(places), bool)
        else:
            columns, min_voxels = VoxelColumns.over(places), self._config.free_space.min_voxels
            moves = moving_voxels(places, history, before, self._beam_step_rad, min_voxels, columns)
            moves |= self._moving_bodies(places, columns.occupied, history, before, moves)
        # Rows by number are taken several times as fast as by a mask.
        moving_rows, static_rows = np.flatnonzero(moves), np.flatnonzero(~moves)
        is_moving = moves.take(voxels.group_of)
        self._moved_before, self._world_SE3_before = places.take(moving_rows, axis=0), pose

        seen, moving = _pick(voxels, static_rows), _pick(voxels, moving_rows)
        static = voxelized.static_map.update(
            seen, moving.keys, pose, self._memory.is_free_in_newest
        )
        return Obstacles(
            point_states=above_ground.point_states(is_moving),
            static=static,
            moving=Voxels(self._moved_before, moving.counts, self._config.voxel_size_m),
        )

    def _moving_bodies(
        self,
        places: Float32,
        clusters: Int,
        history: VisibilityHistory,
        before: BodiesBefore,
        moves: Bool,
    ) -> Bool:
        """Return which places belong to bodies of which most fills the place that it filled before."""
        # What the youngest scan has hit as well may have come to a halt.
        is_new = (history.appeared | history.uncovered) & (history.states[0] != Visibility.HIT)
        occupied = OccupiedPlaces(places, clusters, is_new, before.of > 0, moves, self._area)
        return moving_bodies(occupied, self._memory)

    def _init_drive(self, window: ScanWindow) -> tuple[VoxelGrid, StaticMap]:
        """Return the grid and the map, new ones at the start of a drive."""
        if self._grid_world is None or self._static_map is None or len(window) == 1:
            self._memory.clear()
            self._moved_before = np.zeros((0, 3), np.float32)
            voxel_size_m = self._config.voxel_size_m
            half_m = np.array(_WORLD_CELLS) * voxel_size_m / 2
            corner_m = window.newest.world_SE3_velo[:3, 3] - half_m
            self._grid_world = VoxelGrid(corner_m, _WORLD_CELLS, voxel_size_m)
            self._static_map = StaticMap(
                self._grid_world, self._area, self._config.free_space.memory_scans
            )
        return self._grid_world, self._static_map


def motion_segmenter(
    config: MotionConfig, method: Method, sensor: LidarModel, area: LocalArea
) -> MotionSegmenter[Any]:
    """Make the static-moving segmentation of a method.

    Args:
        config: Motion configuration.
        method: `default` for free space, `thesis` for occupancy counters.
        sensor: LiDAR model of the scans.
        area: Local area in which obstacles are reported.
    """
    if method == "thesis":
        return CounterSegmenter(area, config, static_threshold(config, sensor))
    return FreeSpaceSegmenter(sensor, area, config)


def static_threshold(config: MotionConfig, sensor: LidarModel) -> int:
    """Return T_s: the given one, or 50 points for m = 6 and an HDL-64E, in proportion to the points merged.

    A column is static by the number of its points, and that number grows with the scans and the beams.
    """
    if config.counters.static_threshold is not None:
        return config.counters.static_threshold
    points = (config.previous_scans + 1) * sensor.beams * sensor.columns
    return max(1, round(50 * points / (7 * HDL_64E.beams * HDL_64E.columns)))


def _pick(voxels: KeyGroups, rows: Int) -> KeyCounts:
    return KeyCounts(voxels.counted.keys.take(rows), voxels.counted.counts.take(rows))
