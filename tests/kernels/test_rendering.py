"""Compiled functions of rendering, each beside its reference in NumPy, which they equal to the last bit."""

import numpy as np
import pytest

from perception.kernels.rendering import (
    add_gloss,
    add_haze,
    develop_pixels,
    follow_object,
    look_up,
    look_up_between,
    mirror_rays,
    pass_sphere,
    place_surfaces,
    scatter_light,
    surface_normals,
    texture_coordinates,
)

RAYS, SURFACES, TRIANGLES = 400, 300, 50
F = np.float32


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def units(rng: np.random.Generator, *shape: int) -> np.ndarray:
    vectors = rng.normal(size=(*shape, 3))
    return (vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)).astype(F)


def numbers(rng: np.random.Generator, *shape: int) -> np.ndarray:
    return rng.random(shape, F)


def some(rng: np.random.Generator, count: int = SURFACES) -> np.ndarray:
    return np.sort(rng.choice(RAYS, count, replace=False))


def test_rays_near_a_sphere_are_those_that_pass_it_ahead(rng: np.random.Generator) -> None:
    origins, directions = 4 * numbers(rng, RAYS, 3), units(rng, RAYS)
    centre, radius = np.array([2, 1, 3], F), 0.8
    is_near = np.empty(RAYS, bool)

    pass_sphere(
        is_near, np.ascontiguousarray(origins.T), np.ascontiguousarray(directions.T), centre, radius
    )

    offset = (centre - origins).astype(float)
    along = (offset * directions).sum(axis=1)
    squared = (offset**2).sum(axis=1) - along * np.abs(along)
    assert 20 < is_near.sum() < RAYS - 20
    np.testing.assert_array_equal(is_near, (squared < radius**2) & (along > -radius))


def test_rays_follow_an_object_that_moves_while_they_are_fired(rng: np.random.Generator) -> None:
    origins, directions, delays = numbers(rng, RAYS, 3), units(rng, RAYS), numbers(rng, RAYS)
    indices, position, velocity = some(rng), numbers(rng, 3), numbers(rng, 3)
    relative, unchanged = np.empty((2, SURFACES, 3), F)

    follow_object(relative, unchanged, indices, origins, directions, delays, position, velocity)

    expected = origins[indices] - position - delays[indices, None] * velocity
    np.testing.assert_array_equal(relative, expected)
    np.testing.assert_array_equal(unchanged, directions[indices])


def test_normals_are_interpolated_on_rounded_surfaces_alone(rng: np.random.Generator) -> None:
    faces, corners = units(rng, TRIANGLES), units(rng, TRIANGLES, 3)
    seen, is_rounded = some(rng), rng.random(SURFACES) < 0.5
    rows = rng.integers(TRIANGLES, size=RAYS).astype(np.int32)
    u, v = numbers(rng, 2, RAYS) / 2
    normals = np.empty((SURFACES, 3), F)

    surface_normals(normals, seen, rows, is_rounded, faces, corners, u, v)

    of, first, second = corners[rows[seen]], u[seen, None], v[seen, None]
    mixed = of[:, 0] * (1 - first - second) + of[:, 1] * first + of[:, 2] * second
    mixed /= np.maximum(np.linalg.norm(mixed, axis=1, keepdims=True), 1e-6)
    np.testing.assert_array_equal(normals, np.where(is_rounded[:, None], mixed, faces[rows[seen]]))


def test_normals_turn_towards_their_rays(rng: np.random.Generator) -> None:
    origins, directions, distances = numbers(rng, RAYS, 3), units(rng, RAYS), numbers(rng, RAYS)
    seen, normals = some(rng), units(rng, SURFACES)
    points, turned = np.empty((SURFACES, 3), F), normals.copy()

    place_surfaces(points, turned, seen, origins, directions, distances)

    along = (normals.astype(float) * directions[seen]).sum(axis=1)
    np.testing.assert_array_equal(turned, normals * -np.sign(along)[:, None].astype(F))
    expected = origins[seen] + distances[seen, None] * directions[seen]
    np.testing.assert_array_equal(points, expected)


