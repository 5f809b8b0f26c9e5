"""The ground and the obstacles drawn over an image through any projection, the camera's or a virtual one."""

from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np

from perception.geometry.camera import project
from perception.render import palette
from perception.render.cubes import CubeImage, render_cubes
from perception.render.pixels import PackedColors, packed, unpacked
from perception.render.surface import GroundMesh
from perception.types import Float32, Float64, Int, Obstacles, UInt8, Voxels

_NEAREST_M = 0.7
# Brightness of the faces across x, y and z: the sun stands high before the vehicle.
_FACE_LIGHT = np.array([0.82, 0.62, 1.0], np.float32)
# Fuller voxels are brighter, as in the author's pictures; one of this many points is at full brightness.
_FULL_COUNT = 8
_FULLNESS = (0.8 + 0.2 * np.arange(_FULL_COUNT + 1) / _FULL_COUNT).astype(np.float32)
_FIXED_POINT_BITS = 4
# From the fill's colour to the mesh's, by how much of a pixel a line covers.
_MESH_COLORS = packed(np.linspace(palette.GROUND, palette.GROUND_MESH, 256).astype(np.uint8))


@dataclass(frozen=True)
class OverlayStyle:
    """How much of the image shows through.

    Attributes:
        cube_opacity: of voxels; the author's pictures have 0.5-0.75.
        ground_opacity: of the ground's fill.
        mesh_opacity: of the lines on the ground, added to the fill's.
        gap_px: (columns, rows) of image between an obstacle's voxels that stand before the ground.
    """

    cube_opacity: float = 0.62
    ground_opacity: float = 0.34
    mesh_opacity: float = 0.22
    gap_px: tuple[int, int] = (9, 15)


ON_CAMERA = OverlayStyle()


def draw_overlay(
    image: UInt8,
    image_P_velo: Float64,
    surface: GroundMesh,
    obstacles: Obstacles,
    style: OverlayStyle = ON_CAMERA,
) -> UInt8:
    """Return the (H, W, 3) image with the ground in blue, static voxels red and moving ones green.

    The ground is hidden behind obstacles, and nearer cubes hide farther ones.
    """
    height, width = image.shape[:2]
    voxels, color_indices = _voxels_and_color_indices(obstacles)
    cubes = render_cubes(image_P_velo, (width, height), voxels)
    colors, opacity = _paint_ground(image_P_velo, (width, height), surface, style)
    _hide_behind(cubes, opacity, style.gap_px)
    face_color_indices = color_indices.take(cubes.cubes) * len(_FACE_LIGHT) + cubes.faces
    colors.reshape(-1)[cubes.pixels] = _CUBE_COLORS.take(face_color_indices)
    opacity.reshape(-1)[cubes.pixels] = style.cube_opacity
    return np.asarray(cv2.blendLinear(unpacked(colors), image, opacity, 1 - opacity), np.uint8)


def _cube_colors() -> PackedColors:
    """Return the colours of cubes: of static and moving ones, by how full they are, by the face."""
    kinds = np.array([palette.STATIC, palette.MOVING], np.float32)
    tints = kinds[:, None] * _FULLNESS[:, None]
    return packed((tints[:, :, None] * _FACE_LIGHT[:, None]).astype(np.uint8).reshape(-1, 3))


_CUBE_COLORS = _cube_colors()


def _voxels_and_color_indices(obstacles: Obstacles) -> tuple[Voxels, Int]:
    """Put static and moving voxels into one set, so that they hide each other; (V,) tells kind and fullness."""
    both = Voxels(
        np.concatenate([obstacles.static.centers_m, obstacles.moving.centers_m]),
        np.concatenate([obstacles.static.counts, obstacles.moving.counts]),
        obstacles.static.size_m,
    )
    color_indices = np.minimum(both.counts, _FULL_COUNT)
    color_indices[len(obstacles.static) :] += len(_FULLNESS)
    return both, color_indices


def _paint_ground(
    image_P_velo: Float64, size_px: tuple[int, int], surface: GroundMesh, style: OverlayStyle
) -> tuple[PackedColors, Float32]:
    """Return (H, W) colours and (H, W) opacity: a faint fill, and a mesh of lines on it."""
    width, height = size_px
    nodes_m = surface.nodes_m
    pixels, depth_m = project(image_P_velo, nodes_m.reshape(-1, 3))
    pixels, depth_m = pixels.reshape(*nodes_m.shape[:2], 2), depth_m.reshape(nodes_m.shape[:2])
    ahead = (depth_m > _NEAREST_M).all(axis=1)
    nodes_px = _fixed_point(pixels[ahead], size_px)
    fill, mesh = np.zeros((2, height, width), np.uint8)
    for nearer, farther in pairwise(nodes_px):
        strip = np.concatenate([nearer, farther[::-1]])
        cv2.fillPoly(fill, [strip], 255, cv2.LINE_8, _FIXED_POINT_BITS)
    lines = [*nodes_px, *np.ascontiguousarray(nodes_px.transpose(1, 0, 2))]
    if len(nodes_px) > 1:
        cv2.polylines(mesh, lines, False, 255, 1, cv2.LINE_AA, _FIXED_POINT_BITS)
    colors = np.full((height, width), _MESH_COLORS[0])
    opacity = fill * np.float32(style.ground_opacity / 255)
    # Few pixels are of lines.
    places = np.flatnonzero(mesh != 0)
    shares = mesh.reshape(-1).take(places)
    colors.reshape(-1)[places] = _MESH_COLORS.take(shares)
    opacity.reshape(-1)[places] += shares * np.float32(style.mesh_opacity / 255)
    return colors, opacity


def _fixed_point(pixels: Float64, size_px: tuple[int, int]) -> Int:
    """Return pixels for OpenCV's sub-pixel drawing, far outliers pulled in to what it can count."""
    reach = 20 * max(size_px)
    clipped = np.clip(pixels, -reach, reach)
    return np.asarray(np.rint(clipped * 2**_FIXED_POINT_BITS), np.int32)


def _hide_behind(cubes: CubeImage, opacity: Float32, gap_px: tuple[int, int]) -> None:
    """Clear the ground in the gaps within an obstacle, which stands before it."""
    solid = np.zeros(opacity.shape, np.uint8)
    solid.reshape(-1)[cubes.pixels] = 1
    closed = cv2.morphologyEx(solid, cv2.MORPH_CLOSE, np.ones(gap_px[::-1], np.uint8))
    opacity *= 1 - closed
