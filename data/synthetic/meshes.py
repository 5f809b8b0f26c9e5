"""Triangle meshes with a material slot, normals and texture coordinates at every triangle's corner.

Everything in the street is made of four primitives: a grid surface, quads, a tube and an ellipsoid.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perception.types import Float, Float32, Float64, Int, UInt8


@dataclass(frozen=True)
class Mesh:
    """V vertices and T triangles.

    Attributes:
        vertices_m: (V, 3).
        triangles: (T, 3) vertex numbers.
        slots: (T,) material of each triangle.
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


def _face_normals(corners: Float32) -> Float32:
    """Return (T, 3) unit normals of (T, 3, 3) corners; zero area points up."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    up = np.array([0, 0, 1], np.float32)
    return np.asarray(
        np.where(lengths > 1e-12, normals / np.maximum(lengths, 1e-12), up), np.float32
    )


def smooth(mesh: Mesh, crease_rad: float = np.radians(50)) -> Mesh:
    """Round the shading of edges flatter than a crease."""
    corners = mesh.vertices_m[mesh.triangles]
    weighted = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
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
    """Join meshes into one."""
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


def grid(points_m: Float, slots: Int | UInt8 | int) -> Mesh:
    """Span a surface over (R, C, 3) points; slots per (R-1, C-1) cell or one for all."""
    rows, columns = points_m.shape[:2]
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1)
    lower = np.stack([corner, corner + 1, corner + columns + 1], axis=1)
    upper = np.stack([corner, corner + columns + 1, corner + columns], axis=1)
    triangles = np.stack([lower, upper], axis=1).reshape(-1, 3)
    by_cell = np.broadcast_to(np.asarray(slots, np.uint8), (rows - 1, columns - 1)).reshape(-1)
    return make(points_m.reshape(-1, 3), triangles, np.repeat(by_cell, 2))


def quads(corners_m: Float, slots: Int | UInt8 | int) -> Mesh:
    """Join (Q, 4, 3) quads, corners in order around each; slots per quad or one for all."""
    count = len(corners_m)
    first = 4 * np.arange(count)[:, None]
    triangles = np.stack([first + [0, 1, 2], first + [0, 2, 3]], axis=1).reshape(-1, 3)
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


def tube(path_m: Float, radii_m: Sequence[float], slot: int, sides: int = 8) -> Mesh:
    """Sweep a circle of varying radius along (K, 3) points, closed at both ends, smooth."""
    path = np.asarray(path_m, float)
    along = path[-1] - path[0]
    along /= np.linalg.norm(along)
    helper = np.eye(3)[np.argmin(np.abs(along))]
    across = np.cross(along, helper)
    across /= np.linalg.norm(across)
    turn = np.linspace(0, 2 * np.pi, sides + 1)
    circle = np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * np.cross(along, across)
    rings = path[:, None] + np.asarray(radii_m)[:, None, None] * circle
    start, end = np.repeat(path[:1, None], sides + 1, 1), np.repeat(path[-1:, None], sides + 1, 1)
    return smooth(grid(np.concatenate([start, rings, end]), slot))


def ellipsoid(
    centre_m: Sequence[float], radii_m: Sequence[float], slot: int, sides: int = 8
) -> Mesh:
    """Build a smooth ellipsoid."""
    polar = np.linspace(0, np.pi, sides // 2 + 2)[:, None]
    turn = np.linspace(0, 2 * np.pi, sides + 1)[None]
    unit = np.stack(
        np.broadcast_arrays(
            np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)
        ),
        axis=-1,
    )
    return smooth(grid(np.asarray(centre_m) + unit * np.asarray(radii_m), slot), np.pi)
