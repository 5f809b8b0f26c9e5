"""Compiled functions of drawing, each beside its reference in NumPy."""

import numpy as np
import pytest

from perception.geometry.camera import project
from perception.kernels.drawing import (
    HIDDEN,
    best_place,
    blend_overlay,
    faces_of_cubes,
    paint_points,
    splat_cubes,
)

WIDTH, HEIGHT = 90, 60
# Looks along x; a pixel is 2 cm at 1 m.
CAMERA = np.array([[45.0, -50, 0, 0], [30, 0, -50, 0], [1, 0, 0, 0]])
EDGE_M = 0.2


@pytest.fixture
def points() -> np.ndarray:
    low, high = (-3, -4, -3, 0), (12, 4, 3, 1)
    return np.random.default_rng(0).uniform(low, high, (500, 4)).astype(np.float32)


def gray(level: int = 100) -> np.ndarray:
    return np.full((HEIGHT, WIDTH, 3), level, np.uint8)


@pytest.mark.parametrize("edge_px", [1, 4])
def test_points_equal_the_reference(points, edge_px):
    colors = np.random.default_rng(1).integers(0, 255, (9, 3), np.uint8)
    numbers = np.arange(len(points), dtype=np.uint8) % 9
    numbers[::7] = HIDDEN
    expected, painted = gray(), gray()
    corners = np.rint(project(CAMERA, points)[0] - (edge_px - 1) / 2)
    for (u, v), number in zip(corners, numbers, strict=True):
        if number == HIDDEN or not -edge_px < u < WIDTH or not -edge_px < v < HEIGHT:
            continue
        rows = slice(max(int(v), 0), max(int(v) + edge_px, 0))
        expected[rows, max(int(u), 0) : max(int(u) + edge_px, 0)] = colors[number]
    paint_points(painted, CAMERA, points, numbers, colors, edge_px)
    np.testing.assert_array_equal(painted, expected)


def test_the_nearest_cube_equals_the_reference(points):
    nearest = np.full((HEIGHT, WIDTH), -1, np.int32)
    splat_cubes(nearest, CAMERA, points, EDGE_M)
    pixels, depths_m = project(CAMERA, points)
    expected = np.full((HEIGHT, WIDTH), -1)
    for number in np.argsort(-depths_m):
        if depths_m[number] <= 0.6:
            continue
        # A cube of 50 pixels at 1 m, a fifth broader.
        edge_px = max(round(60 * EDGE_M / depths_m[number]), 1)
        u, v = np.rint(pixels[number] - (edge_px - 1) / 2).astype(int)
        rows, columns = slice(max(v, 0), max(v + edge_px, 0)), slice(max(u, 0), max(u + edge_px, 0))
        expected[rows, columns] = number
    np.testing.assert_array_equal(nearest, expected)


def test_the_face_of_each_pixel_equals_the_reference(points):
    nearest = np.full((HEIGHT, WIDTH), -1, np.int32)
    splat_cubes(nearest, CAMERA, points, EDGE_M)
    faces = np.full((HEIGHT, WIDTH), 9, np.uint8)
    faces_of_cubes(faces, nearest, CAMERA, points, EDGE_M)
    rows, columns = np.nonzero(nearest >= 0)
    rays = np.linalg.inv(CAMERA[:, :3]) @ np.stack([columns, rows, np.ones_like(rows)])
    rays[np.abs(rays) <= 1e-9] = 1e-9
    enters = points[nearest[rows, columns], :3].T / rays - EDGE_M / 2 / np.abs(rays)
    np.testing.assert_array_equal(faces[rows, columns], enters.argmax(axis=0))
    assert (faces[nearest < 0] == 9).all()


def test_cubes_are_blended_by_their_opacity():
    nearest = np.full((HEIGHT, WIDTH), -1, np.int32)
    nearest[3, 4], nearest[3, 5] = 0, 1
    faces = np.full((HEIGHT, WIDTH), 2, np.uint8)
    colors = np.zeros((2, 3, 3), np.uint8)
    colors[:, 2] = [(200, 0, 100), (0, 40, 250)]
    canvas = gray()
    no_ground = (np.zeros((HEIGHT, WIDTH), np.uint8),) * 3
    blend_overlay(canvas, (nearest, faces), no_ground, (colors, np.zeros((2, 3))), (0.5, 1.0, 1.0))
    assert canvas[3, 4].tolist() == [150, 50, 100]
    assert canvas[3, 5].tolist() == [50, 70, 175]
    assert (np.delete(canvas[3], [4, 5], axis=0) == 100).all()


def test_lines_of_a_mesh_are_more_opaque_than_its_fill():
    fill, mesh, hidden = np.zeros((3, HEIGHT, WIDTH), np.uint8)
    fill[2, :3], mesh[2, 1:4] = 255, 255
    fill[3], mesh[3, 1:4], hidden[3] = 255, 255, 1
    colors = np.array([(200.0, 0, 100), (0, 200, 100)])
    # A part of a larger image.
    canvas = gray().repeat(2, axis=1)[:, :WIDTH]
    no_cubes = np.full((HEIGHT, WIDTH), -1, np.int32), np.zeros((HEIGHT, WIDTH), np.uint8)
    blend_overlay(
        canvas,
        no_cubes,
        (fill, mesh, hidden),
        (np.zeros((1, 3, 3), np.uint8), colors),
        (1.0, 0.5, 0.25),
    )
    assert canvas[2, :5, 0].tolist() == [150, 25, 25, 75, 100]
    assert (canvas[3] == 100).all()


@pytest.mark.parametrize(
    ("taken", "expected"),
    [
        ([], 1),
        ([(21, 0, 30, 10)], 2),
        ([(0, 0, 100, 100)], -1),
    ],
)
def test_the_best_place_is_free_and_covers_little(taken, expected):
    places = np.array([(0, 0, 10, 10), (20, 0, 30, 10), (40, 0, 50, 10)])
    avoided = np.array([(5.0, 5, 60, 10), (0, 0, 10, 8), (40, 0, 50, 4)])
    taken_px = np.array(taken, float).reshape(-1, 4)
    assert best_place(places, taken_px, avoided) == expected
