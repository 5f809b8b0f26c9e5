"""A table of the occupied voxels of a scan, and the mean points of those around a place.

Voxels are found by the bars of 62 that they form along z, in a map of the ground plane. A cell of the map holds the
number of its bar, 0 without one. A bar has a bit for each occupied voxel, and the number of the lowest of them:

    cell of the map, bar 7   ->   bits 00101100..., first 17   ->   voxels 2, 4 and 5 of the bar are numbers 17, 18, 19

Every voxel holds one mean point, so that the nearest one within the edge of a voxel lies in the 27 voxels around.
"""

import numpy as np
from numpy.typing import NDArray

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled, written
from perception.kernels.moments import add_point
from perception.types import Float32, Float64, Int

# The map has 512 cells a side, of which 16 at each border stay empty: what is looked for around a cell is in the map.
_SIDE, _BORDER = 512, 16
_UP, _DOWN = 38, 24  # voxels of a bar above and below the origin
_MAX_BARS = 2**16 - 1

# Number of the bar of each cell, along x first, and (bars + 1, 2) bits and first voxel of each bar.
VoxelTable = tuple[NDArray[np.uint16], Int]
NO_TABLE: VoxelTable = (np.zeros(0, np.uint16), np.zeros((0, 2), np.int64))

_POINTS, ROWS = array_of(np.float32, 2), array_of(np.float64, 2)
TABLE = (array_of(np.uint16), array_of(np.int64, 2))


@compiled((WHOLE,))
def _count_bits(bits: int) -> int:
    """Return the number of bits that are set among the lowest 62."""
    bits = bits - ((bits >> 1) & 0x5555555555555555)
    bits = (bits & 0x3333333333333333) + ((bits >> 2) & 0x3333333333333333)
    bits = (bits + (bits >> 4)) & 0x0F0F0F0F0F0F0F0F
    return (bits * 0x0101010101010101) >> 56


