"""The thesis' detector of moving objects: 2.5D grids instead of voxels and registration (5.2)."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from perception.datmo.cell_grid import CellGrid
from perception.datmo.config import THESIS, MotionGridConfig
from perception.datmo.detector import DetectedObjects, SegmentedScan
from perception.datmo.elevation import ElevationGrid, LevelPlane, elevation_grid
from perception.datmo.grid_objects import LabelledCells, find_objects, motion_grid
from perception.datmo.short_term_map import ShortTermMap
from perception.errors import UsageError
from perception.geometry.footprints import Footprints, footprints_of
from perception.sensor import LidarModel
from perception.types import Float32, GroundModel

_MAX_HEIGHT_M = 2.0  # of a cell that may move; leaves out trees, signs and bridges


@dataclass(frozen=True)
class MotionGrids:
    """Grids of one scan.

    Attributes:
        config: Configuration of the detector.
        work_cells: Cells of E and S.
        cells: Cells of the other grids, over the area of reported objects.
        elevation: E, over the work area.
        background_m: S, the short-term map over the work area.
        motion_m: M, after false detections were suppressed.
        found: Objects in M.
    """

    config: MotionGridConfig
    work_cells: CellGrid
    cells: CellGrid
    elevation: ElevationGrid
    background_m: Float32
    motion_m: Float32
    found: LabelledCells

    @cached_property
    def subtracted_m(self) -> Float32:
        """M before suppression: each cell is compared with its own place in the map alone."""
        return moving_in_area(self.elevation, self.background_m, self.config, radius_cells=0)


def moving_in_area(
    elevation: ElevationGrid, background_m: Float32, config: MotionGridConfig, radius_cells: int
) -> Float32:
    """Return M over the area of reported objects; the map is larger."""
    part = CellGrid.covering(config.work_area, config.cell_m).part(config.area)
    height_m = elevation.height_m[part]
    candidate_m = np.zeros_like(elevation.height_m)
    candidate_m[part] = np.where(height_m < _MAX_HEIGHT_M, height_m, 0)
    return motion_grid(candidate_m, background_m, config.alpha, radius_cells)[part]


class MotionGridDetector:
    """Finds moving objects by comparing each scan with a short-term map, scan after scan."""

    def __init__(self, sensor: LidarModel, config: MotionGridConfig = THESIS) -> None:
        self._config = config
        self._plane = LevelPlane(-sensor.height_m)
        # Over a longer gap, every stored scan would have left the queue.
        self._longest_gap_s = config.scans / sensor.rate_hz
        self._work_cells = CellGrid.covering(config.work_area, config.cell_m)
        self._cells = CellGrid.covering(config.area, config.cell_m)
        self._map = ShortTermMap(self._work_cells, config)
        self._stamp_s: float | None = None
        self._objects = DetectedObjects(Footprints.empty(), Footprints.empty())
        self._grids: MotionGrids | None = None

    @property
    def grids(self) -> MotionGrids:
        """Grids of the last scan, for plots.

        Raises:
            UsageError: there was none.
        """
        if self._grids is None:
            raise UsageError("motion grids", expected="a scan before they are asked", found="none")
        return self._grids

    def detect(self, scan: SegmentedScan) -> DetectedObjects:
        """Detect moving objects; static ones are not segmented.

        The map uses the poses of the INS: the method tolerates their errors.
        """
        since_s = None if self._stamp_s is None else scan.stamp_s - self._stamp_s
        self._stamp_s = scan.stamp_s
        if since_s is not None:
            if scan.is_reset or not 0 <= since_s <= self._longest_gap_s:
                self._map.clear()
            elif since_s == 0:  # a repeated scan: counted once
                return self._objects

        config = self._config
        ground = scan.ground if config.height_reference == "ground" else self._plane
        elevation = elevation_grid(scan.points_velo, ground, self._work_cells, config)
        background_m = self._map.update(elevation, scan.ins_world_SE3_velo)
        motion_m = moving_in_area(elevation, background_m, config, config.radius_cells)
        if self._map.scans < config.min_observations:
            # No cell of the map has a value yet: every static object would be moving.
            motion_m = np.zeros_like(motion_m)
        found = find_objects(motion_m, config)
        self._grids = MotionGrids(
            config, self._work_cells, self._cells, elevation, background_m, motion_m, found
        )
        self._objects = DetectedObjects(_outline(self._grids, scan.ground), Footprints.empty())
        return self._objects


def _outline(grids: MotionGrids, ground: GroundModel) -> Footprints:
    """Return the footprint of each object: its cells in top view, from the ground to its largest height."""
    found = grids.found
    rows, columns = np.nonzero(found.labels)
    cluster_of = found.labels[rows, columns] - 1
    motion_m = grids.motion_m[rows, columns]
    centers_m = np.column_stack([grids.cells.centers_m(rows, columns), motion_m])
    clusters = footprints_of(centers_m, cluster_of, found.count)
    low_m = np.asarray(ground.height_m(clusters.centroids_m), np.float64)
    points = grids.elevation.points[grids.work_cells.part(grids.config.area)][rows, columns]
    of_cluster = np.bincount(cluster_of, points * (motion_m > 0), found.count).astype(np.int64)
    return replace(clusters, low_m=low_m, high_m=low_m + clusters.high_m, points=of_cluster)
