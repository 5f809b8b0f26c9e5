"""Reference implementation of the thesis' proposals: point by point and cell by cell."""

import math
import statistics
from collections import defaultdict, deque

import numpy as np

from perception.detection.config import ProposalConfig
from perception.types import Calibration, Float, Float64, Int


def cluster_by_definition(xy_m: Float, radius_m: float, min_points: int) -> Int:
    """Grow a cluster from each core that has none yet, in the order of the points (Ester et al., 1996)."""
    places_m = np.asarray(xy_m, np.float64)
    labels = np.full(len(places_m), -1)
    neighbours = [_neighbours(places_m, place_m, radius_m) for place_m in places_m]
    clusters = 0
    for seed in range(len(places_m)):
        if labels[seed] >= 0 or len(neighbours[seed]) < min_points:
            continue
        labels[seed], front = clusters, deque([seed])
        while front:
            point = front.popleft()
            if len(neighbours[point]) >= min_points:
                reached = neighbours[point][labels[neighbours[point]] < 0]
                labels[reached] = clusters
                front.extend(reached.tolist())
        clusters += 1
    return labels


def _neighbours(places_m: Float, place_m: Float, radius_m: float) -> Int:
    x, y = (places_m - place_m).T
    return np.flatnonzero(x * x + y * y <= radius_m * radius_m)


def boxes_by_loop(
    points_velo: Float, calibration: Calibration, size_px: tuple[int, int], config: ProposalConfig
) -> Float64:
    """Return (M, 4) boxes as the author's code makes them."""
    ahead = [
        [float(value) for value in point[:3]]
        for point in points_velo
        if 5 <= point[0] <= 80 and abs(point[1]) <= 80
    ]
    means, deviations = np.mean(ahead, axis=0), np.std(ahead, axis=0)
    min_density = np.finfo(float).eps
    typical = [point for point in ahead if _density(point, means, deviations) > min_density]
    above_ground = _in_varied_cells(typical, config)
    seen = [(point, _pixel(point, calibration)) for point in above_ground]
    seen = [(point, pixel) for point, pixel in seen if _is_inside(pixel, size_px)]
    if not seen:
        return np.zeros((0, 4))
    xy_m = np.array([point[:2] for point, _ in seen])
    labels = cluster_by_definition(xy_m, config.radius_m, config.min_points)
    boxes = []
    for number in range(int(labels.max()) + 1):
        pixels = [pixel for (_, pixel), label in zip(seen, labels, strict=True) if label == number]
        columns, rows, _ = zip(*pixels, strict=True)
        boxes.append([min(columns), max(min(rows) - 5, 0), max(columns), max(rows)])
    return np.array(boxes, np.float64).reshape(-1, 4)


def _density(point: list[float], means: Float64, deviations: Float64) -> float:
    factors = [
        math.exp(-(((value - mean) / deviation) ** 2) / 2) / (deviation * math.sqrt(2 * math.pi))
        for value, mean, deviation in zip(point, means, deviations, strict=True)
    ]
    return float(math.prod(factors))


def _in_varied_cells(points: list[list[float]], config: ProposalConfig) -> list[list[float]]:
    cells: dict[tuple[int, int], list[list[float]]] = defaultdict(list)
    for point in points:
        cells[_cell(point, config.cell_m)].append(point)
    is_varied = {
        cell: len(of_cell) > 1
        and statistics.variance([point[2] for point in of_cell]) >= config.min_variance_m2
        for cell, of_cell in cells.items()
    }
    return [point for point in points if is_varied[_cell(point, config.cell_m)]]


def _cell(point: list[float], cell_m: float) -> tuple[int, int]:
    return math.floor(point[0] / cell_m), math.floor(point[1] / cell_m)


def _pixel(point: list[float], calibration: Calibration) -> tuple[int, int, float]:
    u, v, depth = calibration.image_P_velo @ [*point, 1.0]
    return (round(u / depth), round(v / depth), depth) if depth > 0.5 else (-1, -1, depth)


def _is_inside(pixel: tuple[int, int, float], size_px: tuple[int, int]) -> bool:
    return 0 <= pixel[0] < size_px[0] and 0 <= pixel[1] < size_px[1]
