"""Scan matching: the mean point of each occupied voxel with its surface normal, and GICP between two such clouds.

Voxels are found by the bars of 62 that they form along z, in a map of the ground plane. A cell of the map holds the
number of its bar, 0 without one. A bar has a bit for each occupied voxel, and the number of the lowest of them:

    cell of the map, bar 7   ->   bits 00101100..., first 17   ->   voxels 2, 4 and 5 of the bar are numbers 17, 18, 19

Every voxel holds one mean point, so that the nearest one within the edge of a voxel lies in the 27 voxels around.
"""

import numpy as np
from numpy.typing import NDArray

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled, written
from perception.kernels.moments import add_point, flattest_direction, write_covariance
from perception.types import Float32, Float64, Int

# The map has 512 cells a side, of which 16 at each border stay empty: what is looked for around a cell is in the map.
_SIDE, _BORDER = 512, 16
_UP, _DOWN = 38, 24  # voxels of a bar above and below the origin
_MAX_BARS = 2**16 - 1
_MIN_VOXELS = 5  # fewer do not determine a surface
_RINGS = (1, 2)  # of voxels around one
_WIDER, _WIDE_RINGS = (2.0, 3.0), 2  # whole edges of wider voxels, and rings of these
# Ratio of the variances across and along a surface: the beams of a sparse LiDAR lie far apart on the ground, and points of
# one beam make a line. On synthetic streets, without INS, VLP-16, errors over a second: 71 mm and 0.94 degrees at 0, 11 and 0.18
# at 0.35; HDL-64E 5.6, 5.8 mm. Voxels of 4 edges in place of 3: HDL-32E 4.8 to 5.9 mm.
_MIN_BREADTH = 0.35
# Ratio of the variances through and across a surface of wider voxels, which may hold more than one.
_MAX_THICKNESS = 0.05
# Sine of the least angle between a beam and a surface that it shows. What one beam hits in leaves and grass, here near, there
# far, is flat, too: a fan through the LiDAR, which comes along with it. On synthetic streets, without INS, errors of pitch
# over a second: OS0-32 4.7 mrad with fans, 1.5 without; VLP-16 6.8 and 3.1; HDL-64E 0.13 and 0.15. As good from 0.015 to 0.04.
_MIN_GRAZING = 0.02
# Squared noise along the normal of a surface, relative to that along the surface (GICP, Segal et al. 2009).
_FLATNESS = 1e-3
_LOOSER = 3.0  # steps so much larger than the last one still keep their matches, and end the alignment of a quarter
_EIGHTHS = 8
# Share of the inverse of the information matrix in a covariance. By it and the factor of `alignment` 90 % of the errors of
# 720 registrations lie in the 90 % region of all six directions (VLP-16, HDL-32E; steps of 0.1 to 0.5 s); 48 % without it.
_SHRINKAGE = 0.2
_TURN_RADIUS_M = 10.0  # a turn about the LiDAR weighs as the motion of points that far away

# Number of the bar of each cell, along x first, and (bars + 1, 2) bits and first voxel of each bar.
VoxelTable = tuple[NDArray[np.uint16], Int]

# Wider voxels: that of each voxel, their table, moments and surfaces; and what normals are found from, the moments of the
# voxels and wider ones of both sizes. A normal that is not known so far is NaN: most points of a target are never matched.
WiderVoxels = tuple[Int, VoxelTable, Float64, Float64]
NormalSources = tuple[Float64, WiderVoxels, WiderVoxels]
_NO_TABLE = (np.zeros(0, np.uint16), np.zeros((0, 2), np.int64))
_NO_VOXELS = (np.zeros(0, np.int64), _NO_TABLE, np.zeros((0, 10)), np.zeros((0, 6)))
ALL_KNOWN: NormalSources = (np.zeros((0, 10)), _NO_VOXELS, _NO_VOXELS)

