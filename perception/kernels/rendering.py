"""Rays, textures and light of rendered images, ray by ray, in the order of NumPy's operations in single precision."""

import math

import numpy as np

from perception.kernels.compiled import NUMBER, ArrayType, Scalar, array_of, compiled, written
from perception.types import Bool, Float, Float32, Int, UInt8

_VALUES, _VECTORS = array_of(np.float32), array_of(np.float32, 2)
_CORNERS = array_of(np.float32, 3)
_ROWS, _INDICES = array_of(np.int32), array_of(np.int64)
_OUT = written(np.float32, 2)
_HALF, _ONE, _TWO = np.float32(0.5), np.float32(1), np.float32(2)


@compiled((written(np.bool_), _VECTORS, _VECTORS, _VALUES, NUMBER))
def pass_sphere(
    is_near: Bool, origins_m: Float32, directions: Float32, centre_m: Float32, radius_m: float
) -> None:
    """Tell which rays may pass within a radius of a point.

    Args:
        is_near: (N,) answers.
        origins_m: (3, N) origins.
        directions: (3, N) unit directions.
        centre_m: (3,) point.
        radius_m: Radius in metres.
    """
    cx, cy, cz = centre_m[0], centre_m[1], centre_m[2]
    radius = np.float32(radius_m)
    squared_radius = radius * radius
    for i in range(len(is_near)):
        x, y, z = cx - origins_m[0, i], cy - origins_m[1, i], cz - origins_m[2, i]
        along = x * directions[0, i] + y * directions[1, i] + z * directions[2, i]
        squared = x * x + y * y + z * z - along * abs(along)
        is_near[i] = (squared < squared_radius) & (along > -radius)


@compiled((_OUT, _OUT, _INDICES, _VECTORS, _VECTORS, _VALUES, _VALUES, _VALUES))
def follow_object(
    origins_object: Float32,
    directions_world: Float32,
    indices: Int,
    origins_m: Float32,
    directions: Float32,
    delays_s: Float32,
    position_m: Float32,
    velocity_m_s: Float32,
) -> None:
    """Write some rays relative to where a moving object is when each is fired, in world axes.

    Args:
        origins_object: (K, 3) origins from the object.
        directions_world: (K, 3) unit directions.
        indices: (K,) rays.
        origins_m: (N, 3) origins in world coordinates.
        directions: (N, 3) unit directions.
        delays_s: (N,) firing time after the reference time.
        position_m: (3,) position of the object at the reference time.
        velocity_m_s: (3,) its velocity.
    """
    for k in range(len(indices)):
        i = indices[k]
        for axis in range(3):
            moved_m = delays_s[i] * velocity_m_s[axis]
            origins_object[k, axis] = origins_m[i, axis] - position_m[axis] - moved_m
            directions_world[k, axis] = directions[i, axis]


@compiled((_OUT, _INDICES, _ROWS, array_of(np.bool_), _VECTORS, _CORNERS, _VALUES, _VALUES))
def surface_normals(
    normals: Float32,
    seen: Int,
    rows: Int,
    is_rounded: Bool,
    face_normals: Float32,
    corner_normals: Float32,
    u: Float32,
    v: Float32,
) -> None:
    """Write the normals of the surfaces that rays hit, interpolated over rounded ones.

    Args:
        normals: (K, 3) unit normals.
        seen: (K,) rays that hit a surface.
        rows: (N,) triangle that each ray hits.
        is_rounded: (K,) mask of rounded surfaces.
        face_normals: (R, 3) normals of the triangles.
        corner_normals: (R, 3, 3) normals at their corners.
        u: (N,) barycentric coordinate of the second corner.
        v: (N,) barycentric coordinate of the third corner.
    """
    for k in range(len(seen)):
        i = seen[k]
        row = rows[i]
        if not is_rounded[k]:
            for axis in range(3):
                normals[k, axis] = face_normals[row, axis]
            continue
        first = _ONE - u[i] - v[i]
        squared = np.float32(0)
        for axis in range(3):
            mixed = corner_normals[row, 0, axis] * first + corner_normals[row, 1, axis] * u[i]
            mixed += corner_normals[row, 2, axis] * v[i]
            normals[k, axis] = mixed
            squared += mixed * mixed
        length = max(np.float32(math.sqrt(squared)), np.float32(1e-6))
        for axis in range(3):
            normals[k, axis] /= length


