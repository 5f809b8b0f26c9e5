"""Maps of scans from above: equal to a plain reference, and what single returns make of them."""

from dataclasses import replace

import numpy as np
import pytest

from perception.detection.bev.bev_map import (
    BOTTOM,
    CHANNELS,
    EDGES_M,
    FREE,
    GROUND,
    HIDDEN,
    REFLECTANCE,
    SHARE,
    TOP,
    BevGrid,
    BevMapper,
    planes_of,
)
from perception.errors import UsageError
from perception.obstacles.range_image import SphericalProjection
from perception.sensor import HDL_64E, VLP_16, LidarModel
from tests.faults import fault

SMALL = BevGrid(reach_m=6.4, cell_m=0.2)
SENSOR = replace(VLP_16, azimuth_step_rad=float(np.radians(1.0)), height_m=1.5)


def reference_map(
    points: np.ndarray, heights_m: np.ndarray, sensor: LidarModel, grid: BevGrid
) -> np.ndarray:
    """Return (C, R, R) planes, cell by cell."""
    side = grid.side
    planes = np.zeros((CHANNELS, side, side), np.uint8)
    sums, counts = np.zeros((side, side)), np.zeros((side, side))
    for (x, y, _, reflectance), h in zip(points.tolist(), heights_m.tolist(), strict=True):
        i, j = (int(np.floor((one + grid.reach_m) / grid.cell_m)) for one in (x, y))
        is_outside = not (0 <= i < side and 0 <= j < side)
        if is_outside or np.hypot(x, y) < 1.5 or h >= EDGES_M[-1]:
            continue
        if h < EDGES_M[0]:
            planes[GROUND, i, j] = 255
            continue
        planes[np.searchsorted(EDGES_M, h, side="right") - 1, i, j] = 255
        level = int(np.float32(255) * np.float32(h) / np.float32(EDGES_M[-1]))
        planes[TOP, i, j] = max(planes[TOP, i, j], level)
        planes[BOTTOM, i, j] = max(planes[BOTTOM, i, j], 255 - level)
        sums[i, j] += reflectance
        counts[i, j] += 1
    for i, j in np.argwhere(counts):
        cells = int(np.hypot(i + 0.5 - side / 2, j + 0.5 - side / 2))
        distance_m = (cells + 0.5) * grid.cell_m
        beams = sensor.height_m + distance_m * np.tan(sensor.elevations_rad)
        full = grid.cell_m / (distance_m * sensor.azimuth_step_rad)
        full *= ((beams > 0.2) & (beams < 2.0)).sum()
        planes[SHARE, i, j] = int(255 * min(counts[i, j] / max(full, 1), 1))
        planes[REFLECTANCE, i, j] = int(255 * min(sums[i, j] / counts[i, j], 1))
    return planes


def reference_visibility(points: np.ndarray, sensor: LidarModel, grid: BevGrid) -> np.ndarray:
    """Return (2, R, R) planes of free and hidden cells, cell by cell and beam by beam."""
    projection = SphericalProjection(sensor, tolerance_m=0.1)
    pixels = projection.pixels(points)
    ranges_m = np.full((projection.rows, projection.columns), np.inf)
    inside = pixels.is_in_view
    np.minimum.at(ranges_m, (pixels.rows[inside], pixels.columns[inside]), pixels.ranges_m[inside])
    planes = np.zeros((2, grid.side, grid.side), np.uint8)
    for i in range(grid.side):
        for j in range(grid.side):
            x, y = i + 0.5 - grid.side / 2, j + 0.5 - grid.side / 2
            turns = np.mod(np.arctan2(y, x) / (2 * np.pi), 1)
            column = min(int(turns * projection.columns), projection.columns - 1)
            place = int(np.hypot(x, y))
            heights = sensor.height_m + (place + 0.5) * grid.cell_m * np.tan(sensor.elevations_rad)
            here = ranges_m[:, column]
            comes = (heights > 0.2) & (heights < 2.0) & np.isfinite(here)
            ends = here[comes] * np.cos(sensor.elevations_rad[comes]) / grid.cell_m
            is_free = (np.floor(ends) > place).any()
            is_hidden = not is_free and (np.floor(ends) < place).any()
            planes[:, i, j] = 255 * is_free, 255 * is_hidden
    return planes


@pytest.fixture(scope="module")
def scan() -> tuple[np.ndarray, np.ndarray]:
    """Return points in and around the small map, and their heights above the ground."""
    rng = np.random.default_rng(3)
    points = rng.uniform((-9, -9, -1.5, 0), (9, 9, 1.0, 1), (700, 4)).astype(np.float32)
    points[:20] = 0  # without a return
    return points, np.asarray(points[:, 2] + SENSOR.height_m, np.float32)