_POINTS, ROWS = array_of(np.float32, 2), array_of(np.float64, 2)
TABLE, SURFACES = (array_of(np.uint16), array_of(np.int64, 2)), written(np.float64, 2)
_WIDER_VOXELS = (array_of(np.int64), TABLE, ROWS, SURFACES)
SOURCES = (ROWS, _WIDER_VOXELS, _WIDER_VOXELS)
# Sums of moments and a covariance: memory that would otherwise be taken for each normal.
_SCRATCH = (written(np.float64), written(np.float64, 2))


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
def _find_voxels(points: Float32 | Float64, edge_m: float) -> tuple[Int, VoxelTable]:
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
def _count_voxels(bars: Int) -> int:
    """Return the number of voxels of a table."""
    return int(bars[-1, 1] + _count_bits(bars[-1, 0]))


@compiled((_POINTS, NUMBER))
def voxel_moments(points: Float32, edge_m: float) -> tuple[Float64, VoxelTable]:
    """Sum (N, 3+) points by voxels; points beyond the map, 240 voxels away, or of too many bars are left out.

    Returns:
        (M, 10) number of points, sums of x, y, z, and of xx, xy, xz, yy, yz, zz; the table of the voxels.
    """
    voxel_of, table = _find_voxels(points, edge_m)
    moments = np.zeros((_count_voxels(table[1]), 10))
    for number in range(len(points)):
        if voxel_of[number] < 0:
            continue
        x, y, z = points[number, 0], points[number, 1], points[number, 2]
        add_point(np.float64(x), np.float64(y), np.float64(z), moments[voxel_of[number]])
    return moments, table