@compiled((_OUT, _OUT, _INDICES, _VECTORS, _VECTORS, _VALUES))
def place_surfaces(
    points_m: Float32,
    normals: Float32,
    seen: Int,
    origins_m: Float32,
    directions: Float32,
    distance_m: Float32,
) -> None:
    """Write where rays hit, and turn the normals there towards them.

    Args:
        points_m: (K, 3) points.
        normals: (K, 3) unit normals, which are turned.
        seen: (K,) rays that hit a surface.
        origins_m: (N, 3) origins of the rays.
        directions: (N, 3) unit directions.
        distance_m: (N,) distances along the rays.
    """
    for k in range(len(seen)):
        i = seen[k]
        along = np.float32(0)
        for axis in range(3):
            points_m[k, axis] = origins_m[i, axis] + distance_m[i] * directions[i, axis]
            along += normals[k, axis] * directions[i, axis]
        turn = -np.sign(along)
        for axis in range(3):
            normals[k, axis] *= turn


@compiled((_OUT, _INDICES, _VECTORS, _VECTORS, _VALUES))
def mirror_rays(
    mirrored: Float32, indices: Int, directions: Float32, normals: Float32, cosine: Float32
) -> None:
    """Write the directions in which surfaces mirror rays.

    Args:
        mirrored: (K, 3) unit directions.
        indices: (K,) surfaces.
        directions: (K, 3) unit directions of their rays.
        normals: (S, 3) unit normals of all surfaces.
        cosine: (K,) cosines between ray and normal.
    """
    for k in range(len(indices)):
        for axis in range(3):
            across = _TWO * cosine[k] * normals[indices[k], axis]
            mirrored[k, axis] = directions[k, axis] - across


@compiled((_OUT, _INDICES, _ROWS, _CORNERS, _VALUES, _VALUES))
def texture_coordinates(
    places: Float32, indices: Int, rows: Int, texture_m: Float32, u: Float32, v: Float32
) -> None:
    """Write the texture coordinates where rays hit.

    Args:
        places: (K, 2) texture coordinates in metres.
        indices: (K,) rays.
        rows: (N,) triangle that each ray hits.
        texture_m: (R, 3, 2) texture coordinates at the corners of the triangles.
        u: (N,) barycentric coordinate of the second corner.
        v: (N,) barycentric coordinate of the third corner.
    """
    for k in range(len(indices)):
        i = indices[k]
        row = rows[i]
        for axis in range(2):
            first = texture_m[row, 0, axis]
            along = u[i] * (texture_m[row, 1, axis] - first)
            places[k, axis] = first + along + v[i] * (texture_m[row, 2, axis] - first)


def _lookup_types(kind: Scalar) -> tuple[ArrayType, ...]:
    return written(np.float32), _VECTORS, array_of(kind), array_of(kind)


@compiled(_lookup_types(np.float32), _lookup_types(np.float64))
def look_up(values: Float32, image: Float32, x: Float, y: Float) -> None:
    """Write the pixels of a square image, repeated without end, at places.

    Args:
        values: (N,) values of the pixels.
        image: (S, S) image, S a power of two.
        x: (N,) columns.
        y: (N,) rows.
    """
    mask = len(image) - 1
    for i in range(len(values)):
        column, row = np.int32(math.floor(x[i])) & mask, np.int32(math.floor(y[i])) & mask
        values[i] = image[row, column]


