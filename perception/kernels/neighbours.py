"""Clusters: places over the ground plane that are near each other, which follow one another along x, and their extents."""

import numpy as np

from perception.kernels.compiled import NUMBER, array_of, compiled
from perception.kernels.graphs import root_of, tree_numbers
from perception.types import Bool, Float32, Float64, Int

_PLACES, _NUMBERS, _ORDER = array_of(np.float64, 2), array_of(np.float64), array_of(np.int64)


@compiled((_PLACES, _PLACES, NUMBER))
def are_near(places_m: Float64, others_m: Float64, reach_m: float) -> Bool:
    """Return which of (P, 2) places have one of (B, 2) others, in rising order of x, closer than a distance."""
    is_near = np.zeros(len(places_m), np.bool_)
    first = np.searchsorted(others_m[:, 0], places_m[:, 0] - reach_m)
    for row in range(len(places_m)):
        x_m, y_m = places_m[row, 0], places_m[row, 1]
        other = first[row]
        while other < len(others_m) and others_m[other, 0] <= x_m + reach_m:
            along_m, across_m = others_m[other, 0] - x_m, others_m[other, 1] - y_m
            if along_m * along_m + across_m * across_m < reach_m * reach_m:
                is_near[row] = True
                break
            other += 1
    return is_near


@compiled((_PLACES, _NUMBERS, NUMBER, _ORDER))
def linked_clusters(
    places_m: Float64, depth_gaps_m: Float64, lateral_gap_m: float, order: Int
) -> Int:
    """Return the (P,) cluster of each place; two are linked within an ellipse along the line of sight.

    Clusters are numbered from 0 in the order of their first places.

    Args:
        places_m: (P, 2) places.
        depth_gaps_m: (P,) half axis of the ellipse along the line of sight; that of two places is the mean.
        lateral_gap_m: Half axis of the ellipse across it.
        order: (P,) rows of the places in rising order of x.
    """
    count = len(places_m)
    parents, reach_m = np.arange(count), lateral_gap_m
    for row in range(count):
        reach_m = max(reach_m, depth_gaps_m[row])
    for at in range(count):
        first = order[at]
        x_m, y_m = places_m[first, 0], places_m[first, 1]
        for beyond in range(at + 1, count):
            second = order[beyond]
            along_x_m, along_y_m = places_m[second, 0] - x_m, places_m[second, 1] - y_m
            if along_x_m > reach_m:
                break
            if abs(along_y_m) > reach_m:
                continue
            sight_x, sight_y = places_m[second, 0] + x_m, places_m[second, 1] + y_m
            length = max(np.sqrt(sight_x * sight_x + sight_y * sight_y), 1e-6)
            along = (along_x_m * sight_x + along_y_m * sight_y) / length
            across = (along_x_m * sight_y - along_y_m * sight_x) / length
            depth_m = (depth_gaps_m[first] + depth_gaps_m[second]) / 2
            if (along / depth_m) ** 2 + (across / lateral_gap_m) ** 2 <= 1:
                one, other = root_of(parents, first), root_of(parents, second)
                # The earliest place is the root.
                parents[max(one, other)] = min(one, other)
    return tree_numbers(parents)


@compiled((array_of(np.float32, 2), _ORDER, np.int64))
def extents_of_clusters(
    points: Float32, cluster_of: Int, clusters: int
) -> tuple[Float64, Float64, Float64]:
    """Return the (C,) lowest and highest z, and the smallest distance over the ground plane, of clusters of points.

    Args:
        points: (N, 3+) points.
        cluster_of: (N,) cluster of each.
        clusters: Number of clusters.
    """
    low_m, high_m = np.full(clusters, np.inf), np.full(clusters, -np.inf)
    nearest_m = np.full(clusters, np.inf)
    for row in range(len(points)):
        x, y, z = points[row, 0], points[row, 1], np.float64(points[row, 2])
        cluster, away_m = cluster_of[row], np.float64(np.sqrt(x * x + y * y))
        low_m[cluster] = min(low_m[cluster], z)
        high_m[cluster] = max(high_m[cluster], z)
        nearest_m[cluster] = min(nearest_m[cluster], away_m)
    return low_m, high_m, nearest_m