@compiled((ROWS, TABLE, NUMBER, array_of(np.float64), WHOLE, written(np.float64)))
def _add_around(
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


@compiled((array_of(np.float64), (NUMBER, NUMBER, NUMBER)))
def _is_faced(place: Float64, normal: tuple[float, float, float]) -> bool:
    """Return whether a beam hits a plane at a place at more than the least angle; none does without a normal."""
    x, y, z = place[0], place[1], place[2]
    through = x * normal[0] + y * normal[1] + z * normal[2]
    return bool(through * through > _MIN_GRAZING**2 * (x * x + y * y + z * z))


@compiled((ROWS, TABLE, NUMBER, WHOLE, WHOLE, NUMBER, _SCRATCH, SURFACES))
def _add_normal(
    moments: Float64,
    table: VoxelTable,
    edge_m: float,
    row: int,
    rings: int,
    max_thickness: float,
    scratch: tuple[Float64, Float64],
    surfaces: Float64,
) -> None:
    """Write the normal of one of (M, 6) surfaces by the voxels around, where they determine it."""
    total, covariance = scratch
    if _add_around(moments, table, edge_m, surfaces[row, :3], rings, total) >= _MIN_VOXELS:
        write_covariance(total, covariance)
        normal = flattest_direction(covariance, _MIN_BREADTH, max_thickness)
        if _is_faced(surfaces[row, :3], normal):
            surfaces[row, 3], surfaces[row, 4], surfaces[row, 5] = normal


@compiled((ROWS,))
def _means(moments: Float64) -> Float64:
    """Return (M, 6) surfaces: the mean point of each voxel, without a normal, NaN."""
    surfaces = np.full((len(moments), 6), np.nan)
    for row in range(len(moments)):
        for axis in range(3):
            surfaces[row, axis] = moments[row, 1 + axis] / moments[row, 0]
    return surfaces


@compiled((ROWS, ROWS, NUMBER))
def _widened(moments: Float64, surfaces: Float64, edge_m: float) -> WiderVoxels:
    """Return voxels of another size, their normals not known so far."""
    wider_of, table = _find_voxels(surfaces, edge_m)
    sums = np.zeros((_count_voxels(table[1]), 10))
    for row in range(len(moments)):
        for entry in range(10):
            sums[wider_of[row], entry] += moments[row, entry]
    return wider_of, table, sums, _means(sums)


@compiled((ROWS, NUMBER))
def unfitted_surfaces(moments: Float64, edge_m: float) -> tuple[Float64, NormalSources]:
    """Return (M, 6) the mean point of each voxel, its normal not known so far, and what the normals are found from."""
    surfaces = _means(moments)
    wider = _widened(moments, surfaces, _WIDER[0] * edge_m)
    return surfaces, (moments, wider, _widened(moments, surfaces, _WIDER[1] * edge_m))


@compiled((_WIDER_VOXELS, NUMBER, WHOLE, _SCRATCH, SURFACES))
def _add_wider_normal(
    voxels: WiderVoxels,
    edge_m: float,
    row: int,
    scratch: tuple[Float64, Float64],
    surfaces: Float64,
) -> None:
    """Write the normal of one of (M, 6) surfaces by wider voxels, where they determine it."""
    wider_of, table, sums, wider = voxels
    one = wider_of[row]
    if np.isnan(wider[one, 3]):
        _add_normal(sums, table, edge_m, one, _WIDE_RINGS, _MAX_THICKNESS, scratch, wider)
        if np.isnan(wider[one, 3]):
            wider[one, 3:] = 0
    if wider[one, 3] != 0 or wider[one, 4] != 0 or wider[one, 5] != 0:
        surfaces[row, 3:] = wider[one, 3:]


@compiled((SOURCES, TABLE, NUMBER, array_of(np.int64), SURFACES))
def find_normals(
    sources: NormalSources, table: VoxelTable, edge_m: float, rows: Int, surfaces: Float64
) -> None:
    """Write the normals of some of (M, 6) surfaces where they are not known so far, 0 where they are not determined.

    Where too few voxels around are occupied, or they lie along a line or in the plane of a beam, those farther around are
    taken, too, and then wider voxels, which are few. The LiDAR is at the origin.
    """
    moments, wider, widest = sources
    scratch = (np.empty(10), np.empty((3, 3)))
    for row in rows:
        for rings in _RINGS:
            if np.isnan(surfaces[row, 3]):
                _add_normal(moments, table, edge_m, row, rings, 1.0, scratch, surfaces)
        if np.isnan(surfaces[row, 3]):
            _add_wider_normal(wider, _WIDER[0] * edge_m, row, scratch, surfaces)
        if np.isnan(surfaces[row, 3]):
            _add_wider_normal(widest, _WIDER[1] * edge_m, row, scratch, surfaces)
        if np.isnan(surfaces[row, 3]):
            surfaces[row, 3:] = 0


@compiled((ROWS, TABLE, NUMBER, WHOLE, NUMBER, SURFACES))
def _add_normals(
    moments: Float64,
    table: VoxelTable,
    edge_m: float,
    rings: int,
    max_thickness: float,
    surfaces: Float64,
) -> None:
    """Write the normals of (M, 6) surfaces that have none so far as `_add_normal` does: all rings of one take twice as long."""
    total, covariance = np.empty(10), np.empty((3, 3))
    for row in range(len(moments)):
        if not np.isnan(surfaces[row, 3]):
            continue
        if _add_around(moments, table, edge_m, surfaces[row, :3], rings, total) >= _MIN_VOXELS:
            write_covariance(total, covariance)
            normal = flattest_direction(covariance, _MIN_BREADTH, max_thickness)
            if _is_faced(surfaces[row, :3], normal):
                surfaces[row, 3], surfaces[row, 4], surfaces[row, 5] = normal


@compiled((_WIDER_VOXELS, NUMBER, SURFACES))
def _add_wider_normals(voxels: WiderVoxels, edge_m: float, surfaces: Float64) -> None:
    """Write the normals of (M, 6) surfaces that have none so far by wider voxels: those in one have the same."""
    wider_of, table, sums, wider = voxels
    wider[:, 3] = 0
    for row in range(len(surfaces)):
        if np.isnan(surfaces[row, 3]):
            wider[wider_of[row], 3] = np.nan
    _add_normals(sums, table, edge_m, _WIDE_RINGS, _MAX_THICKNESS, wider)
    for row in range(len(surfaces)):
        if np.isnan(surfaces[row, 3]):
            surfaces[row, 3:] = wider[wider_of[row], 3:]


@compiled((ROWS, TABLE, NUMBER))
def means_and_normals(moments: Float64, table: VoxelTable, edge_m: float) -> Float64:
    """Return (M, 6) the mean point of each voxel and the normal of the surface there, 0 where it is not determined."""
    surfaces = _means(moments)
    for rings in _RINGS:
        _add_normals(moments, table, edge_m, rings, 1.0, surfaces)
    for wider in _WIDER:
        voxels = _widened(moments, surfaces, wider * edge_m)
        _add_wider_normals(voxels, wider * edge_m, surfaces)
    for row in range(len(moments)):
        if np.isnan(surfaces[row, 3]):
            surfaces[row, 3:] = 0
    return surfaces


@compiled((ROWS, TABLE, NUMBER, NUMBER, NUMBER, NUMBER, NUMBER))
def _nearest(
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


@compiled((ROWS, WHOLE, ROWS))
def moved_point(source: Float64, row: int, pose: Float64) -> tuple[float, float, float]:
    """Return the position of a point of the source in the frame of the target."""
    x, y, z = source[row, 0], source[row, 1], source[row, 2]
    return (
        pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3],
        pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3],
        pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3],
    )


