"""Reference implementation of the maps, in loops."""

from itertools import pairwise

import numpy as np

from perception.geometry.camera import project
from perception.maps.densify import ColumnFillingConfig
from perception.maps.filling import FilledMaps
from perception.maps.projection import SparseMaps
from perception.types import Bool, Calibration, Float


def project_by_loop(
    points_velo: Float, calibration: Calibration, size_px: tuple[int, int]
) -> dict[tuple[int, int], tuple[float, float]]:
    """Return depth and reflectance of the nearest return by (column, row)."""
    found: dict[tuple[int, int], tuple[float, float]] = {}
    for point in np.asarray(points_velo):
        pixels, depths = project(calibration.image_P_velo, point[None])
        depth = float(depths[0])
        if depth <= 0.5:
            continue
        pixel = round(float(pixels[0, 0])), round(float(pixels[0, 1]))
        if not (0 <= pixel[0] < size_px[0] and 0 <= pixel[1] < size_px[1]):
            continue
        if pixel not in found or depth < found[pixel][0]:
            found[pixel] = depth, float(point[3])
    return found


def fill_nearest_by_search(sparse: SparseMaps) -> FilledMaps:
    """Compare every pixel with every return."""
    width, height = sparse.size_px
    filling = FilledMaps.empty(sparse.size_px)
    for row in range(height):
        for column in range(width):
            offset = sparse.pixels - (column, row)
            closest = int((offset**2).sum(axis=1).argmin())
            filling.depth_m[row, column] = sparse.depth_m[closest]
            filling.reflectance[row, column] = sparse.reflectance[closest]
    return filling


def fill_natural_by_discs(sparse: SparseMaps) -> FilledMaps:
    """Count for every pixel the pixels that it would take from each return."""
    width, height = sparse.size_px
    nearest = fill_nearest_by_search(sparse)
    rows, columns = np.indices((height, width))
    to_return = np.array(
        [
            [((sparse.pixels - (u, v)) ** 2).sum(axis=1).min() for u in range(width)]
            for v in range(height)
        ]
    )
    filling = FilledMaps.empty(sparse.size_px)
    for row in range(height):
        for column in range(width):
            takes = (rows - row) ** 2 + (columns - column) ** 2 < to_return
            if takes.any():
                filling.depth_m[row, column] = nearest.depth_m[takes].mean()
                filling.reflectance[row, column] = nearest.reflectance[takes].mean()
    return filling.with_measured(sparse)


def fill_columns_by_loop(sparse: SparseMaps, config: ColumnFillingConfig) -> FilledMaps:
    """Follow each beam from return to return, then look for every pixel up and down its column."""
    width, height = sparse.size_px
    cells = _rows_by_loop(sparse, config)
    columns = range(-(-width // config.column_width_px))
    known = [column for column in columns if any(cell[0] == column for cell in cells)]
    region = region_by_loop(sparse)
    filling = FilledMaps.empty(sparse.size_px)
    for column in range(width):
        here = column // config.column_width_px
        source = min(known, key=lambda other: abs(other - here))
        anchors = _seen_anchors({r: z for (c, r), z in cells.items() if c == source}, config)
        first = here * config.column_width_px
        for row in range(int(sparse.pixels[:, 1].min()), height):
            if region[row, first : first + config.column_width_px].any():
                value = _between(anchors, row, config)
                filling.depth_m[row, column] = 1 / value.real
                filling.reflectance[row, column] = value.imag
    column, row = sparse.pixels.T
    return filling.with_measured(
        sparse[sparse.depth_m <= config.max_depth_ratio * filling.depth_m[row, column]]
    )


def region_by_loop(sparse: SparseMaps) -> Bool:
    """Look at ten columns to either side of every pixel, and two rows down."""
    width, height = sparse.size_px
    u, v = sparse.pixels.T
    with_returns = sorted(set(u.tolist()))
    tops = []
    for column in range(width):
        nearest = min(with_returns, key=lambda other: abs(other - column))
        tops.append(int(v[u == nearest].min()))
    region = np.zeros((height, width), bool)
    for column in range(width):
        region[max(0, min(tops[max(0, column - 10) : column + 11]) - 2) :, column] = True
    return region


Cells = dict[tuple[int, int], complex]


def _rows_by_loop(sparse: SparseMaps, config: ColumnFillingConfig) -> Cells:
    """Return inverse depth + i reflectance of the cells (column, row) that beams pass."""
    returns: Cells = {}
    for (u, v), depth, reflectance in zip(
        sparse.pixels.tolist(), sparse.depth_m, sparse.reflectance, strict=True
    ):
        cell = u // config.column_width_px, v
        returns.pop(cell, None)  # so that the least deep are last
        returns[cell] = complex(1 / depth, reflectance)
    following = {cell: _next_of(cell, returns, config) for cell in returns}
    behind = set(following.values())
    cells: Cells = {}
    for step in range(_reach_by_loop(returns, config), 0, -1):
        for column, row in (cell for cell in returns if following[cell] is None):
            cells[column + step, row] = returns[column, row]
        for column, row in (cell for cell in returns if cell not in behind):
            cells[column - step, row] = returns[column, row]
    for begin, end in following.items():
        if end is None:
            continue
        steps = end[0] - begin[0]
        for step in range(1, steps):
            row = end[1] if 2 * step >= steps else begin[1]
            value = _across(returns[begin], returns[end], step / steps, config)
            cells[begin[0] + step, row] = value
    cells.update(returns)
    return cells


def _next_of(
    cell: tuple[int, int], returns: Cells, config: ColumnFillingConfig
) -> tuple[int, int] | None:
    for step in range(1, config.max_steps + 1):
        for down in (0, -1, 1):
            if (cell[0] + step, cell[1] + down) in returns:
                return cell[0] + step, cell[1] + down
    return None


def _across(first: complex, last: complex, share: float, config: ColumnFillingConfig) -> complex:
    near, far = max(first.real, last.real), min(first.real, last.real)
    if near <= config.max_depth_ratio * far:
        return first + share * (last - first)
    return last if share >= 0.5 else first


def _reach_by_loop(returns: Cells, config: ColumnFillingConfig) -> int:
    gaps = []
    for column in {cell[0] for cell in returns}:
        rows = sorted(row for c, row in returns if c == column)
        gaps += [below - above for above, below in pairwise(rows) if below - above > 1]
    spacing_px = float(np.median(gaps)) if gaps else 0.0
    return min(
        max(1, round(config.extension_ratio * spacing_px / config.column_width_px)),
        config.max_steps,
    )


def _seen_anchors(anchors: dict[int, complex], config: ColumnFillingConfig) -> dict[int, complex]:
    rows = sorted(anchors)
    hidden = {
        row
        for above, row, below in zip(rows, rows[1:], rows[2:], strict=False)
        if below - above <= config.max_gap_px
        and anchors[above].real > config.max_depth_ratio * anchors[row].real
        and anchors[below].real > config.max_depth_ratio * anchors[row].real
    }
    return {row: anchors[row] for row in rows if row not in hidden}


def _between(anchors: dict[int, complex], row: int, config: ColumnFillingConfig) -> complex:
    above = max((a for a in anchors if a <= row), default=None)
    below = min((a for a in anchors if a > row), default=None)
    if above is None or below is None:
        return anchors[below if above is None else above]  # type: ignore[index]
    gap, change = below - above, anchors[below] - anchors[above]
    if abs(change.real) <= config.max_slope_per_m_px * gap:
        return anchors[above] + change * (row - above) / gap
    return anchors[above] if row - above < gap - gap // 2 else anchors[below]
