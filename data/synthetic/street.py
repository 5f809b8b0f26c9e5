"""Parts of a street at (s, l): the ground, upright poses along it, and houses."""

from dataclasses import dataclass

import numpy as np

from data.synthetic import meshes
from data.synthetic.materials import Slot, palette
from data.synthetic.meshes import Mesh
from data.synthetic.road import Road
from perception.geometry import se3
from perception.types import Float32, Float64


@dataclass(frozen=True)
class StaticBox:
    """Box around a static object of a class that KITTI does not have, as a parked bicycle.

    Attributes:
        category: Class.
        world_SE3_box: (4, 4) pose, its origin at the middle of the bottom.
        size_m: Length, width and height in metres.
    """

    category: str
    world_SE3_box: Float64
    size_m: tuple[float, float, float]

    @classmethod
    def around(cls, category: str, mesh: Mesh, world_SE3_upright: Float64) -> "StaticBox":
        """Return the smallest upright box around a mesh in the world, its axes along those of a pose."""
        rotation = world_SE3_upright[:3, :3]
        local_m = (mesh.vertices_m - world_SE3_upright[:3, 3]) @ rotation
        low, high = local_m.min(axis=0), local_m.max(axis=0)
        pose = world_SE3_upright.copy()
        pose[:3, 3] += rotation @ np.append((low + high)[:2] / 2, low[2])
        length, width, height = (high - low).tolist()
        return cls(category, pose, (length, width, height))


@dataclass(frozen=True)
class Part:
    """A static part of the street.

    Attributes:
        mesh: Mesh in world coordinates.
        palette: (slots, 4) colour and reflectance.
        semantic: Class of all its points, 0 for that of each material.
        instance: Object number, 0 for what is not an object.
        box: Box of a static object of a class that KITTI does not have, None of all else.
    """

    mesh: Mesh
    palette: Float32
    semantic: int = 0
    instance: int = 0
    box: StaticBox | None = None


def ground(road: Road, start_m: float, end_m: float, appearance: Float32 | None = None) -> Part:
    """Mesh the carriageway, kerbs, pavements and the land beside them."""
    shape = road.shape
    kerb, outer = shape.half_width_m, shape.outer_m
    land = [outer + 8.0, outer + 45.0]
    if shape.is_uneven:
        rise = np.arange(outer + 0.8, outer + shape.land_reach_m + 10, 0.8)
        land = [*rise.tolist(), outer + shape.land_reach_m + 45.0]
    half = [0.0, shape.lanes_m, kerb - 1e-4, kerb + 0.015, kerb + 0.15, outer, *land]
    slots = [Slot.ASPHALT] * 2 + [Slot.KERB] * 2 + [Slot.PAVEMENT] + [Slot.GRASS] * len(land)
    across = np.array([-v for v in half[:0:-1]] + half)
    stations = np.arange(start_m, end_m + 1.0, 1.0)
    s, side = np.meshgrid(stations, across, indexing="ij")
    surface = meshes.grid(road.place(s, side), np.array(slots[::-1] + slots, np.uint8)[None])
    along = np.stack([s, side], axis=-1).reshape(-1, 2)
    return Part(
        meshes.textured(meshes.smooth(surface, np.radians(25)), along),
        palette() if appearance is None else appearance,
    )


def upright_pose(road: Road, s_m: float, l_m: float, turn_rad: float = 0.0) -> Float64:
    """Return world_SE3_object of an upright object on the ground, x along the road, turned by an angle."""
    place = road.place(np.array(s_m), np.array(l_m))
    return se3.from_euler(0.0, 0.0, float(road.heading_rad(np.array(s_m))) + turn_rad, place)


def sloped_pose(road: Road, s_m: float, l_m: float) -> Float64:
    """Return world_SE3_object of a long low object that rises and falls with the road, x along it."""
    before, place, after = road.place(np.array([s_m - 1, s_m, s_m + 1]), np.full(3, l_m))
    pitch_rad = -float(np.arctan2(after[2] - before[2], 2.0))
    return se3.from_euler(0.0, pitch_rad, float(road.heading_rad(np.array(s_m))), place)


def facade_pose(road: Road, s_m: float, length_m: float, l_m: float) -> Float64:
    """Return the pose of a straight front along the road: x along it, y away from the road."""
    # Straight fronts stand clear of the pavement where the road curves.
    clear = l_m + np.sign(l_m) * road.shape.curvature_1_m * length_m**2 / 8
    ends = road.place(np.array([s_m, s_m + length_m]), np.full(2, clear))
    start, end = ends if l_m > 0 else ends[::-1]
    heading = float(np.arctan2(end[1] - start[1], end[0] - start[0]))
    return se3.from_euler(0.0, 0.0, heading, np.array([*start[:2], ends[:, 2].min()]))


def _windows_grid(
    length_m: float, floors: int, rng: np.random.Generator
) -> tuple[Float64, Float64]:
    """Return the breaks along a façade and up it; odd cells of both are windows."""
    bays = max(2, round(length_m / rng.uniform(2.2, 3.0)))
    bay, storey = length_m / bays, rng.uniform(2.8, 3.3)
    wide, high = rng.uniform(0.40, 0.6) * bay, rng.uniform(0.45, 0.58) * storey
    centres_x, sills = (np.arange(bays) + 0.5) * bay, np.arange(floors) * storey + 0.95
    x = np.sort(np.concatenate([[0, length_m], centres_x - wide / 2, centres_x + wide / 2]))
    z = np.sort(np.concatenate([[-1.5, floors * storey + 0.3], sills, sills + high]))
    return x, z