@compiled((written(np.float64, 2), written(np.float64)))
def solve(matrix: Float64, right: Float64) -> bool:
    """Solve a symmetric positive definite system, given by its upper triangle, in place (Cholesky)."""
    size = len(right)
    for i in range(size):
        for j in range(i, size):
            total = matrix[i, j]
            for k in range(i):
                total -= matrix[k, i] * matrix[k, j]
            if i == j:
                if not total > 0:
                    return False
                matrix[i, i] = np.sqrt(total)
            else:
                matrix[i, j] = total / matrix[i, i]
    for i in range(size):
        for k in range(i):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    return True


@compiled((array_of(np.float64), ROWS))
def moved_pose(motion: Float64, pose: Float64) -> Float64:
    """Return a (4, 4) pose after a motion, a rotation vector and a translation (Rodrigues)."""
    angle = np.sqrt(motion[0] ** 2 + motion[1] ** 2 + motion[2] ** 2)
    x, y, z = motion[0], motion[1], motion[2]
    sine, versine = 1.0, 0.5
    if angle > 1e-9:
        sine, versine = np.sin(angle) / angle, (1 - np.cos(angle)) / (angle * angle)
    rotation = np.empty((3, 3))
    rotation[0, 0], rotation[1, 1] = 1 - versine * (y * y + z * z), 1 - versine * (x * x + z * z)
    rotation[2, 2] = 1 - versine * (x * x + y * y)
    rotation[0, 1], rotation[1, 0] = versine * x * y - sine * z, versine * x * y + sine * z
    rotation[0, 2], rotation[2, 0] = versine * x * z + sine * y, versine * x * z - sine * y
    rotation[1, 2], rotation[2, 1] = versine * y * z - sine * x, versine * y * z + sine * x
    moved = np.zeros((4, 4))
    moved[3, 3] = 1
    for i in range(3):
        moved[i, 3] = motion[3 + i]
        for j in range(4):
            for k in range(3):
                moved[i, j] += rotation[i, k] * pose[k, j]
    return moved


