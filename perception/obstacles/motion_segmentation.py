"""Which obstacles stand and which move: the stage, by the thesis' method or by free space."""

from typing import Protocol

import numpy as np

from perception.geometry import se3
from perception.geometry.grids import LocalArea
from perception.obstacles.above_ground import AboveGround, split_by_ground
from perception.obstacles.dense_cloud import ScanWindow
from perception.obstacles.free_space import FreeSpaceMemory
from perception.obstacles.motion_counters import CounterSegmenter
from perception.obstacles.moving_clusters import MovingClusterConfig, moving_voxels
from perception.obstacles.static_map import StaticMap
from perception.obstacles.voxels import KeyCounts, KeyGroups, VoxelGrid, group_keys
from perception.sensor import LidarModel
from perception.types import Bool, Float64, GroundModel, Method, Obstacles, Voxels

_WORLD_CELLS = (2**20, 2**20, 2**18)  # 100 km across in voxels of 10 cm


class MotionSegmenter(Protocol):
    """Tells static from moving obstacles, scan after scan."""

    def update(self, window: ScanWindow, ground: GroundModel) -> Obstacles:
        """Segment the newest scan of the window; the ground is in its frame."""
        ...


class FreeSpaceSegmenter:
    """Segments by what earlier scans saw: a thing has come where beams passed before."""

    def __init__(
        self,
        sensor: LidarModel,
        area: LocalArea,
        voxel_size_m: float = 0.1,
        clearance_m: float = 0.15,
        horizon_s: float = 1.5,
        config: MovingClusterConfig | None = None,
    ) -> None:
        """Begin without a scan.

        Args:
            sensor: whose scans will come.
            area: in which obstacles are wanted.
            voxel_size_m: edge of a voxel, υ of the thesis.
            clearance_m: least distance of an obstacle point from the ground. The thesis' d_min is 20 cm;
                on a surface good to 5 cm, 15 cm still clear kerbs and three range noises.
            horizon_s: how long ago the oldest scan asked is; a walker at 0.5 m/s needs 1.5 s to leave
                his own place.
            config: when a thing counts as moving.
        """
        self._area = area
        self._voxel_size_m = voxel_size_m
        self._clearance_m = clearance_m
        self._config = config or MovingClusterConfig()
        self._gap_m = area.ahead_m * sensor.elevation_step_rad
        # 20 cm: range noise, pose error of 5 cm and the slant of a surface within a pixel. 12 m: seen
        # from farther back, a post of 10 cm at the end of the area falls between two beams.
        self._memory = FreeSpaceMemory(sensor, horizon_s, min_travel_m=12.0, margin_m=0.2)
        self._grid_world: VoxelGrid | None = None
        self._static_map: StaticMap | None = None
        self._moved_before = np.zeros((0, 3), np.float32)
        self._world_SE3_before = np.eye(4)

    def update(self, window: ScanWindow, ground: GroundModel) -> Obstacles:
        """Segment the newest scan; a window of one scan begins anew."""
        pose = window.newest.world_SE3_velo
        grid, static_map = self._init_drive(window)
        self._memory.push(window.newest.points_velo, pose)
        above_ground = split_by_ground(
            window.newest.points_velo, ground, self._area, self._clearance_m
        )
        voxels = group_keys(grid.keys(_to_world(above_ground, pose)))

        # One measured point stands for its voxel.
        places = above_ground.points_velo[voxels.first]
        before = se3.transform_points(
            se3.inverse(pose) @ self._world_SE3_before, self._moved_before
        )
        history = self._memory.query(places)
        moves = moving_voxels(places, history, before, self._config, self._gap_m)
        self._moved_before, self._world_SE3_before = places[moves], pose

        seen, moving = _pick(voxels, ~moves), _pick(voxels, moves)
        static = static_map.update(seen, moving.keys, pose, self._memory.is_free_in_newest)
        return Obstacles(
            point_states=above_ground.point_states(moves[voxels.group_of]),
            static=static,
            moving=Voxels(places[moves], moving.counts, self._voxel_size_m),
        )

    def _init_drive(self, window: ScanWindow) -> tuple[VoxelGrid, StaticMap]:
        """Return the grid and the map, new ones where the window begins anew."""
        if self._grid_world is None or self._static_map is None or len(window) == 1:
            self._memory.clear()
            self._moved_before = np.zeros((0, 3), np.float32)
            half_m = np.array(_WORLD_CELLS) * self._voxel_size_m / 2
            corner_m = window.newest.world_SE3_velo[:3, 3] - half_m
            self._grid_world = VoxelGrid(corner_m, _WORLD_CELLS, self._voxel_size_m)
            self._static_map = StaticMap(self._grid_world, self._area, memory_scans=6)
        return self._grid_world, self._static_map


def motion_segmenter(
    sensor: LidarModel, area: LocalArea, method: Method = "default"
) -> MotionSegmenter:
    """Make the segmenter of a method with its default values."""
    if method == "thesis":
        return CounterSegmenter(area)
    return FreeSpaceSegmenter(sensor, area)


def _to_world(above_ground: AboveGround, world_SE3_velo: Float64) -> Float64:
    points = above_ground.points_velo.astype(np.float64)
    return np.asarray(points @ world_SE3_velo[:3, :3].T + world_SE3_velo[:3, 3])


def _pick(voxels: KeyGroups, rows: Bool) -> KeyCounts:
    return KeyCounts(voxels.counted.keys[rows], voxels.counted.counts[rows])
