"""A scan from above as an 8-bit map that does not tell which sensor took it.

        x ^ row        planes:
          |            slices        returns in each slice of height above the ground
          |            top, bottom   highest and lowest of them
    y <---o            share         their number over that of a full cell at this distance, by the sensor's beams
   column              reflectance   their mean
                       ground        returns of the ground
                       free, hidden  a beam passed, or all that came ended before; neither where no beam came

A map is held by blocks of 4x4 cells, (R / 4, R / 4, 16, C), and a block by blocks of 2x2: what the first layers of the
network take as they are, since convolutions over the whole map would take most of its time.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from perception.errors import UsageError
from perception.geometry.grids import LocalArea
from perception.kernels.bev import fill_cells, fill_visibility
from perception.kernels.range_images import nearest_returns
from perception.localization.scan_window import PosedScan, ScanWindow
from perception.obstacles.config import GroundSurfaceConfig
from perception.obstacles.ground_surface import GroundSurfaceEstimator
from perception.obstacles.range_image import SphericalProjection
from perception.sensor import LidarModel
from perception.types import Float32, Float64, GroundModel, Int, UInt8

# Edges of the slices above the ground in metres: knees, bonnets, windows, roofs, lorries. Lower returns are ground.
EDGES_M = (0.2, 0.6, 1.0, 1.5, 2.2, 4.5)
SLICES = len(EDGES_M) - 1
TOP, BOTTOM, SHARE, REFLECTANCE, GROUND, FREE, HIDDEN = range(SLICES, SLICES + 7)
CHANNELS = SLICES + 7
BLOCK = 4  # cells along the side of a block
SIDE_STEP = 32  # divides the number of cells along a side
_OBJECT_M = (0.2, 2.0)  # heights in which a beam tells whether a cell is free
_BLIND_M = 1.5  # around the sensor there is the vehicle itself
# Nodes farther apart than along the road, and one fit of them: 3 ms in place of 7, and 2 cm more of error at 40 m.
_GROUND = GroundSurfaceConfig(cell_m=3.2, max_points=30_000, remembered_scans=0, rounds=1)
_MAX_SIDE_CELLS = 2048


@dataclass(frozen=True)
class BevGrid:
    """Cells of the map, around the sensor.

    Attributes:
        reach_m: Distance in metres from the sensor to each side of the map.
        cell_m: Edge of a cell in metres; a side has a multiple of 32 cells.
    """

    reach_m: float = 51.2
    cell_m: float = 0.2

    def __post_init__(self) -> None:
        """Validate the number of cells."""
        cells = 2 * self.reach_m / self.cell_m if self.cell_m > 0 else 0
        whole = round(cells)
        if not 0 < whole <= _MAX_SIDE_CELLS or whole % SIDE_STEP or abs(cells - whole) > 1e-6:
            raise UsageError(
                "bird's-eye view",
                expected=f"a side of a multiple of {SIDE_STEP} cells, up to {_MAX_SIDE_CELLS}",
                found=f"{2 * self.reach_m:g} m in cells of {self.cell_m:g} m",
            )

    @property
    def side(self) -> int:
        """Number of cells along a side, R."""
        return round(2 * self.reach_m / self.cell_m)

    @property
    def area(self) -> LocalArea:
        """Area of the map."""
        return LocalArea(self.reach_m, self.reach_m, self.reach_m, EDGES_M[-1])


class BevMapper:
    """Makes the maps of the scans of one sensor."""

    def __init__(self, sensor: LidarModel, grid: BevGrid) -> None:
        """Lay out the cells.

        Args:
            sensor: LiDAR model of the scans, with its height above the ground.
            grid: Cells of the map.
        """
        self._sensor, self.grid = sensor, grid
        self._projection = SphericalProjection(sensor, tolerance_m=0.1)
        self._bins = int(np.ceil(np.sqrt(2) * grid.reach_m / grid.cell_m)) + 1
        self._full_returns = np.maximum(self._returns_of_full_cells(), 1).astype(np.float32)
        self._cosines = np.cos(sensor.elevations_rad).astype(np.float32)
        self._spans = self._spans_of_beams()

    def ground(self, points_velo: Float32) -> GroundModel:
        """Return the ground of one scan, (N, 4), over the map."""
        return self.ground_estimator.update(_window(points_velo))

    @cached_property
    def ground_estimator(self) -> GroundSurfaceEstimator:
        """Estimator of the ground of single scans over the map."""
        return GroundSurfaceEstimator(self._sensor, self.grid.area, _GROUND)

    def make(self, points_velo: Float32, heights_m: Float32) -> UInt8:
        """Return the (R / 4, R / 4, 16, C) map of a scan.

        Args:
            points_velo: (N, 4) points.
            heights_m: (N,) heights above the ground.
        """
        side, cell_m = self.grid.side, self.grid.cell_m
        blocks = np.zeros((side // BLOCK, side // BLOCK, BLOCK**2, CHANNELS), np.uint8)
        edges_m = np.array(EDGES_M, np.float32)
        fill_cells(points_velo, heights_m, edges_m, cell_m, _BLIND_M, self._full_returns, blocks)
        projection = self._projection
        ranges_m = nearest_returns(points_velo, *projection.numbers, projection.rows)
        fill_visibility(
            ranges_m, self._cosines, self._spans, cell_m, self._bins, self._bin_of_cell, blocks
        )  # fmt: skip
        return blocks

    def _returns_of_full_cells(self) -> Float64:
        """Return how many returns a cell that is full between two heights has, by its distance in cells."""
        distances_m = self._distances_m
        columns = self.grid.cell_m / (distances_m * self._sensor.azimuth_step_rad)
        heights_m = self._beam_heights_m(distances_m)
        is_in = (heights_m > _OBJECT_M[0]) & (heights_m < _OBJECT_M[1])
        return np.asarray(columns * is_in.sum(axis=0), np.float64)

    def _spans_of_beams(self) -> Int:
        """Return (L, 2) the bins of distance between which each beam is as high as objects are."""
        heights_m = self._beam_heights_m(self._distances_m)
        is_in = (heights_m > _OBJECT_M[0]) & (heights_m < _OBJECT_M[1])
        first, last = is_in.argmax(axis=1), self._bins - is_in[:, ::-1].argmax(axis=1)
        spans = np.stack([first, np.where(is_in.any(axis=1), last, first)], axis=1)
        return np.ascontiguousarray(spans, np.int32)

    @property
    def _distances_m(self) -> Float64:
        """(bins,) middles of the bins of distance."""
        return np.asarray((np.arange(self._bins) + 0.5) * self.grid.cell_m, np.float64)

    def _beam_heights_m(self, distances_m: Float64) -> Float64:
        slopes = np.tan(self._sensor.elevations_rad)[:, None]
        return np.asarray(self._sensor.height_m + slopes * distances_m)

    @cached_property
    def _bin_of_cell(self) -> Int:
        side, columns = self.grid.side, self._projection.columns
        middles = np.arange(side) + 0.5 - side / 2
        x, y = np.meshgrid(middles, middles, indexing="ij")
        turns = np.mod(np.arctan2(y, x) / (2 * np.pi), 1.0)
        column = np.minimum((turns * columns).astype(np.int64), columns - 1)
        places = np.hypot(x, y).astype(np.int64) * columns + column
        blocks = side // BLOCK
        in_blocks = places.reshape(blocks, 2, 2, blocks, 2, 2).transpose(0, 3, 1, 4, 2, 5)
        return np.asarray(in_blocks.reshape(blocks, blocks, BLOCK**2), np.int32)


def planes_of(blocks: UInt8) -> UInt8:
    """Return the (C, R, R) planes of a map in blocks."""
    side, _, _, channels = blocks.shape
    # Rows and columns of blocks, of blocks of 2x2 in these, and of cells in those.
    split = blocks.reshape(side, side, 2, 2, 2, 2, channels).transpose(6, 0, 2, 4, 1, 3, 5)
    return split.reshape(channels, BLOCK * side, BLOCK * side)


def _window(points_velo: Float32) -> ScanWindow:
    window = ScanWindow(0)
    window.push(PosedScan(points_velo, np.eye(4)))
    return window
