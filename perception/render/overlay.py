"""Ground and obstacles drawn over an image through any projection: the camera's or a virtual one."""

from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np

from perception.geometry.camera import project
from perception.geometry.grids import LocalArea
from perception.kernels.drawing import blend_overlay, faces_of_cubes, splat_cubes
from perception.render import palette
from perception.render.canvas import FIXED_POINT_BITS, fixed_point
from perception.types import Bool, Float64, GroundModel, Int, Obstacles, UInt8, Voxels

_NO_CUBE = -1
# Largest cell of the ground mesh, and that along a wide area.
_MESH_M, _WIDE_MESH_M, _WIDE_M = 1.0, 2.0, 60.0
_NEAREST_M = 0.7
# Brightness of the faces across x, y and z: the light comes from high in front of the vehicle.
_FACE_LIGHT = np.array([0.82, 0.62, 1.0], np.float32)
# Voxels of more points are brighter, as in the author's figures; from this number of points on fully bright.
_FULL_COUNT = 8
_FULLNESS = (0.8 + 0.2 * np.arange(_FULL_COUNT + 1) / _FULL_COUNT).astype(np.float32)
_MESH_COLORS = np.array([palette.GROUND, palette.GROUND_MESH], np.float64)


@dataclass(frozen=True)
class CubeImage:
    """What each pixel of an image shows.

    Attributes:
        cubes: (H, W) index of the nearest cube, -1 without one.
        faces: (H, W) visible face of that cube: 0 across x, 1 across y, 2 across z; 0 without one.
    """

    cubes: Int
    faces: UInt8

    @property
    def is_cube(self) -> Bool:
        """(H, W) mask of the pixels that show a cube."""
        return np.asarray(self.cubes != _NO_CUBE)


def render_cubes(image_P_velo: Float64, size_px: tuple[int, int], voxels: Voxels) -> CubeImage:
    """Render cubes into an image of (width, height) pixels; cubes behind the camera are left out."""
    cubes = np.full(size_px[::-1], _NO_CUBE, np.int32)
    faces = np.zeros(size_px[::-1], np.uint8)
    projection = np.ascontiguousarray(image_P_velo, np.float64)
    centers_m = np.ascontiguousarray(voxels.centers_m, np.float32)
    splat_cubes(cubes, projection, centers_m, voxels.size_m)
    faces_of_cubes(faces, cubes, projection, centers_m, voxels.size_m)
    return CubeImage(cubes, faces)


@dataclass(frozen=True)
class GroundMesh:
    """Heights of the ground on a regular grid over the local area.

    Attributes:
        x_m: (I,) positions ahead of the LiDAR in metres, ascending.
        y_m: (J,) positions to the left in metres, ascending.
        height_m: (I, J) z of the ground in the LiDAR frame in metres.
    """

    x_m: Float64
    y_m: Float64
    height_m: Float64

    @property
    def nodes_m(self) -> Float64:
        """(I, J, 3) nodes of the grid in the LiDAR frame."""
        x, y = np.meshgrid(self.x_m, self.y_m, indexing="ij")
        return np.stack([x, y, self.height_m], axis=-1)

    def slope(self) -> tuple[Float64, Float64]:
        """Return the (I, J) slopes along x and along y."""
        along_x, along_y = np.gradient(self.height_m, self.x_m, self.y_m)
        return np.asarray(along_x), np.asarray(along_y)


def sample_surface(ground: GroundModel, area: LocalArea) -> GroundMesh:
    """Sample the ground over the local area, its edges included, each metre or more often; 2 m along a wide area."""
    x_m, y_m = _ticks(-area.behind_m, area.ahead_m), _ticks(-area.side_m, area.side_m)
    x, y = np.meshgrid(x_m, y_m, indexing="ij")
    height_m = ground.height_m(np.column_stack([x.ravel(), y.ravel()]))
    return GroundMesh(x_m, y_m, np.asarray(height_m, np.float64).reshape(x.shape))


def _ticks(start_m: float, stop_m: float) -> Float64:
    length_m = stop_m - start_m
    step_m = _MESH_M if length_m < _WIDE_M else _WIDE_MESH_M
    return np.linspace(start_m, stop_m, int(np.ceil(length_m / step_m - 1e-9)) + 1)


@dataclass(frozen=True)
class OverlayStyle:
    """Opacity of what is drawn over an image, 0 to 1.

    Attributes:
        cube_opacity: Opacity of voxels; the author's figures have 0.5 to 0.75.
        ground_opacity: Opacity of the ground's fill.
        mesh_opacity: Opacity of the lines on the ground, added to that of the fill.
        gap_px: Largest gap (columns, rows) between voxels of an obstacle through which no ground is drawn.
    """

    cube_opacity: float = 0.5
    ground_opacity: float = 0.34
    mesh_opacity: float = 0.22
    gap_px: tuple[int, int] = (9, 15)


