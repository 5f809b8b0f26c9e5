"""What stands along a street: ground, houses, trees, hedges, fences, poles and signs, as parts at (s, l)."""

from dataclasses import dataclass

import numpy as np

from data.synthetic import meshes
from data.synthetic.materials import Slot, palette
from data.synthetic.meshes import Mesh
from data.synthetic.road import Road
from perception.geometry import se3
from perception.types import Float32, Float64


@dataclass(frozen=True)
class Part:
    """One thing that never moves.

    Attributes:
        mesh: in world coordinates.
        palette: (slots, 4) colour and reflectance.
        semantic: class of all its points, 0 to take each material's own.
        instance: its object number, 0 for what is no object.
    """

    mesh: Mesh
    palette: Float32
    semantic: int = 0
    instance: int = 0


def ground(road: Road, start_m: float, end_m: float) -> Part:
    """Mesh the carriageway, kerbs, pavements and the land beside them."""
    shape = road.shape
    kerb, outer = shape.half_width_m, shape.half_width_m + shape.pavement_m
    half = [
        0.0,
        shape.lane_m,
        kerb - 1e-4,
        kerb + 0.015,
        kerb + 0.15,
        outer,
        outer + 8.0,
        outer + 45.0,
    ]
    slots = [Slot.ASPHALT] * 2 + [Slot.KERB] * 2 + [Slot.PAVEMENT] + [Slot.GRASS] * 2
    across = np.array([-v for v in half[:0:-1]] + half)
    stations = np.arange(start_m, end_m + 1.0, 1.0)
    s, side = np.meshgrid(stations, across, indexing="ij")
    surface = meshes.grid(road.place(s, side), np.array(slots[::-1] + slots, np.uint8)[None])
    along = np.stack([s, side], axis=-1).reshape(-1, 2)
    return Part(meshes.textured(meshes.smooth(surface, np.radians(25)), along), palette())


def standing(road: Road, s_m: float, l_m: float, turn_rad: float = 0.0) -> Float64:
    """Return world_SE3_thing of something upright on the ground, x along the road but for a turn."""
    place = road.place(np.array(s_m), np.array(l_m))
    return se3.from_euler(0.0, 0.0, float(road.heading_rad(np.array(s_m))) + turn_rad, place)


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