def test_a_map_is_that_of_the_reference(scan):
    points, heights_m = scan
    planes = planes_of(BevMapper(SENSOR, SMALL).make(points, heights_m))
    expected = reference_map(points, heights_m, SENSOR, SMALL)
    # Shares and means are rounded in single precision.
    difference = np.abs(planes[:FREE].astype(int) - expected[:FREE])
    assert difference.max() <= 1
    assert (difference > 0).mean() < 1e-3
    assert expected[GROUND].any()
    visible = reference_visibility(points, SENSOR, SMALL)
    assert (planes[FREE:] == visible).mean() > 0.999
    assert ((visible > 0).reshape(2, -1).mean(axis=1) > 0.02).all()


def test_a_wall_hides_what_is_behind_it_and_frees_what_is_before():
    azimuths = np.linspace(-0.1, 0.1, 200)
    walls = []
    for elevation in SENSOR.elevations_rad:
        z = 4.0 * np.tan(elevation)
        walls.append(np.column_stack([np.full(200, 4.0), 4.0 * np.tan(azimuths), np.full(200, z), np.full(200, 0.5)]))  # fmt: skip
    points = np.concatenate(walls).astype(np.float32)
    heights_m = np.asarray(points[:, 2] + SENSOR.height_m, np.float32)
    planes = planes_of(BevMapper(SENSOR, SMALL).make(points, heights_m))
    row = {x_m: int((x_m + SMALL.reach_m) / SMALL.cell_m) for x_m in (-4.0, 2.5, 4.01, 5.5)}
    middle = SMALL.side // 2
    assert planes[[FREE, HIDDEN], row[2.5], middle].tolist() == [255, 0]
    assert planes[[FREE, HIDDEN], row[5.5], middle].tolist() == [0, 255]
    assert planes[[FREE, HIDDEN], row[-4.0], middle].tolist() == [0, 0]
    # Each beam that comes between knee and roof ends here, in as many columns as fit.
    assert planes[SHARE, row[4.01], middle] == 255
    assert planes[REFLECTANCE, row[4.01], middle] == 127


def test_half_of_the_beams_make_the_same_share_of_a_full_cell():
    """What tells of the sensor is how many returns there are, and the map does not."""
    shares = []
    for step in (1, 2):
        sensor = replace(HDL_64E, elevations_rad=HDL_64E.elevations_rad[::step])
        azimuths = np.linspace(-0.2, 0.2, round(0.4 / sensor.azimuth_step_rad))
        directions = np.stack(np.meshgrid(azimuths, sensor.elevations_rad), -1).reshape(-1, 2)
        x = np.full(len(directions), 15.1)
        y, z = x * np.tan(directions[:, 0]), np.hypot(x, x * np.tan(directions[:, 0])) * np.tan(directions[:, 1])  # fmt: skip
        heights_m = z + sensor.height_m
        is_wall = (heights_m > 0.2) & (heights_m < 1.1)
        points = np.column_stack([x, y, z, x * 0])[is_wall].astype(np.float32)
        grid = BevGrid()
        planes = planes_of(
            BevMapper(sensor, grid).make(points, heights_m[is_wall].astype(np.float32))
        )
        wall = planes[SHARE, int((15.1 + grid.reach_m) / grid.cell_m)]
        shares.append(np.median(wall[wall > 0]) / 255)
    assert shares[0] == pytest.approx(shares[1], abs=0.08)
    assert 0.4 < shares[0] < 0.65


def test_planes_are_what_the_blocks_hold():
    blocks = np.zeros((2, 2, 16, CHANNELS), np.uint8)
    blocks[1, 0, 8 + 2 + 1, TOP] = 7  # the third row and second column of 4, odd in both
    planes = planes_of(blocks)
    assert np.argwhere(planes).tolist() == [[TOP, 4 + 3, 1]]


def test_an_empty_scan_is_an_empty_map():
    empty = np.zeros((0, 4), np.float32)
    assert not BevMapper(SENSOR, SMALL).make(empty, empty[:, 0].copy()).any()


def test_a_side_is_a_whole_number_of_cells():
    with fault(UsageError, expected="a side of a multiple of 32 cells", found="100 m in cells of 0.3 m"):  # fmt: skip
        BevGrid(reach_m=50, cell_m=0.3)
    assert BevGrid().side == 512