ON_CAMERA = OverlayStyle()


def draw_overlay(
    canvas: UInt8,
    image_P_velo: Float64,
    surface: GroundMesh,
    obstacles: Obstacles,
    style: OverlayStyle = ON_CAMERA,
) -> None:
    """Draw the ground in blue, static voxels in red and moving ones in green.

    Obstacles hide the ground behind them, and nearer voxels hide farther ones.

    Args:
        canvas: (H, W, 3) image.
        image_P_velo: (3, 4) projection from the LiDAR frame.
        surface: Ground in the LiDAR frame.
        obstacles: Static and moving voxels in the LiDAR frame.
        style: Opacities.
    """
    height, width = canvas.shape[:2]
    voxels, colors = _voxels_and_colors(obstacles)
    cubes = render_cubes(image_P_velo, (width, height), voxels)
    fill, mesh = _ground_masks(image_P_velo, (width, height), surface)
    blend_overlay(
        canvas,
        (cubes.cubes, cubes.faces),
        (fill, mesh, _is_hidden(cubes, style.gap_px)),
        (colors, _MESH_COLORS),
        (style.cube_opacity, style.ground_opacity, style.mesh_opacity),
    )


def _cube_colors() -> UInt8:
    """Return the colours of cubes by kind (static, moving), number of points and face, as (C, 3, 3)."""
    kinds = np.array([palette.STATIC, palette.MOVING], np.float32)
    tints = kinds[:, None] * _FULLNESS[:, None]
    return (tints[:, :, None] * _FACE_LIGHT[:, None]).astype(np.uint8).reshape(-1, 3, 3)


_CUBE_COLORS = _cube_colors()


def _voxels_and_colors(obstacles: Obstacles) -> tuple[Voxels, UInt8]:
    """Merge static and moving voxels, so that they hide each other, with the (V, 3, 3) colours of their faces."""
    both = Voxels(
        np.concatenate([obstacles.static.centers_m, obstacles.moving.centers_m]),
        np.concatenate([obstacles.static.counts, obstacles.moving.counts]),
        obstacles.static.size_m,
    )
    kinds = np.minimum(both.counts, _FULL_COUNT)
    kinds[len(obstacles.static) :] += len(_FULLNESS)
    return both, _CUBE_COLORS.take(kinds, axis=0)


def _ground_masks(
    image_P_velo: Float64, size_px: tuple[int, int], surface: GroundMesh
) -> tuple[UInt8, UInt8]:
    """Return the (H, W) mask of the ground, and the share of each pixel that a mesh of lines covers, 0 to 255."""
    width, height = size_px
    nodes_m = surface.nodes_m
    pixels, depth_m = project(image_P_velo, nodes_m.reshape(-1, 3))
    pixels, depth_m = pixels.reshape(*nodes_m.shape[:2], 2), depth_m.reshape(nodes_m.shape[:2])
    ahead = (depth_m > _NEAREST_M).all(axis=1)
    nodes_px = _clipped_fixed_point(pixels[ahead], size_px)
    fill, mesh = np.zeros((2, height, width), np.uint8)
    for nearer, farther in pairwise(nodes_px):
        strip = np.concatenate([nearer, farther[::-1]])
        cv2.fillPoly(fill, [strip], 255, cv2.LINE_8, FIXED_POINT_BITS)
    lines = [*nodes_px, *np.ascontiguousarray(nodes_px.transpose(1, 0, 2))]
    if len(nodes_px) > 1:
        cv2.polylines(mesh, lines, False, 255, 1, cv2.LINE_AA, FIXED_POINT_BITS)
    return fill, mesh


def _clipped_fixed_point(pixels: Float64, size_px: tuple[int, int]) -> Int:
    """Return pixels for OpenCV's sub-pixel drawing, outliers clipped to its range of numbers."""
    reach = 20 * max(size_px)
    return fixed_point(np.clip(pixels, -reach, reach))


def _is_hidden(cubes: CubeImage, gap_px: tuple[int, int]) -> UInt8:
    """Return the (H, W) mask, 1 or 0, of what lies behind an obstacle or a gap within one."""
    solid = cubes.is_cube.view(np.uint8)
    if gap_px == (1, 1):
        return solid
    kernel = np.ones(gap_px[::-1], np.uint8)
    return np.asarray(cv2.morphologyEx(solid, cv2.MORPH_CLOSE, kernel), np.uint8)