@compiled((SURFACES, TABLE, NUMBER, SOURCES, ROWS, WHOLE, ROWS, NUMBER, written(np.int64)))
def match_points(
    target: Float64,
    table: VoxelTable,
    edge_m: float,
    normals: NormalSources,
    source: Float64,
    stride: int,
    target_SE3_source: Float64,
    reach_m: float,
    matches: Int,
) -> None:
    """Find the nearest point of the target for every `stride`-th point of the source, -1 where none is within reach.

    Rows of the target are written to (N,) matches, and their normals to the target where they are not known so far; the
    other arguments are as of `_add_matches` and `align_surfaces`.
    """
    unknown, rows = 0, np.empty(len(source), np.int64)
    for row in range(0, len(source), stride):
        x, y, z = moved_point(source, row, target_SE3_source)
        matches[row] = _nearest(target, table, edge_m, x, y, z, reach_m)
        if matches[row] >= 0 and np.isnan(target[matches[row], 3]):
            rows[unknown] = matches[row]
            unknown += 1
    if unknown > 0:
        find_normals(normals, table, edge_m, rows[:unknown], target)


@compiled(
    (
        ROWS,
        ROWS,
        WHOLE,
        ROWS,
        array_of(np.int64),
        NUMBER,
        written(np.float64, 2),
        written(np.float64),
    )
)
def _add_matches(
    target: Float64,
    source: Float64,
    stride: int,
    target_SE3_source: Float64,
    nearest: Int,
    robust: float,
    hessian: Float64,
    gradient: Float64,
) -> tuple[int, float]:
    """Add up the normal equations of a small motion of every `stride`-th point of the source towards its match.

    The motion is a rotation vector and a translation in the frame of the target, applied after `target_SE3_source`.

    Args:
        target: (M, 6) points and normals of the target.
        source: (N, 6) points and normals of the source.
        stride: Step from one point of the source to the next.
        target_SE3_source: (4, 4) pose of the source.
        nearest: (N,) row of the target that each point matches, -1 for none.
        robust: Squared error at which a match weighs a quarter (Geman-McClure), 0 for equal weights.
        hessian: (6, 6) matrix that is added to.
        gradient: (6,) vector that is added to.

    Returns:
        The number of matches and the sum of half their squared errors.
    """
    T = target_SE3_source
    matches, error = 0, 0.0
    jm = np.empty((6, 3))
    for row in range(0, len(source), stride):
        near = nearest[row]
        if near < 0:
            continue
        px, py, pz = moved_point(source, row, T)
        rx, ry, rz = target[near, 0] - px, target[near, 1] - py, target[near, 2] - pz
        tx, ty, tz = target[near, 3], target[near, 4], target[near, 5]
        matches += 1
        nx, ny, nz = source[row, 3], source[row, 4], source[row, 5]
        sx = T[0, 0] * nx + T[0, 1] * ny + T[0, 2] * nz
        sy = T[1, 0] * nx + T[1, 1] * ny + T[1, 2] * nz
        sz = T[2, 0] * nx + T[2, 1] * ny + T[2, 2] * nz
        # Both covariances together: I - (1 - flatness) n n^T each, by the two normals.
        share = 1 - _FLATNESS
        a, b = 2 - share * (sx * sx + tx * tx), -share * (sx * sy + tx * ty)
        c, d = -share * (sx * sz + tx * tz), 2 - share * (sy * sy + ty * ty)
        e, f = -share * (sy * sz + ty * tz), 2 - share * (sz * sz + tz * tz)
        # Its inverse by the adjugate.
        A, B, C = d * f - e * e, c * e - b * f, b * e - c * d
        D, E, F = a * f - c * c, b * c - a * e, a * d - b * b
        scale = 1 / (a * A + b * B + c * C)
        A, B, C, D, E, F = A * scale, B * scale, C * scale, D * scale, E * scale, F * scale
        mx, my, mz = A * rx + B * ry + C * rz, B * rx + D * ry + E * rz, C * rx + E * ry + F * rz
        squared = rx * mx + ry * my + rz * mz
        error += squared / 2
        weight = (robust / (robust + squared)) ** 2 if robust > 0 else 1.0
        A, B, C, D, E, F = A * weight, B * weight, C * weight, D * weight, E * weight, F * weight
        mx, my, mz = mx * weight, my * weight, mz * weight
        # J = [-[p]x, I]; rows of J^T M, the upper three are [p]x M.
        jm[0, 0], jm[0, 1], jm[0, 2] = py * C - pz * B, py * E - pz * D, py * F - pz * E
        jm[1, 0], jm[1, 1], jm[1, 2] = pz * A - px * C, pz * B - px * E, pz * C - px * F
        jm[2, 0], jm[2, 1], jm[2, 2] = px * B - py * A, px * D - py * B, px * E - py * C
        hessian[0, 0] += py * jm[0, 2] - pz * jm[0, 1]
        hessian[0, 1] += pz * jm[0, 0] - px * jm[0, 2]
        hessian[0, 2] += px * jm[0, 1] - py * jm[0, 0]
        hessian[1, 1] += pz * jm[1, 0] - px * jm[1, 2]
        hessian[1, 2] += px * jm[1, 1] - py * jm[1, 0]
        hessian[2, 2] += px * jm[2, 1] - py * jm[2, 0]
        for i in range(3):
            for j in range(3):
                hessian[i, 3 + j] += jm[i, j]
        hessian[3, 3] += A
        hessian[3, 4] += B
        hessian[3, 5] += C
        hessian[4, 4] += D
        hessian[4, 5] += E
        hessian[5, 5] += F
        gradient[0] += py * mz - pz * my
        gradient[1] += pz * mx - px * mz
        gradient[2] += px * my - py * mx
        gradient[3], gradient[4], gradient[5] = gradient[3] + mx, gradient[4] + my, gradient[5] + mz
    return matches, error