def _leaf_cards(
    centres: Float64, outward: Float64, size_m: float, rng: np.random.Generator
) -> Mesh:
    """Scatter one randomly turned leaf triangle at each centre, shaded as the crown's surface."""
    corners = centres[:, None] + rng.normal(0, size_m, (len(centres), 3, 3))
    mesh = meshes.make(
        corners.reshape(-1, 3), np.arange(3 * len(centres)).reshape(-1, 3), Slot.LEAVES
    )
    normals = outward + 0.5 * rng.normal(size=outward.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    shaded = np.repeat(normals[:, None].astype(np.float32), 3, axis=1)
    return meshes.Mesh(mesh.vertices_m, mesh.triangles, mesh.slots, shaded, mesh.texture_m)


def tree(height_m: float, rng: np.random.Generator, leaves: int = 1700) -> Mesh:
    """Build a trunk with boughs and a crown of loose leaf clusters."""
    stem = rng.uniform(0.28, 0.4) * height_m
    trunk_m = 0.012 * height_m + 0.06
    top = np.array([rng.normal(0, 0.2), rng.normal(0, 0.2), 0.75 * height_m])
    parts = [meshes.tube((0, 0, -0.3), top, (trunk_m, 0.3 * trunk_m), Slot.TRUNK)]
    centres, outward = [], []
    for _ in range(7):
        turn, reach = rng.uniform(0, 2 * np.pi), rng.uniform(0.05, 0.2) * height_m
        middle = np.array(
            [
                reach * np.cos(turn),
                reach * np.sin(turn),
                rng.uniform(stem + 0.12 * height_m, 0.86 * height_m),
            ]
        )
        parts.append(
            meshes.tube(top * (stem / top[2]), middle, (0.4 * trunk_m, 0.02), Slot.TRUNK, 5)
        )
        unit = rng.normal(size=(leaves // 7, 3))
        unit /= np.linalg.norm(unit, axis=1, keepdims=True)
        radii = np.array([0.17, 0.17, 0.13]) * height_m * rng.uniform(0.8, 1.15)
        shell = rng.uniform(0.5, 1.0, (len(unit), 1)) ** 0.5
        centres.append(middle + unit * radii * shell)
        outward.append(unit)
    crown = _leaf_cards(
        np.concatenate(centres), np.concatenate(outward), 0.085 + 0.007 * height_m, rng
    )
    return meshes.merge([*parts, crown])


def foliage_palette(rng: np.random.Generator) -> Float32:
    """Draw a green."""
    green = np.array([0.10, 0.16, 0.035]) * rng.uniform([0.6, 0.7, 0.6], [1.5, 1.25, 1.4])
    return palette({Slot.LEAVES: (*green, rng.uniform(0.3, 0.45))})


def hedge(length_m: float, height_m: float, rng: np.random.Generator) -> Mesh:
    """Build a dense hedge along x, 0.8 m deep."""
    count = int(130 * length_m * height_m)
    low, high = np.array([0, -0.4, 0.0]), np.array([length_m, 0.4, height_m])
    centres = rng.uniform(low, high, (count, 3))
    face = rng.integers(0, 3, count)
    centres[face == 0, 1] = -0.4 + rng.uniform(0, 0.08, (face == 0).sum())
    centres[face == 1, 2] = height_m - rng.uniform(0, 0.08, (face == 1).sum())
    outward = np.stack(
        [0 * centres[:, 0], np.where(face == 0, -1.0, 0.2), np.where(face == 1, 1.0, 0.2)], axis=1
    )
    core = meshes.box((0.1, -0.3, -0.5), (length_m - 0.1, 0.3, height_m - 0.12), Slot.LEAVES)
    return meshes.merge([core, _leaf_cards(centres, outward, 0.07, rng)])


def fence(length_m: float, height_m: float) -> Mesh:
    """Build a paling fence along x: posts, rails, and pales with gaps."""
    pales = np.arange(0.05, length_m, 0.16)
    parts = [meshes.box((x, -0.012, 0.06), (x + 0.09, 0.012, height_m), Slot.FENCE) for x in pales]
    rails = [
        meshes.box((0, 0.012, z), (length_m, 0.05, z + 0.08), Slot.FENCE)
        for z in (0.25, height_m - 0.3)
    ]
    posts = [
        meshes.box((x, 0.0, -0.4), (x + 0.1, 0.1, height_m + 0.05), Slot.FENCE)
        for x in np.arange(0, length_m, 2.4)
    ]
    mesh = meshes.merge([*parts, *rails, *posts])
    return meshes.textured(mesh, mesh.vertices_m[:, [0, 2]])


def garden_wall(length_m: float, height_m: float) -> Mesh:
    """Build a low wall along x."""
    mesh = meshes.box((0, -0.12, -0.5), (length_m, 0.12, height_m), Slot.WALL)
    return meshes.textured(mesh, mesh.vertices_m[:, [0, 2]])


def lamp(height_m: float, radius_m: float, reach_m: float) -> Mesh:
    """Build a street lamp whose arm reaches along y."""
    pole = meshes.tube((0, 0, -0.3), (0, 0, height_m), (radius_m, 0.7 * radius_m), Slot.METAL, 10)
    foot = meshes.tube((0, 0, -0.3), (0, 0, 0.9), (1.5 * radius_m, 1.5 * radius_m), Slot.METAL, 10)
    arm = meshes.tube((0, 0, height_m), (0, reach_m, height_m + 0.25), (0.03, 0.025), Slot.METAL, 6)
    head = meshes.ellipsoid((0, reach_m, height_m + 0.25), (0.14, 0.32, 0.07), Slot.METAL)
    return meshes.merge([pole, foot, arm, head])


def sign(kind: int, radius_m: float) -> Mesh:
    """Build a traffic sign on a pole, its face towards -x: round, triangular, square or a name board."""
    corners, size = ((24, 0.32), (3, 0.45), (4, 0.38), (4, 0.45))[kind]
    turn = np.linspace(0, 2 * np.pi, corners + 1) + (np.pi / 4 if corners == 4 else np.pi / 2)
    wide = 1.8 if kind == 3 else 1.0
    rim = np.stack([0 * turn, wide * size * np.cos(turn), size * np.sin(turn)], axis=1)
    centre, plate = np.array([-radius_m - 0.02, 0, 2.3]), []
    for back, slot in ((0.0, Slot.SIGN), (0.012, Slot.SIGN_BACK)):
        middle = np.zeros_like(rim)
        disc = meshes.grid(np.stack([middle, rim]) + centre + (back, 0, 0), slot)
        plate.append(meshes.textured(disc, (disc.vertices_m - centre)[:, 1:] / size))
    pole = meshes.tube((0, 0, -0.3), (0, 0, 2.65), (radius_m, radius_m), Slot.METAL, 8)
    return meshes.merge([pole, *plate])


def sign_palette(kind: int, rng: np.random.Generator) -> Float32:
    """Draw the colour of a sign's ground."""
    colours = [(0.75, 0.75, 0.73), (0.75, 0.75, 0.73), (0.03, 0.10, 0.45), (0.65, 0.55, 0.05)]
    choice = colours[kind] if kind else colours[int(rng.integers(0, 3))]
    return palette({Slot.SIGN: (*choice, float(rng.uniform(0.85, 0.99)))})


def bollard(height_m: float, radius_m: float) -> Mesh:
    """Build a thin post."""
    return meshes.tube((0, 0, -0.2), (0, 0, height_m), (radius_m, radius_m), Slot.METAL)
