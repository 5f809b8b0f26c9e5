"""Ray casting: one Embree scene for all static surfaces, and one for each moving shape.

A ray that may meet a moving thing is carried into that thing's own frame, at the moment it is fired,
so that no geometry is rebuilt from frame to frame and a scan sees motion exactly.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from threading import Lock
from typing import Any

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from data.synthetic import meshes
from data.synthetic.materials import column
from data.synthetic.meshes import Mesh
from data.synthetic.street import Part
from perception.kernels.rendering import follow_object, pass_sphere
from perception.types import Bool, Float32, Float64, Int


@dataclass(frozen=True)
class MovingObject:
    """A moving object at a reference time.

    Attributes:
        shape: Index of its shape in the scene.
        object_row: Row of its palette and class in the scene's tables.
        world_SE3_object: (4, 4) pose.
        velocity_m_s: (3,) velocity in world axes.
    """

    shape: int
    object_row: int
    world_SE3_object: Float64
    velocity_m_s: Float64


@dataclass(frozen=True)
class Rays:
    """N rays.

    Attributes:
        origins_m: (N, 3) origins in world coordinates.
        directions: (N, 3) unit directions.
        delays_s: (N,) firing time after the reference time.
        near: Function that returns the rays that may pass within a radius of a point.
    """

    origins_m: Float32
    directions: Float32
    delays_s: Float32
    near: Callable[[Float64, float], Int]


@dataclass(frozen=True)
class Hits:
    """Hits of N rays.

    Attributes:
        distance_m: (N,) distance along the ray in metres; infinity where it meets nothing.
        row: (N,) row of the surface table; -1 where it meets nothing.
        object_row: (N,) row of the object that is met; -1 for none.
        u: (N,) barycentric coordinate of the triangle's second corner.
        v: (N,) barycentric coordinate of its third corner.
        moving: (N,) index into the list of moving objects, -1 for static surfaces.
    """

    distance_m: Float32
    row: Int
    object_row: Int
    u: Float32
    v: Float32
    moving: Int


class RaycastingScene:
    """Surfaces that rays can hit, with their materials."""

    def __init__(self, parts: Sequence[Part]) -> None:
        """Merge the static surfaces."""
        self._palettes = [part.palette for part in parts]
        self._semantics = [part.semantic for part in parts]
        self._instances = [part.instance for part in parts]
        still = meshes.merge([part.mesh for part in parts])
        self._still = _Surface(still)
        self._meshes, self._starts = [still], [0]
        self._shapes: list[_Surface] = []
        self._object_of_row = np.repeat(
            np.arange(len(parts), dtype=np.int32), [len(part.mesh) for part in parts]
        )
        self._radii_m: list[float] = []
        self.tables: SurfaceTables

    def add_shape(self, mesh: Mesh) -> int:
        """Add a shape of moving objects; return its index."""
        self._starts.append(self._starts[-1] + len(self._meshes[-1]))
        self._meshes.append(mesh)
        self._shapes.append(_Surface(mesh))
        self._radii_m.append(mesh.radius_m)
        return len(self._shapes) - 1

    def add_object(self, palette: Float32, semantic: int, instance: int) -> int:
        """Add the palette and class of a moving object; return its row."""
        self._palettes.append(palette)
        self._semantics.append(semantic)
        self._instances.append(instance)
        return len(self._palettes) - 1

    def finish(self) -> None:
        """Build the tables once all shapes and objects are known."""
        whole = meshes.merge(self._meshes)
        corners = whole.vertices_m[whole.triangles]
        faces = meshes.face_areas(corners)
        faces /= np.maximum(np.linalg.norm(faces, axis=1, keepdims=True), 1e-12)
        self.tables = SurfaceTables(
            whole.slots,
            faces.astype(np.float32),
            whole.normals,
            whole.texture_m,
            np.stack(self._palettes),
            np.array(self._semantics, np.int32),
            np.array(self._instances, np.int32),
        )

    def cast(self, rays: Rays, moving: Sequence[MovingObject]) -> Hits:
        """Return the first surface that each ray hits."""
        met = self._still.run(rays.origins_m, rays.directions, output=1)
        row = met["primID"].copy()
        is_hit = row >= 0
        hits = Hits(
            np.where(is_hit, met["tfar"], np.float32(np.inf)),
            row,
            np.where(is_hit, self._object_of_row[row], -1),
            met["u"],
            met["v"],
            np.full(len(row), -1, np.int32),
        )
        for number, object_row in enumerate(moving):
            self._cast_at(rays, number, object_row, hits)
        return hits

    def _cast_at(self, rays: Rays, number: int, object_row: MovingObject, hits: Hits) -> None:
        """Overwrite the hits of the rays that hit one moving object first."""
        centre = object_row.world_SE3_object[:3, 3]
        slack = 0.06 * float(np.linalg.norm(object_row.velocity_m_s))
        index = rays.near(centre, self._radii_m[object_row.shape] + slack)
        if len(index) == 0:
            return
        origins, directions = to_local(rays, index, object_row)
        reach = np.minimum(hits.distance_m.take(index), np.float32(1e6))
        met = self._shapes[object_row.shape].run(origins, directions, dists=reach, output=1)
        is_first = np.flatnonzero(met["primID"] >= 0)
        at = index.take(is_first)
        hits.distance_m[at] = met["tfar"].take(is_first)
        hits.row[at] = met["primID"].take(is_first) + self._starts[object_row.shape + 1]
        hits.u[at], hits.v[at] = met["u"].take(is_first), met["v"].take(is_first)
        hits.object_row[at], hits.moving[at] = object_row.object_row, number

    def blocks(self, rays: Rays, moving: Sequence[MovingObject]) -> Bool:
        """Return which rays hit any surface; panes of glass cast shadows too."""
        blocked = self._still.run(rays.origins_m, rays.directions, query="OCCLUDED") >= 0
        for object_row in moving:
            index = rays.near(object_row.world_SE3_object[:3, 3], self._radii_m[object_row.shape])
            if len(index):
                blocked[index] |= self.meets(object_row.shape, *to_local(rays, index, object_row))
        return np.asarray(blocked)

    def meets(self, shape: int, origins_m: Float32, directions: Float32) -> Bool:
        """Return which rays, in a shape's own frame, hit it, other objects ignored."""
        return np.asarray(self._shapes[shape].run(origins_m, directions, query="OCCLUDED") >= 0)

    def face_normals(self, hits: Hits, moving: Sequence[MovingObject]) -> Float32:
        """Return (N, 3) world normals of the faces that are hit; zero where none is."""
        normals = np.where(hits.row[:, None] >= 0, self.tables.face_normals[hits.row], 0)
        return rotated(normals, hits.moving, moving)