@compiled((ROWS, ROWS))
def _motion_between(pose: Float64, other: Float64) -> Float64:
    """Return the motion, a rotation vector and a translation, that takes a (4, 4) pose to another at a small angle."""
    motion, turn = other[:3, 3].copy(), np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                turn[i, j] += other[i, k] * pose[j, k]
            motion[i] -= turn[i, j] * pose[j, 3]
    between = np.empty(6)
    between[0], between[1] = (turn[2, 1] - turn[1, 2]) / 2, (turn[0, 2] - turn[2, 0]) / 2
    between[2], between[3:] = (turn[1, 0] - turn[0, 1]) / 2, motion
    return between


@compiled((ROWS, ROWS, NUMBER, written(np.float64, 2), written(np.float64)))
def _add_prior(
    pose: Float64, initial_guess: Float64, information: float, hessian: Float64, gradient: Float64
) -> None:
    """Add a prior of the initial guess to the normal equations of the matches.

    Its information matrix is S H^-1 S, with H that of the matches and S the information at which both weigh the same.
    Where the matches tell e times S, the prior tells S / e: the matches have a weight of e^2 to 1. So a well determined
    direction is not pulled, and one that slips along a periodic surface stays.

    Args:
        pose: (4, 4) pose so far.
        initial_guess: (4, 4) pose of the prior.
        information: S for a translation, in the unit of `hessian`.
        hessian: (6, 6) matrix of the matches, that is added to; its upper triangle is read.
        gradient: (6,) vector that is added to.
    """
    even, prior = np.full(6, information), np.empty((6, 6))
    even[:3] *= _TURN_RADIUS_M**2
    for axis in range(6):
        column = np.zeros(6)
        column[axis] = even[axis]
        if not solve(hessian.copy(), column):
            return
        prior[axis] = even * column
    between = _motion_between(pose, initial_guess)
    for i in range(6):
        for j in range(6):
            gradient[i] += prior[i, j] * between[j]
            hessian[i, j] += prior[i, j]


