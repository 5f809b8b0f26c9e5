"""Convex outlines of clusters, beside those of OpenCV."""

import cv2
import numpy as np
import pytest

from perception.kernels.outlines import convex_outlines


def outlines(*clusters: list[list[float]]) -> list[list[list[float]]]:
    places = np.array([place for cluster in clusters for place in cluster], np.float64)
    starts = np.cumsum([0, *map(len, clusters)])
    rows, corners = convex_outlines(places, starts)
    return [part.tolist() for part in np.split(places[rows], np.cumsum(corners)[:-1])]


def test_corners_go_around_to_the_left_without_what_lies_between():
    square = [[2.0, 2.0], [0.0, 2.0], [1.0, 1.0], [0.0, 0.0], [2.0, 0.0], [1.0, 0.0]]
    assert outlines(square) == [[[0, 0], [2, 0], [2, 2], [0, 2]]]


@pytest.mark.parametrize(
    ("cluster", "expected"),
    [
        ([[1.0, 2.0]], [[1, 2]]),
        ([[1.0, 2.0], [1.0, 2.0], [1.0, 2.0]], [[1, 2]]),
        ([[3.0, 1.0], [1.0, 1.0], [2.0, 1.0], [1.0, 1.0]], [[1, 1], [3, 1]]),
        ([[0.0, 0.0], [4.0, 0.0], [0.0, 0.0], [0.0, 3.0]], [[0, 0], [4, 0], [0, 3]]),
    ],
    ids=["a point", "equal points", "a line", "a triangle with a double corner"],
)
def test_small_clusters_beside_others(cluster, expected):
    post = [[9.0, 9.0], [9.0, 8.0]]
    assert outlines(post, cluster, post) == [[[9, 8], [9, 9]], expected, [[9, 8], [9, 9]]]


def test_they_are_those_of_opencv():
    random = np.random.default_rng(0)
    clusters = [random.integers(0, 40, (size, 2)).astype(float) for size in range(1, 200, 3)]
    for own, cluster in zip(outlines(*(c.tolist() for c in clusters)), clusters, strict=True):
        hull = cv2.convexHull(cluster.astype(np.float32))[:, 0]
        assert {tuple(corner) for corner in own} == {tuple(corner) for corner in hull.tolist()}