def test_texture_coordinates_lie_between_those_of_the_corners(rng: np.random.Generator) -> None:
    texture, seen = 5 * numbers(rng, TRIANGLES, 3, 2), some(rng)
    rows = rng.integers(TRIANGLES, size=RAYS).astype(np.int32)
    u, v = numbers(rng, 2, RAYS)
    places = np.empty((SURFACES, 2), F)

    texture_coordinates(places, seen, rows, texture, u, v)

    first, second, third = np.moveaxis(texture[rows[seen]], 1, 0)
    expected = first + u[seen, None] * (second - first) + v[seen, None] * (third - first)
    np.testing.assert_array_equal(places, expected)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_noise_repeats_and_is_interpolated(rng: np.random.Generator, kind: type) -> None:
    image = numbers(rng, 16, 16)
    x, y = rng.uniform(-40, 40, (2, RAYS)).astype(kind)
    nearest, between = np.empty((2, RAYS), F)

    look_up(nearest, image, x, y)
    look_up_between(between, image, x, y)

    left, low = np.floor(x).astype(int), np.floor(y).astype(int)
    np.testing.assert_array_equal(nearest, image[low % 16, left % 16])
    u, v = x - np.floor(x), y - np.floor(y)
    rows = [
        image[row % 16, left % 16] * (1 - u) + image[row % 16, (left + 1) % 16] * u
        for row in (low, low + 1)
    ]
    np.testing.assert_array_equal(between, (rows[0] * (1 - v) + rows[1] * v).astype(F))


def test_light_of_surfaces_is_that_of_sun_sky_mirrored_street_and_haze(
    rng: np.random.Generator,
) -> None:
    colors, facing, ambient = numbers(rng, RAYS, 3), numbers(rng, RAYS), numbers(rng, RAYS)
    sun, sky, grey = numbers(rng, 3, 3)
    glossy, haze = some(rng), numbers(rng, RAYS)
    strength, glint, street = numbers(rng, SURFACES), numbers(rng, SURFACES), units(rng, SURFACES)
    light = np.empty((RAYS, 3), F)

    scatter_light(light, colors, facing, ambient, sun, sky)
    add_gloss(light, glossy, strength, street, glint, sun)
    add_haze(light, haze, grey)

    expected = colors * (facing[:, None] * sun + ambient[:, None] * sky)
    expected[glossy] += strength[:, None] * (street + 3.0 * (glint[:, None] * sun))
    expected += haze[:, None] * (grey - expected)
    np.testing.assert_array_equal(light, expected)


def test_a_mirrored_ray_leaves_as_it_came(rng: np.random.Generator) -> None:
    normals, surfaces, directions = units(rng, RAYS), some(rng), units(rng, SURFACES)
    cosine = np.einsum("ij,ij->i", directions, normals[surfaces])
    mirrored = np.empty((SURFACES, 3), F)

    mirror_rays(mirrored, surfaces, directions, normals, cosine)

    expected = directions - 2 * cosine[:, None] * normals[surfaces]
    np.testing.assert_array_equal(mirrored, expected)
    np.testing.assert_allclose(np.linalg.norm(mirrored, axis=1), 1, atol=1e-6)


def test_pixels_are_developed_by_the_tone_curve_and_noise(rng: np.random.Generator) -> None:
    exposed = rng.uniform(-0.1, 3, (20, 30, 3)).astype(F)
    fall, noise = numbers(rng, 20, 30), rng.normal(0, 2, (20, 30)).astype(F)
    tint, tones = np.array([0.5, -0.2, 0.6], F), np.linspace(0, 255, 4096).astype(F)
    image = np.empty(exposed.shape, np.uint8)

    develop_pixels(image, exposed, fall, noise, tint, tones)

    light = exposed * fall[..., None]
    light = light / (1 + 0.15 * np.maximum(light, 0)) * 0.9
    levels = tones[np.clip(4095 * light, 0, 4095).astype(np.int32)]
    levels += noise[..., None] + noise[:, ::-1, None] * tint
    np.testing.assert_array_equal(image, np.clip(levels + 0.5, 0, 255).astype(np.uint8))