@compiled((NUMBER, NUMBER))
def _eighth(x: float, y: float) -> int:
    """Return which of the eighths of a turn a direction is in, 0 to 7."""
    eighth = 0
    if y < 0:
        eighth, x, y = 4, -x, -y
    if x < 0:
        eighth, x, y = eighth + 2, y, -x
    return eighth + 1 if y > x else eighth


@compiled((ROWS, ROWS, ROWS, array_of(np.int64), ROWS, NUMBER, written(np.float64, 2)))
def _leave_out_eighths(
    target: Float64,
    source: Float64,
    target_SE3_source: Float64,
    nearest: Int,
    determined: Float64,
    robust: float,
    covariance: Float64,
) -> bool:
    """Write the covariance of an alignment by how far it moves without the matches of each eighth of the surroundings.

    It is the jackknife over blocks: matches of one wall, one row of trees or one stretch of road err alike, however many
    they are, and what is near to each other is mostly in one eighth.

    Args:
        target: (M, 6) points and normals of the target.
        source: (N, 6) points and normals of the source.
        target_SE3_source: (4, 4) pose of the source.
        nearest: (N,) row of the target that each point matches, -1 for none.
        determined: (6, 6) information matrix of the alignment; its upper triangle is read.
        robust: Squared error at which a match weighs a quarter, 0 for equal weights.
        covariance: (6, 6) matrix that is written.

    Returns:
        Whether the other matches determine the alignment without any eighth.
    """
    eighths, starts = np.empty(len(source), np.int64), np.zeros(_EIGHTHS + 1, np.int64)
    for row in range(len(source)):
        x, y, _ = moved_point(source, row, target_SE3_source)
        eighths[row] = _eighth(x, y)
        starts[eighths[row] + 1] += 1
    starts = np.cumsum(starts)
    ordered, matches = np.empty((len(source), 6)), np.empty(len(source), np.int64)
    ends = starts[:-1].copy()
    for row in range(len(source)):
        place = ends[eighths[row]]
        for column in range(6):
            ordered[place, column] = source[row, column]
        matches[place] = nearest[row]
        ends[eighths[row]] += 1
    covariance[:] = 0
    for eighth in range(_EIGHTHS):
        part = slice(starts[eighth], starts[eighth + 1])
        hessian, motion = np.zeros((6, 6)), np.zeros(6)
        _add_matches(
            target, ordered[part], 1, target_SE3_source, matches[part], robust, hessian, motion
        )
        if not solve(determined - hessian, motion):
            return False
        for i in range(6):
            for j in range(6):
                covariance[i, j] += motion[i] * motion[j] * (_EIGHTHS - 1) / _EIGHTHS
    return True


@compiled((ROWS, written(np.float64, 2)))
def _shrink(determined: Float64, covariance: Float64) -> None:
    """Draw a covariance towards the inverse of the information matrix, at the size of both.

    Eight samples leave some of the six directions almost without variance by chance.

    Args:
        determined: (6, 6) information matrix of the alignment; its upper triangle is read.
        covariance: (6, 6) matrix that is drawn.
    """
    size = 0.0
    for i in range(6):
        for j in range(6):
            size += covariance[i, j] * determined[min(i, j), max(i, j)] / 6
    for j in range(6):
        column = np.zeros(6)
        column[j] = size
        if solve(determined.copy(), column):
            for i in range(6):
                covariance[i, j] += _SHRINKAGE * (column[i] - covariance[i, j])


