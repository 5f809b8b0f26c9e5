"""Reference implementation of DBSCAN: by its definition, point by point."""

from collections import deque

import numpy as np

from perception.types import Float, Int


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
