"""Maps in plain loops: the oracle of the tests."""

import numpy as np

from perception.geometry.camera import project
from perception.maps.column_filling import ColumnRules
from perception.maps.filling import Filling
from perception.maps.projection import SparseMaps
from perception.types import Calibration, Float, Float64


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


def fill_nearest_by_search(sparse: SparseMaps) -> Filling:
    """Compare every pixel with every return."""
    width, height = sparse.size_px
    filling = Filling.empty(sparse.size_px)
    for row in range(height):
        for column in range(width):
            offset = sparse.pixels - (column, row)
            closest = int((offset**2).sum(axis=1).argmin())
            filling.depth_m[row, column] = sparse.depth_m[closest]
            filling.reflectance[row, column] = sparse.reflectance[closest]
    return filling


def fill_natural_by_discs(sparse: SparseMaps) -> Filling:
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
    filling = Filling.empty(sparse.size_px)
    for row in range(height):
        for column in range(width):
            takes = (rows - row) ** 2 + (columns - column) ** 2 < to_return
            if takes.any():
                filling.depth_m[row, column] = nearest.depth_m[takes].mean()
                filling.reflectance[row, column] = nearest.reflectance[takes].mean()
    return filling.with_measured(sparse)


def fill_columns_by_loop(sparse: SparseMaps, rules: ColumnRules) -> Filling:
    """Look for every pixel up and down its column, where every row is first filled sideways."""
    width, height = sparse.size_px
    squeezed = -(-width // rules.squeeze_px)
    owners = [
        [_owner(sparse, rules, column, row) for row in range(height)] for column in range(squeezed)
    ]
    known = [column for column in range(squeezed) if max(owners[column]) >= 0]
    filling = Filling.empty(sparse.size_px)
    for column in range(width):
        here = column // rules.squeeze_px
        source = min(known, key=lambda other: abs(other - here))
        anchors = [row for row in range(height) if owners[source][row] >= 0]
        for row in range(int(sparse.pixels[:, 1].min()), height):
            inverse, reflectance = _between(sparse, rules, owners[source], anchors, row)
            filling.depth_m[row, column] = 1 / inverse
            filling.reflectance[row, column] = reflectance
    return filling.with_measured(sparse)


def _owner(sparse: SparseMaps, rules: ColumnRules, column: int, row: int) -> int:
    best, best_key = -1, (rules.reach + 0.5, 0.0, 0.0)
    for number, (u, v) in enumerate(sparse.pixels):
        offset = int(u) // rules.squeeze_px - column
        # Of two as near, the one to the right wins, then the less deep.
        key = (abs(offset), -float(offset > 0), float(sparse.depth_m[number]))
        if v == row and key < best_key:
            best, best_key = number, key
    return best


def _between(
    sparse: SparseMaps, rules: ColumnRules, owners: list[int], anchors: list[int], row: int
) -> Float64:
    above = [a for a in anchors if a <= row]
    below = [a for a in anchors if a > row]
    values = [
        np.array([1 / sparse.depth_m[owners[anchor]], sparse.reflectance[owners[anchor]]])
        for anchor in above[-1:] + below[:1]
    ]
    if len(values) == 1:
        return values[0]
    gap, down = below[0] - above[-1], row - above[-1]
    if abs(values[1][0] - values[0][0]) <= rules.steepest_per_m_px * gap:
        return np.asarray(values[0] + (values[1] - values[0]) * down / gap)
    return values[0] if down < gap - gap // 2 else values[1]