@compiled(
    (
        *(SURFACES, TABLE, NUMBER, SOURCES, ROWS, ROWS),
        *(NUMBER, (NUMBER, NUMBER), WHOLE, NUMBER, NUMBER),
    )
)
def align_surfaces(
    target: Float64,
    table: VoxelTable,
    edge_m: float,
    normals: NormalSources,
    source: Float64,
    initial_guess: Float64,
    reach_m: float,
    steps: tuple[float, float],
    iterations: int,
    prior_share: float,
    robust_m: float,
) -> tuple[Float64, int, float, bool, Float64]:
    """Align the source with the target by Gauss-Newton steps (GICP): with a quarter of its points, then with all.

    Args:
        target: (M, 6) points and normals of the target.
        table: Table of its voxels.
        edge_m: Edge of its voxels in metres.
        normals: What normals of the target are found from where they are not known so far.
        source: (N, 6) points and normals of the source; without normals on either side it is point-to-point ICP.
        initial_guess: (4, 4) first guess of `target_SE3_source`.
        reach_m: Largest distance of a match in metres.
        steps: Rotation in rad and translation in metres of a step that ends the alignment.
        iterations: Largest number of steps with all points, and of those with a quarter.
        prior_share: Share of the matches that, with normals along a direction, tell as much about a motion in it as
            the initial guess does, 0 to 1; 0 for no prior.
        robust_m: Distance from the surfaces on both sides at which a match weighs a quarter, 0 for equal weights.

    Returns:
        (4, 4) `target_SE3_source`, the number of matches, the sum of half their squared errors, whether the last
        step was small enough, and the (6, 6) covariance of a small motion, a rotation vector and a translation in the
        frame of the target, by how well the matches of each eighth of the surroundings agree; NaN where they do not
        determine it.
    """
    pose, matches, error, is_converged = initial_guess.copy(), 0, 0.0, False
    determined, covariance = np.zeros((6, 6)), np.full((6, 6), np.nan)
    nearest, robust = np.empty(len(source), np.int64), robust_m**2 / (2 * _FLATNESS)
    for stride in (4, 1):
        is_small = False
        for number in range(iterations + 1):
            # A small step changes next to no match.
            if not is_small:
                match_points(target, table, edge_m, normals, source, stride, pose, reach_m, nearest)
            hessian, motion = np.zeros((6, 6)), np.zeros(6)
            matches, error = _add_matches(
                target, source, stride, pose, nearest, robust, hessian, motion
            )
            if number == iterations:
                break
            for axis in range(6):
                hessian[axis, axis] += 1e-6
            if prior_share > 0:
                information = matches * prior_share / (2 * _FLATNESS)
                _add_prior(pose, initial_guess, information, hessian, motion)
            determined[:] = hessian
            if not solve(hessian, motion):
                return initial_guess.copy(), 0, 0.0, False, covariance
            pose = moved_pose(motion, pose)
            turn = np.sqrt(motion[0] ** 2 + motion[1] ** 2 + motion[2] ** 2)
            way = np.sqrt(motion[3] ** 2 + motion[4] ** 2 + motion[5] ** 2)
            is_small = turn < _LOOSER * steps[0] and way < _LOOSER * steps[1]
            is_converged = is_small and (stride > 1 or (turn < steps[0] and way < steps[1]))
            if is_converged:
                break
    if _leave_out_eighths(target, source, pose, nearest, determined, robust, covariance):
        _shrink(determined, covariance)
    else:
        covariance[:] = np.nan
    return pose, matches, error, is_converged, covariance


@compiled((ROWS, TABLE, NUMBER, ROWS, ROWS, NUMBER))
def distances_to_surfaces(
    target: Float64,
    table: VoxelTable,
    edge_m: float,
    source: Float64,
    target_SE3_source: Float64,
    reach_m: float,
) -> Float64:
    """Return the (N,) distance of each point of the source from the surface at the nearest point of the target.

    It is infinite where none is within reach, and 0 at a point without a surface. All normals of the target are known;
    arguments are as of `align_surfaces`.
    """
    away_m = np.full(len(source), np.inf)
    for row in range(len(source)):
        x, y, z = moved_point(source, row, target_SE3_source)
        near = _nearest(target, table, edge_m, x, y, z, reach_m)
        if near >= 0:
            dx, dy, dz = target[near, 0] - x, target[near, 1] - y, target[near, 2] - z
            away_m[row] = abs(dx * target[near, 3] + dy * target[near, 4] + dz * target[near, 5])
    return away_m
