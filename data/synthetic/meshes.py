"""Triangle meshes with a material slot, normals and texture coordinates at every triangle's corner.

Everything in the street is made of four primitives: a grid surface, quads, a tube and an ellipsoid.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from perception.types import Float, Float32, Float64, Int, UInt8


@dataclass(frozen=True)
class Mesh:
    """V vertices and T triangles.

    Attributes:
        vertices_m: (V, 3) vertices in metres.
        triangles: (T, 3) vertex numbers.
        slots: (T,) material slot of each triangle.
        normals: (T, 3, 3) unit normal at each corner.
        texture_m: (T, 3, 2) texture coordinates at each corner, in metres on the surface.
    """

    vertices_m: Float32
    triangles: Int
    slots: UInt8
    normals: Float32
    texture_m: Float32

    def __len__(self) -> int:
        """Return T."""
        return len(self.triangles)

    @property
    def radius_m(self) -> float:
        """Radius of the sphere around the origin that holds the mesh."""
        return float(np.linalg.norm(self.vertices_m, axis=1).max())


def make(vertices_m: Float, triangles: Int, slots: Int | UInt8 | int) -> Mesh:
    """Build a flat-shaded mesh whose texture lies in the plane that each triangle faces most."""
    vertices = np.asarray(vertices_m, np.float32)
    corners = vertices[triangles]
    normals = np.repeat(_face_normals(corners)[:, None], 3, axis=1)
    return Mesh(
        vertices,
        np.asarray(triangles, np.int32),
        np.broadcast_to(np.asarray(slots, np.uint8), (len(triangles),)).copy(),
        normals,
        corners[..., :2].copy(),
    )


def face_areas(corners: Float32) -> Float32:
    """Return (T, 3) normals of (T, 3, 3) corners, twice as long as the triangles are large."""
    x, y, z = (corners[:, 1] - corners[:, 0]).T
    u, v, w = (corners[:, 2] - corners[:, 0]).T
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=1)


def _face_normals(corners: Float32) -> Float32:
    """Return (T, 3) unit normals of (T, 3, 3) corners; zero area points up."""
    normals = face_areas(corners)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    up = np.array([0, 0, 1], np.float32)
    return np.asarray(
        np.where(lengths > 1e-12, normals / np.maximum(lengths, 1e-12), up), np.float32
    )


def smooth(mesh: Mesh, crease_rad: float = np.radians(50)) -> Mesh:
    """Round the shading of edges flatter than a crease."""
    corners = mesh.vertices_m[mesh.triangles]
    weighted = face_areas(corners)
    _, weld = np.unique(np.round(mesh.vertices_m, 4), axis=0, return_inverse=True)
    at_corner = weld.reshape(-1)[mesh.triangles]
    sums = np.zeros((at_corner.max() + 1, 3))
    np.add.at(sums, at_corner, weighted[:, None])
    rounded = sums[at_corner]
    rounded /= np.maximum(np.linalg.norm(rounded, axis=2, keepdims=True), 1e-12)
    flat = _face_normals(corners)[:, None]
    is_edge = (rounded * flat).sum(axis=2, keepdims=True) < np.cos(crease_rad)
    normals = np.where(is_edge, flat, rounded).astype(np.float32)
    return Mesh(mesh.vertices_m, mesh.triangles, mesh.slots, normals, mesh.texture_m)


def textured(mesh: Mesh, texture_m: Float) -> Mesh:
    """Replace the texture by coordinates given at the (V, 2) vertices."""
    corners = np.asarray(texture_m, np.float32)[mesh.triangles]
    return Mesh(mesh.vertices_m, mesh.triangles, mesh.slots, mesh.normals, corners)


def merge(meshes: Sequence[Mesh]) -> Mesh:
    """Join meshes into one; a single one is returned as it is."""
    if len(meshes) == 1:
        return meshes[0]
    starts = np.cumsum([0] + [len(mesh.vertices_m) for mesh in meshes[:-1]])
    return Mesh(
        np.concatenate([mesh.vertices_m for mesh in meshes]),
        np.concatenate([m.triangles + start for m, start in zip(meshes, starts, strict=True)]),
        np.concatenate([mesh.slots for mesh in meshes]),
        np.concatenate([mesh.normals for mesh in meshes]),
        np.concatenate([mesh.texture_m for mesh in meshes]),
    )


def moved(mesh: Mesh, dst_SE3_src: Float64) -> Mesh:
    """Move a mesh rigidly."""
    rotation = dst_SE3_src[:3, :3].astype(np.float32)
    vertices = (mesh.vertices_m @ dst_SE3_src[:3, :3].T + dst_SE3_src[:3, 3]).astype(np.float32)
    return Mesh(vertices, mesh.triangles, mesh.slots, mesh.normals @ rotation.T, mesh.texture_m)


def stretched(mesh: Mesh, factors: Float | Sequence[float]) -> Mesh:
    """Stretch a mesh along its axes."""
    by = np.asarray(factors, np.float32)
    normals = mesh.normals / by
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    return Mesh(mesh.vertices_m * by, mesh.triangles, mesh.slots, normals, mesh.texture_m)


def grid(points_m: Float, slots: Int | UInt8 | int) -> Mesh:
    """Span a surface over (R, C, 3) points; slots per (R-1, C-1) cell or one for all."""
    rows, columns = points_m.shape[:2]
    triangles = _grid_triangles(rows, columns)
    by_cell = np.broadcast_to(np.asarray(slots, np.uint8), (rows - 1, columns - 1)).reshape(-1)
    return make(points_m.reshape(-1, 3), triangles, np.repeat(by_cell, 2))


def quads(corners_m: Float, slots: Int | UInt8 | int) -> Mesh:
    """Join (Q, 4, 3) quads, corners in order around each; slots per quad or one for all."""
    count = len(corners_m)
    of_one = np.array([[0, 1, 2], [0, 2, 3]])
    triangles = (4 * np.arange(count)[:, None, None] + of_one).reshape(-1, 3)
    by_quad = np.broadcast_to(np.asarray(slots, np.uint8), (count,))
    return make(corners_m.reshape(-1, 3), triangles, np.repeat(by_quad, 2))


def box(low_m: Sequence[float], high_m: Sequence[float], slot: int) -> Mesh:
    """Build a box between two corners."""
    signs = np.array(
        [
            [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]],
            [[1, 1, 0], [0, 1, 0], [0, 1, 1], [1, 1, 1]],
            [[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]],
            [[0, 1, 0], [0, 0, 0], [0, 0, 1], [0, 1, 1]],
            [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
            [[0, 1, 0], [1, 1, 0], [1, 0, 0], [0, 0, 0]],
        ]
    )
    low, high = np.asarray(low_m, float), np.asarray(high_m, float)
    return quads(low + signs * (high - low), slot)


@lru_cache
def _grid_triangles(rows: int, columns: int) -> Int:
    """Return the vertex numbers of the triangles of a grid, two a cell, rows first."""
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1)
    lower = np.stack([corner, corner + 1, corner + columns + 1], axis=1)
    upper = np.stack([corner, corner + columns + 1, corner + columns], axis=1)
    return np.stack([lower, upper], axis=1).reshape(-1, 3).astype(np.int32)


@lru_cache
def _unit_sphere(sides: int) -> tuple[Float64, Float32]:
    """Return (V, 3) vertices of a grid over a sphere, and (T, 3, 3) normals."""
    polar = np.linspace(0, np.pi, sides // 2 + 2)[:, None]
    turn = np.linspace(0, 2 * np.pi, sides + 1)[None]
    wave = np.sin(polar)
    unit = np.stack([wave * np.cos(turn), wave * np.sin(turn), np.cos(polar) + 0 * turn], axis=-1)
    vertices = unit.reshape(-1, 3)
    triangles = _grid_triangles(len(polar), sides + 1)
    return vertices, vertices[triangles].astype(np.float32)


@lru_cache
def _unit_tube(sides: int) -> tuple[Float64, Float64, Float32]:
    """Return (V,) which end, (V, 2) the circle, and (T, 3, 3) normals across, beside and along."""
    turn = np.linspace(0, 2 * np.pi, sides + 1)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    rings = np.stack([0 * circle, circle, circle, 0 * circle])
    end = np.repeat([0.0, 0.0, 1.0, 1.0], sides + 1)
    triangles = _grid_triangles(4, sides + 1)
    normals = np.zeros((*triangles.shape, 3), np.float32)
    normals[..., :2] = np.tile(circle, (4, 1))[triangles]
    normals[: 2 * sides] = (0, 0, -1)
    normals[-2 * sides :] = (0, 0, 1)
    return end, rings.reshape(-1, 2), normals


def tube(
    start_m: Float | Sequence[float],
    end_m: Float | Sequence[float],
    radii_m: tuple[float, float],
    slot: int,
    sides: int = 8,
) -> Mesh:
    """Build a closed round bar between two points, tapered from one radius to the other."""
    start = np.asarray(start_m, np.float64)
    axis_m = np.asarray(end_m, np.float64) - start
    along = axis_m / np.linalg.norm(axis_m)
    helper = np.eye(3)[np.argmin(np.abs(along))]
    across = np.cross(along, helper)
    across /= np.linalg.norm(across)
    frame = np.stack([across, np.cross(along, across), along])
    end, circle, normals = _unit_tube(sides)
    radius = radii_m[0] + end * (radii_m[1] - radii_m[0])
    vertices = start + end[:, None] * axis_m + radius[:, None] * (circle @ frame[:2])
    return _shaded(vertices, _grid_triangles(4, sides + 1), slot, normals @ frame)


def ellipsoid(
    centre_m: Float | Sequence[float],
    radii_m: Float | Sequence[float],
    slot: int,
    sides: int = 8,
) -> Mesh:
    """Build a smooth ellipsoid."""
    unit, normals = _unit_sphere(sides)
    radii = np.asarray(radii_m, np.float64)
    turned = normals / radii
    turned /= np.linalg.norm(turned, axis=2, keepdims=True)
    triangles = _grid_triangles(sides // 2 + 2, sides + 1)
    return _shaded(np.asarray(centre_m) + unit * radii, triangles, slot, turned)


def _shaded(vertices_m: Float64, triangles: Int, slot: int, normals: Float) -> Mesh:
    """Build a mesh of one material with given corner normals and no texture."""
    return Mesh(
        vertices_m.astype(np.float32),
        triangles,
        np.full(len(triangles), slot, np.uint8),
        normals.astype(np.float32),
        np.zeros((*triangles.shape, 2), np.float32),
    )