@dataclass(frozen=True)
class SurfaceTables:
    """Materials of R triangles and O objects.

    Attributes:
        slots: (R,) material slots.
        face_normals: (R, 3) normals in the frame of their scene or shape.
        corner_normals: (R, 3, 3) smoothed normals at the corners.
        texture_m: (R, 3, 2) texture coordinates at the corners in metres.
        palettes: (O, slots, 4) colour and reflectance.
        semantics: (O,) class of the whole object, 0 for that of each material.
        instances: (O,) object numbers, 0 for none.
    """

    slots: np.ndarray
    face_normals: Float32
    corner_normals: Float32
    texture_m: Float32
    palettes: Float32
    semantics: Int
    instances: Int

    def classes(self, row: Int, object_row: Int) -> Int:
        """Return the class of points on given rows of given objects."""
        own = _SEMANTIC_OF_SLOT[self.slots[row]]
        whole = self.semantics[object_row]
        return np.where(whole > 0, whole, own)


_SEMANTIC_OF_SLOT = column("semantic").astype(np.int32)


class _Surface:
    """Embree's scene of a mesh, built before its first query: most moving shapes of a world meet no ray."""

    def __init__(self, mesh: Mesh) -> None:
        self._mesh, self._building = mesh, Lock()
        self._scene: EmbreeScene | None = None

    def run(self, origins_m: Float32, directions: Float32, **query: Any) -> Any:  # noqa: ANN401 - as of Embree
        """Query the scene; threads may share it."""
        with self._building:
            if self._scene is None:
                scene = EmbreeScene()
                TriangleMesh(scene, self._mesh.vertices_m, self._mesh.triangles)
                # Embree builds its tree in the first query, which no other thread may join.
                scene.run(np.zeros((1, 3), np.float32), np.array([[0, 0, 1]], np.float32))
                self._scene = scene
        return self._scene.run(origins_m, directions, **query)


def to_local(rays: Rays, index: Int, object_row: MovingObject) -> tuple[Float32, Float32]:
    """Transform some rays into a moving object's frame at the time each is fired."""
    rotation = object_row.world_SE3_object[:3, :3].astype(np.float32)
    position_m = object_row.world_SE3_object[:3, 3].astype(np.float32)
    velocity_m_s = object_row.velocity_m_s.astype(np.float32)
    origins, directions = np.empty((2, len(index), 3), np.float32)
    follow_object(
        origins, directions, index,
        rays.origins_m, rays.directions, rays.delays_s, position_m, velocity_m_s,
    )  # fmt: skip
    return origins @ rotation, directions @ rotation


def rotated(normals: Float32, numbers: Int, moving: Sequence[MovingObject]) -> Float32:
    """Rotate normals on moving objects, by their numbers, from their own frames to the world's."""
    turned = normals.copy()
    at = np.flatnonzero(numbers >= 0)
    if len(at):
        rotations = np.stack([object_row.world_SE3_object[:3, :3] for object_row in moving]).astype(
            np.float32
        )
        turned[at] = np.einsum("nij,nj->ni", rotations[numbers[at]], normals[at])
    return turned


def near_any(origins_m: Float32, directions: Float32) -> Callable[[Float64, float], Int]:
    """Return a search by distance for the rays that pass a point, for rays in no order."""
    by_axis = np.ascontiguousarray(origins_m.T), np.ascontiguousarray(directions.T)
    is_near = np.empty(len(origins_m), bool)

    def near(centre_m: Float64, radius_m: float) -> Int:
        pass_sphere(is_near, *by_axis, centre_m.astype(np.float32), radius_m)
        return np.flatnonzero(is_near)

    return near