@compiled(_lookup_types(np.float32), _lookup_types(np.float64))
def look_up_between(values: Float32, image: Float32, x: Float, y: Float) -> None:
    """Write a square image, repeated without end, at places between its pixels; arguments as of `look_up`."""
    mask = len(image) - 1
    for i in range(len(values)):
        left, low = np.floor(x[i]), np.floor(y[i])
        u, v = x[i] - left, y[i] - low
        first_u, first_v = type(u)(1) - u, type(v)(1) - v
        column, row = np.int32(left) & mask, np.int32(low) & mask
        right, high = (column + 1) & mask, (row + 1) & mask
        below = image[row, column] * first_u + image[row, right] * u
        above = image[high, column] * first_u + image[high, right] * u
        values[i] = below * first_v + above * v


@compiled((_OUT, _VECTORS, _VALUES, _VALUES, _VALUES, _VALUES))
def scatter_light(
    light: Float32,
    colors: Float32,
    facing: Float32,
    ambient: Float32,
    sun_rgb: Float32,
    sky_rgb: Float32,
) -> None:
    """Write the light that surfaces scatter.

    Args:
        light: (K, 3) scattered light.
        colors: (K, 3) colours of the surfaces.
        facing: (K,) share of the sun's light that falls on each.
        ambient: (K,) share of the sky's light that falls on each.
        sun_rgb: (3,) light of the sun.
        sky_rgb: (3,) light of the sky.
    """
    for k in range(len(light)):
        for channel in range(3):
            falling = facing[k] * sun_rgb[channel] + ambient[k] * sky_rgb[channel]
            light[k, channel] = colors[k, channel] * falling


@compiled((_OUT, _INDICES, _VALUES, _VECTORS, _VALUES, _VALUES))
def add_gloss(
    light: Float32,
    indices: Int,
    strength: Float32,
    mirrored: Float32,
    glint: Float32,
    sun_rgb: Float32,
) -> None:
    """Add what glossy surfaces mirror.

    Args:
        light: (S, 3) light of all surfaces, which is changed.
        indices: (K,) glossy surfaces.
        strength: (K,) share of light that they mirror.
        mirrored: (K, 3) light that falls on them from the mirrored direction.
        glint: (K,) share of the sun's light there.
        sun_rgb: (3,) light of the sun.
    """
    for k in range(len(indices)):
        for channel in range(3):
            sun = np.float32(3) * (glint[k] * sun_rgb[channel])
            light[indices[k], channel] += strength[k] * (mirrored[k, channel] + sun)


@compiled((_OUT, _VALUES, _VALUES))
def add_haze(light: Float32, haze: Float32, haze_rgb: Float32) -> None:
    """Mix the light of haze into that of surfaces.

    Args:
        light: (K, 3) light, which is changed.
        haze: (K,) share of haze.
        haze_rgb: (3,) light of the haze.
    """
    for k in range(len(light)):
        for channel in range(3):
            light[k, channel] += haze[k] * (haze_rgb[channel] - light[k, channel])


@compiled((written(np.uint8, 3), _CORNERS, _VECTORS, _VECTORS, _VALUES, _VALUES))
def develop_pixels(
    image: UInt8, exposed: Float32, fall: Float32, noise: Float32, tint: Float32, tones: Float32
) -> None:
    """Write the grey levels of exposed pixels: highlights compressed, tone curve, noise.

    Args:
        image: (H, W, 3) image.
        exposed: (H, W, 3) light on the sensor.
        fall: (H, W) share of the light that the lens passes.
        noise: (H, W) noise in grey levels.
        tint: (3,) share of the mirrored noise in each channel.
        tones: (T,) grey levels of light from 0 to 1.
    """
    height, width = noise.shape
    full, nothing, white = np.float32(len(tones) - 1), np.float32(0), np.float32(255)
    shoulder, scale = np.float32(0.15), np.float32(0.9)
    for row in range(height):
        for column in range(width):
            grain, mirrored = noise[row, column], noise[row, width - 1 - column]
            for channel in range(3):
                light = exposed[row, column, channel] * fall[row, column]
                light = light / (_ONE + shoulder * max(light, nothing)) * scale
                level = tones[int(min(max(full * light, nothing), full))]
                level += grain + mirrored * tint[channel]
                image[row, column, channel] = int(min(max(level + _HALF, nothing), white))
