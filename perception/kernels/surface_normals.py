"""Surface normals of the mean points of voxels, by those around; where these are few, by wider voxels."""

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled, written
from perception.kernels.moments import flattest_direction, write_covariance
from perception.kernels.voxel_table import (
    NO_TABLE,
    ROWS,
    TABLE,
    VoxelTable,
    add_around,
    count_voxels,
    find_voxels,
)
from perception.types import Float64, Int

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

# Wider voxels: that of each voxel, their table, moments and surfaces; and what normals are found from, the moments of the
# voxels and wider ones of both sizes. A normal that is not known so far is NaN: most points of a target are never matched.
WiderVoxels = tuple[Int, VoxelTable, Float64, Float64]
NormalSources = tuple[Float64, WiderVoxels, WiderVoxels]
_NO_VOXELS = (np.zeros(0, np.int64), NO_TABLE, np.zeros((0, 10)), np.zeros((0, 6)))
ALL_KNOWN: NormalSources = (np.zeros((0, 10)), _NO_VOXELS, _NO_VOXELS)

SURFACES = written(np.float64, 2)
_WIDER_VOXELS = (array_of(np.int64), TABLE, ROWS, SURFACES)
SOURCES = (ROWS, _WIDER_VOXELS, _WIDER_VOXELS)
# Sums of moments and a covariance: memory that would otherwise be taken for each normal.
_SCRATCH = (written(np.float64), written(np.float64, 2))


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
    if add_around(moments, table, edge_m, surfaces[row, :3], rings, total) >= _MIN_VOXELS:
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
    wider_of, table = find_voxels(surfaces, edge_m)
    sums = np.zeros((count_voxels(table[1]), 10))
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
        if add_around(moments, table, edge_m, surfaces[row, :3], rings, total) >= _MIN_VOXELS:
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