def _wall_with_windows(x: Float64, z: Float64, rng: np.random.Generator) -> Mesh:
    """Build a façade in the x-z plane, its windows set back, frames around, curtains behind."""
    column, row = np.meshgrid(np.arange(len(x) - 1), np.arange(len(z) - 1), indexing="ij")
    is_window = ((column % 2 == 1) & (row % 2 == 1)).ravel()
    x0, x1 = x[column.ravel()], x[column.ravel() + 1]
    z0, z1 = z[row.ravel()], z[row.ravel() + 1]
    door = (column.ravel() == 1 + 2 * int(rng.integers(len(x) // 2 - 1))) & (row.ravel() == 1)
    z0 = np.where(door, 0.05, z0)

    def face(depth: float, keep: np.ndarray, inset: float = 0.0) -> Float64:
        left, right = x0[keep] + inset, x1[keep] - inset
        low, high = z0[keep] + inset, z1[keep] - inset
        deep = np.full_like(left, depth)
        corners = [(left, deep, low), (right, deep, low), (right, deep, high), (left, deep, high)]
        return np.stack([np.stack(corner, axis=-1) for corner in corners], axis=1)

    panes, outer = is_window & ~door, face(0.0, is_window)
    inner = face(0.14, is_window)
    reveals = np.concatenate(
        [np.stack([outer[:, i], outer[:, j], inner[:, j], inner[:, i]], axis=1)
         for i, j in ((0, 1), (1, 2), (2, 3), (3, 0))]
    )  # fmt: skip
    frame_outer, frame_inner = face(0.12, panes), face(0.12, panes, 0.07)
    frames = np.concatenate(
        [np.stack([frame_outer[:, i], frame_outer[:, j], frame_inner[:, j], frame_inner[:, i]], axis=1)
         for i, j in ((0, 1), (1, 2), (2, 3), (3, 0))]
    )  # fmt: skip
    faces = [(face(0.0, ~is_window), Slot.WALL), (reveals, Slot.WALL), (frames, Slot.FRAME),
             (face(0.14, panes), Slot.WINDOW), (face(0.7, panes, -0.2), Slot.CURTAIN),
             (face(0.14, door), Slot.DOOR)]  # fmt: skip
    wall = meshes.merge([meshes.quads(corners, slot) for corners, slot in faces if len(corners)])
    return meshes.textured(wall, wall.vertices_m[:, [0, 2]])


def house(length_m: float, floors: int, rng: np.random.Generator) -> Mesh:
    """Build a house: façade along x at y = 0, the body behind at y > 0, a pitched roof."""
    x, z = _windows_grid(length_m, floors, rng)
    eaves, depth = z[-1], 9.0
    ridge = eaves + rng.uniform(1.5, 3.5)
    sides = [
        meshes.grid(
            np.array([[[e, 0, -1.5], [e, depth, -1.5]], [[e, 0, eaves], [e, depth, eaves]]]),
            Slot.WALL,
        )
        for e in (0.0, length_m)
    ]
    gables = [
        meshes.make(
            np.array([[e, 0, eaves], [e, depth, eaves], [e, depth / 2, ridge]]),
            np.array([[0, 1, 2]]),
            Slot.WALL,
        )
        for e in (0.0, length_m)
    ]
    lip = 0.4
    roof = meshes.grid(
        np.array(
            [
                [[e, -lip, eaves - 0.15], [e, depth / 2, ridge], [e, depth + lip, eaves - 0.15]]
                for e in (-0.2, length_m + 0.2)
            ]
        ),
        Slot.ROOF,
    )
    back = meshes.box((0, depth - 0.1, -1.5), (length_m, depth, eaves), Slot.WALL)
    upright = [meshes.textured(m, m.vertices_m[:, [1, 2]]) for m in (*sides, *gables)]
    return meshes.merge([_wall_with_windows(x, z, rng), *upright, roof, back])


def house_palette(rng: np.random.Generator) -> Float32:
    """Draw plaster, brick and roof colours."""
    plaster = [(0.62, 0.55, 0.42), (0.66, 0.62, 0.55), (0.55, 0.40, 0.28), (0.45, 0.20, 0.14),
               (0.60, 0.58, 0.56), (0.42, 0.42, 0.43), (0.64, 0.48, 0.40)]  # fmt: skip
    wall = np.array(plaster[rng.integers(len(plaster))]) * rng.uniform(0.75, 1.1)
    roof = np.array([(0.26, 0.09, 0.06), (0.12, 0.11, 0.11), (0.20, 0.12, 0.09)][rng.integers(3)])
    doors = [(0.10, 0.05, 0.03), (0.04, 0.08, 0.05), (0.45, 0.44, 0.42), (0.06, 0.06, 0.07)]
    door = np.array(doors[rng.integers(len(doors))])
    return palette(
        {
            Slot.WALL: (*wall, rng.uniform(0.28, 0.45)),
            Slot.ROOF: (*roof, 0.3),
            Slot.DOOR: (*door, 0.3),
        }
    )