@compiled((NUMBER, NUMBER))
def _cell(x: float, y: float) -> int:
    """Return the cell of the map that holds a position in edges of a voxel, -1 outside."""
    inner = _SIDE // 2 - _BORDER
    if not (abs(x) < inner and abs(y) < inner):
        return -1
    return (int(np.floor(y)) + _SIDE // 2) * _SIDE + int(np.floor(x)) + _SIDE // 2


@compiled((WHOLE, WHOLE))
def _window(level: int, rings: int) -> int:
    """Return the bits of a bar up to so many voxels above and below a level, at most 15."""
    low, bits = level - rings, (1 << (2 * rings + 1)) - 1
    if low < -2 * rings or low >= _DOWN + _UP:
        return 0
    return bits << low if low >= 0 else bits >> -low


@compiled((_POINTS, NUMBER), (ROWS, NUMBER))
def find_voxels(points: Float32 | Float64, edge_m: float) -> tuple[Int, VoxelTable]:
    """Return the (N,) number of the voxel of each point, -1 where it is left out, and the table of the voxels."""
    count = len(points)
    bar_of_cell, bars = np.zeros(_SIDE * _SIDE, np.uint16), np.zeros((count + 1, 2), np.int64)
    bar_of, bit_of = np.zeros(count, np.int64), np.empty(count, np.int64)
    found = 0
    for number in range(count):
        x, y, z = points[number, 0], points[number, 1], points[number, 2]
        cell, level = _cell(x / edge_m, y / edge_m), np.floor(z / edge_m) + _DOWN
        if cell < 0 or not (level >= 0 and level < _DOWN + _UP):
            continue
        if bar_of_cell[cell] == 0:
            if found == _MAX_BARS:
                continue
            found += 1
            bar_of_cell[cell] = found
        bar_of[number], bit_of[number] = bar_of_cell[cell], 1 << int(level)
        bars[bar_of[number], 0] |= bit_of[number]
    voxels = 0
    for bar in range(found + 1):
        bars[bar, 1] = voxels
        voxels += _count_bits(bars[bar, 0])
    for number in range(count):
        bar = bar_of[number]
        lower = bars[bar, 0] & (bit_of[number] - 1)
        bar_of[number] = bars[bar, 1] + _count_bits(lower) if bar > 0 else -1
    return bar_of, (bar_of_cell, bars[: found + 1].copy())


@compiled((array_of(np.int64, 2),))
def count_voxels(bars: Int) -> int:
    """Return the number of voxels of a table."""
    return int(bars[-1, 1] + _count_bits(bars[-1, 0]))


@compiled((_POINTS, NUMBER))
def voxel_moments(points: Float32, edge_m: float) -> tuple[Float64, VoxelTable]:
    """Sum (N, 3+) points by voxels; points beyond the map, 240 voxels away, or of too many bars are left out.

    Returns:
        (M, 10) number of points, sums of x, y, z, and of xx, xy, xz, yy, yz, zz; the table of the voxels.
    """
    voxel_of, table = find_voxels(points, edge_m)
    moments = np.zeros((count_voxels(table[1]), 10))
    for number in range(len(points)):
        if voxel_of[number] < 0:
            continue
        x, y, z = points[number, 0], points[number, 1], points[number, 2]
        add_point(np.float64(x), np.float64(y), np.float64(z), moments[voxel_of[number]])
    return moments, table


@compiled((ROWS, TABLE, NUMBER, array_of(np.float64), WHOLE, written(np.float64)))
def add_around(
    moments: Float64, table: VoxelTable, edge_m: float, place: Float64, rings: int, total: Float64
) -> int:
    """Sum the moments of the voxels around a place, 27 in one ring, and return the number of occupied ones."""
    bar_of_cell, bars = table
    voxels, cell = 0, _cell(place[0] / edge_m, place[1] / edge_m)
    # Ten numbers in registers: sums in an array take half as long again.
    points, x, y, z, xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    window = _window(int(np.floor(place[2] / edge_m)) + _DOWN, rings)
    for row in range(cell - rings * _SIDE, cell + rings * _SIDE + 1, _SIDE):
        for around in range(row - rings, row + rings + 1):
            bar = bar_of_cell[around]
            occupied = bars[bar, 0] & window
            if occupied == 0:
                continue
            first = bars[bar, 1] + _count_bits(bars[bar, 0] & ((occupied & -occupied) - 1))
            for number in range(first, first + _count_bits(occupied)):
                voxels += 1
                one = moments[number]
                points, x, y, z = points + one[0], x + one[1], y + one[2], z + one[3]
                xx, xy, xz = xx + one[4], xy + one[5], xz + one[6]
                yy, yz, zz = yy + one[7], yz + one[8], zz + one[9]
    total[0], total[1], total[2], total[3], total[4] = points, x, y, z, xx
    total[5], total[6], total[7], total[8], total[9] = xy, xz, yy, yz, zz
    return voxels


@compiled((ROWS, TABLE, NUMBER, NUMBER, NUMBER, NUMBER, NUMBER))
def nearest_mean(
    surfaces: Float64,
    table: VoxelTable,
    edge_m: float,
    x: float,
    y: float,
    z: float,
    reach_m: float,
) -> int:
    """Return the row of the mean point nearest to a position within reach, at most 15 voxels; else -1."""
    bar_of_cell, bars = table
    u, v = x / edge_m, y / edge_m
    cell = _cell(u, v)
    if cell < 0:
        return -1
    u, v = u - np.floor(u), v - np.floor(v)
    rings = int(np.ceil(reach_m / edge_m))
    window = _window(int(np.floor(z / edge_m)) + _DOWN, rings)
    best, nearest = reach_m * reach_m, -1
    margin = min(u, 1 - u, v, 1 - v)  # to the nearest side of the cell
    # The bar of the position comes first: it leaves few others to search.
    for ring in range(rings + 1):
        if ring > 0 and ((ring - 1 + margin) * edge_m) ** 2 >= best:
            break
        for j in range(-ring, ring + 1):
            along = 0.0 if j == 0 else ((v - j - 1 if j < 0 else j - v) * edge_m) ** 2
            step = 1 if abs(j) == ring else max(2 * ring, 1)
            for i in range(-ring, ring + 1, step):
                bar = bar_of_cell[cell + j * _SIDE + i]
                occupied = bars[bar, 0] & window
                if occupied == 0:
                    continue
                across = 0.0 if i == 0 else ((u - i - 1 if i < 0 else i - u) * edge_m) ** 2
                if across + along >= best:
                    continue
                first = bars[bar, 1] + _count_bits(bars[bar, 0] & ((occupied & -occupied) - 1))
                for row in range(first, first + _count_bits(occupied)):
                    dx, dy = surfaces[row, 0] - x, surfaces[row, 1] - y
                    dz = surfaces[row, 2] - z
                    distance = dx * dx + dy * dy + dz * dz
                    if distance < best:
                        best, nearest = distance, row
    return nearest
