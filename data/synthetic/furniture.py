"""Things that people set up along a street: fences and rails, lamps, signs and signals, boxes, shelters, benches.

All stand at the origin, x along the road, y away from it, but for what faces traffic: that faces -x.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from data.synthetic import meshes
from data.synthetic.materials import Slot, palette
from data.synthetic.meshes import Mesh
from perception.geometry import se3
from perception.types import Float32, Float64


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
    plate = sign_plate(rim, np.array([-radius_m - 0.02, 0, 2.3]), size)
    pole = meshes.tube((0, 0, -0.3), (0, 0, 2.65), (radius_m, radius_m), Slot.METAL, 8)
    return meshes.merge([pole, *plate])


def sign_plate(rim_m: Float64, centre_m: Float64, size_m: float) -> list[Mesh]:
    """Build the face of a sign towards -x, and its back."""
    plate = []
    for back, slot in ((0.0, Slot.SIGN), (0.012, Slot.SIGN_BACK)):
        middle = np.zeros_like(rim_m)
        disc = meshes.grid(np.stack([middle, rim_m]) + centre_m + (back, 0, 0), slot)
        plate.append(meshes.textured(disc, (disc.vertices_m - centre_m)[:, 1:] / size_m))
    return plate


def sign_palette(kind: int, rng: np.random.Generator) -> Float32:
    """Draw the colour of a sign's ground."""
    colours = [(0.75, 0.75, 0.73), (0.75, 0.75, 0.73), (0.03, 0.10, 0.45), (0.65, 0.55, 0.05)]
    choice = colours[kind] if kind else colours[int(rng.integers(0, 3))]
    return palette({Slot.SIGN: (*choice, float(rng.uniform(0.85, 0.99)))})


def bollard(height_m: float, radius_m: float) -> Mesh:
    """Build a thin post."""
    return meshes.tube((0, 0, -0.2), (0, 0, height_m), (radius_m, radius_m), Slot.METAL)


def signal(height_m: float, reach_m: float, rng: np.random.Generator) -> Mesh:
    """Build traffic lights on a pole, one over another one's side, some on an arm over the road."""
    radius_m = float(rng.uniform(0.05, 0.09))
    parts = [meshes.tube((0, 0, -0.3), (0, 0, height_m), (radius_m, radius_m), Slot.METAL, 10)]
    parts.append(_lights((-0.16, 0, 2.3)))
    if rng.random() < 0.6:
        side = float(rng.choice([-1, 1])) * 0.28
        parts.append(_lights((0, side, 2.0)))
    if rng.random() < 0.5:
        low = 0.95
        parts.append(meshes.box((-0.1, -0.17, low), (-0.04, 0.17, low + 0.25), Slot.SIGNAL))
    if reach_m > 0:
        parts.append(
            meshes.tube((0, 0, height_m), (0, reach_m, height_m), (0.06, 0.05), Slot.METAL, 8)
        )
        parts.append(_lights((-0.1, reach_m, height_m - 0.7)))
    return meshes.merge(parts)


def _lights(low_middle_m: Sequence[float]) -> Mesh:
    """Build one box of three lights."""
    x, y, z = low_middle_m
    return meshes.box((x - 0.1, y - 0.15, z), (x + 0.1, y + 0.15, z + 0.95), Slot.SIGNAL)


def guard_rail(length_m: float) -> Mesh:
    """Build a steel rail on posts along x, its waves as three bands."""
    heights = np.array([0.44, 0.50, 0.57, 0.60, 0.63, 0.70, 0.76])
    depths = np.array([0.0, -0.08, -0.08, 0.0, -0.08, -0.08, 0.0])
    ends = np.array([0.0, length_m])
    points = np.stack(np.broadcast_arrays(ends[:, None], depths[None], heights[None]), axis=-1)
    posts = [
        meshes.box((x, 0.01, -0.4), (x + 0.06, 0.12, 0.72), Slot.METAL)
        for x in np.arange(0.5, length_m, 2.0)
    ]
    return meshes.merge([meshes.grid(points, Slot.RAIL), *posts])


def barrier(length_m: float) -> Mesh:
    """Build a concrete barrier along x, broad at its foot."""
    half, height = np.array([0.3, 0.28, 0.13, 0.09]), np.array([-0.3, 0.12, 0.35, 0.85])
    profile = np.column_stack([np.r_[-half, half[::-1]], np.r_[height, height[::-1]]])
    ends = np.array([0.0, length_m])
    points = np.stack(
        np.broadcast_arrays(ends[:, None], profile[None, :, 0], profile[None, :, 1]), axis=-1
    )
    return meshes.grid(points, Slot.CONCRETE)


def cone(height_m: float) -> Mesh:
    """Build a traffic cone with a bright band."""
    foot, half = 0.3 * height_m, height_m / 2
    return meshes.merge(
        [
            meshes.box((-foot, -foot, -0.02), (foot, foot, 0.04), Slot.TRIM),
            meshes.tube((0, 0, 0.0), (0, 0, height_m), (0.7 * foot, 0.03), Slot.PANEL, 10),
            meshes.tube(
                (0, 0, half), (0, 0, 1.3 * half), (0.4 * foot + 0.01, 0.3 * foot + 0.01), Slot.SIGN
            ),
        ]
    )


def beacon(height_m: float) -> Mesh:
    """Build an upright striped board of a building site on its foot, its face towards -x."""
    foot = meshes.box((-0.2, -0.4, -0.02), (0.2, 0.4, 0.1), Slot.TRIM)
    board = meshes.box((-0.02, -0.125, 0.25), (0.02, 0.125, height_m), Slot.PANEL)
    face = meshes.box((-0.03, -0.1, 0.35), (-0.02, 0.1, height_m - 0.1), Slot.SIGN)
    post = meshes.box((-0.02, -0.04, 0.0), (0.02, 0.04, 0.3), Slot.PANEL)
    return meshes.merge([foot, post, board, face])


def board_barrier(length_m: float) -> Mesh:
    """Build a barrier of boards across two feet along x."""
    boards = [meshes.box((0, -0.02, z), (length_m, 0.02, z + 0.2), Slot.PANEL) for z in (0.35, 0.8)]
    feet = [
        meshes.box((x - 0.05, -0.3, -0.02), (x + 0.05, 0.3, 0.08), Slot.TRIM)
        for x in (0.2, length_m - 0.2)
    ]
    posts = [
        meshes.box((x - 0.03, -0.03, 0.0), (x + 0.03, 0.03, 1.0), Slot.METAL)
        for x in (0.2, length_m - 0.2)
    ]
    return meshes.merge([*boards, *feet, *posts])


def railing(length_m: float, height_m: float, gap_m: float = 0.14) -> Mesh:
    """Build a railing of thin upright bars along x."""
    bars = [
        meshes.tube((x, 0, 0.12), (x, 0, height_m), (0.011, 0.011), Slot.RAIL, 4)
        for x in np.arange(0.05, length_m, gap_m)
    ]
    beams = [
        meshes.tube((0, 0, z), (length_m, 0, z), (0.022, 0.022), Slot.RAIL, 5)
        for z in (0.12, height_m)
    ]
    posts = [
        meshes.tube((x, 0, -0.3), (x, 0, height_m + 0.05), (0.03, 0.03), Slot.RAIL, 6)
        for x in np.arange(0, length_m + 0.1, 2.0)
    ]
    return meshes.merge([*bars, *beams, *posts])


def mesh_fence(length_m: float, height_m: float, wire_m: float) -> Mesh:
    """Build posts with a mesh of upright and level wires between, of which a laser meets a part.

    Args:
        length_m: Length along x.
        height_m: Height over the ground.
        wire_m: Width of the wires; those upright are 5 cm apart, those level 20 cm.
    """
    upright = [((x, 0.05), (x + wire_m, height_m)) for x in np.arange(0.0, length_m, 0.05)]
    level = [((0.0, z), (length_m, z + wire_m)) for z in np.arange(0.08, height_m, 0.2)]
    corners = [
        [(x0, 0.0, z0), (x1, 0.0, z0), (x1, 0.0, z1), (x0, 0.0, z1)]
        for (x0, z0), (x1, z1) in [*upright, *level]
    ]
    posts = [
        meshes.box((x - 0.03, -0.03, -0.4), (x + 0.03, 0.03, height_m + 0.03), Slot.RAIL)
        for x in np.arange(0, length_m + 0.1, 2.5)
    ]
    return meshes.merge([meshes.quads(np.array(corners), Slot.WIRE), *posts])


def cabinet(rng: np.random.Generator) -> Mesh:
    """Build a switch cabinet on a plinth."""
    width, depth, height = rng.uniform([0.5, 0.3, 0.8], [1.8, 0.5, 1.5]).tolist()
    plinth = meshes.box((0.02, 0.02, -0.3), (width - 0.02, depth - 0.02, 0.1), Slot.CONCRETE)
    body = meshes.box((0, 0, 0.1), (width, depth, height), Slot.PANEL)
    lid = meshes.box(
        (-0.03, -0.03, height), (width + 0.03, depth + 0.03, height + 0.05), Slot.PANEL
    )
    return meshes.merge([plinth, body, lid])


def bins(rng: np.random.Generator) -> Mesh:
    """Build a row of dustbins, or one or two large waste containers."""
    if rng.random() < 0.5:
        count, length, depth, height = int(rng.integers(1, 6)), 0.58, 0.72, 1.08
    else:
        count = int(rng.integers(1, 4))
        length, depth, height = rng.uniform([1.2, 1.0, 1.2], [1.9, 1.5, 1.7]).tolist()
    found = []
    for number in range(count):
        x, y = number * (length + 0.12), float(rng.normal(0, 0.05))
        found += [
            meshes.box((x + 0.04, y + 0.05, 0.08), (x + length - 0.04, y + depth - 0.05, 0.9 * height), Slot.PANEL),
            meshes.box((x, y, 0.9 * height), (x + length, y + depth, height), Slot.PANEL),
        ]  # fmt: skip
    return meshes.merge(found)


def pillar(rng: np.random.Generator) -> Mesh:
    """Build a round pillar pasted with posters."""
    radius, height = float(rng.uniform(0.5, 0.75)), float(rng.uniform(2.6, 3.6))
    base = meshes.tube((0, 0, -0.3), (0, 0, 0.3), (radius + 0.05, radius + 0.05), Slot.CONCRETE, 20)
    body = meshes.tube((0, 0, 0.3), (0, 0, height), (radius, radius), Slot.PANEL, 20)
    return meshes.merge([base, body])


def billboard(rng: np.random.Generator) -> Mesh:
    """Build a poster board on two feet, along x."""
    width, height = float(rng.uniform(1.2, 3.6)), float(rng.uniform(1.3, 2.4))
    foot = float(rng.uniform(0.3, 1.0))
    board = meshes.box((0, -0.1, foot), (width, 0.1, foot + height), Slot.PANEL)
    feet = [
        meshes.box((x, -0.06, -0.3), (x + 0.1, 0.06, foot), Slot.METAL) for x in (0.1, width - 0.2)
    ]
    return meshes.merge([board, *feet])


def shelter(rng: np.random.Generator) -> Mesh:
    """Build a bus stop along x: glass at the back and the sides, a roof, a bench."""
    length, depth = float(rng.uniform(2.8, 4.8)), 1.4
    posts = [
        meshes.tube((x, y, -0.3), (x, y, 2.35), (0.045, 0.045), Slot.METAL, 6)
        for x in (0.0, length / 2, length)
        for y in (0.1, depth)
    ]
    panes = [
        meshes.box((0, depth - 0.01, 0.25), (length, depth + 0.01, 2.1), Slot.WINDOW),
        meshes.box((-0.01, 0.4, 0.25), (0.01, depth, 2.1), Slot.WINDOW),
    ]
    poster = meshes.box((length - 0.06, 0.1, 0.2), (length + 0.06, depth - 0.1, 2.1), Slot.PANEL)
    roof = meshes.box((-0.2, -0.2, 2.35), (length + 0.2, depth + 0.2, 2.5), Slot.PANEL)
    return meshes.merge([*posts, *panes, poster, roof, meshes.moved(bench(), _at(0.5, 0.8))])


def canopy(rng: np.random.Generator, length_m: float, depth_m: float) -> Mesh:
    """Build a roof over a place in its middle, on posts, with a bench, a wall at the back, both or neither."""
    half, side, top = length_m / 2, depth_m / 2, float(rng.uniform(2.3, 3.3))
    radius = float(rng.uniform(0.04, 0.12))
    rows = (side,) if rng.random() < 0.5 else (-side, side)
    parts = [
        meshes.tube((x, y, -0.3), (x, y, top), (radius, radius), Slot.METAL, 6)
        for x in np.linspace(-half, half, 2 + int(length_m / 4)).tolist()
        for y in rows
    ]
    parts.append(meshes.box((-half, -side, top), (half, side, top + 0.15), Slot.PANEL))
    if rng.random() < 0.5:
        parts.append(meshes.box((-half, side, 0.1), (half, side + 0.05, 2.1), Slot.WINDOW))
    if rng.random() < 0.5:
        parts.append(meshes.moved(bench(), _at(-0.9, side - 0.6)))
    return meshes.merge(parts)


def bench() -> Mesh:
    """Build a bench of 1.8 m along x, its back away from the road."""
    legs = [meshes.box((x, 0, -0.2), (x + 0.08, 0.45, 0.42), Slot.CONCRETE) for x in (0.2, 1.5)]
    seat = meshes.box((0, 0, 0.42), (1.8, 0.45, 0.47), Slot.FENCE)
    back = meshes.box((0, 0.43, 0.6), (1.8, 0.48, 0.85), Slot.FENCE)
    return meshes.merge([*legs, seat, back])


def delineator() -> Mesh:
    """Build a white roadside post with its reflector towards -x."""
    post = meshes.box((-0.05, -0.06, -0.2), (0.05, 0.06, 1.0), Slot.PANEL)
    return meshes.merge([post, meshes.box((-0.06, -0.03, 0.7), (-0.05, 0.03, 0.88), Slot.SIGN)])


def kerb_island(length_m: float, width_m: float) -> Mesh:
    """Build a raised island, its middle at the origin."""
    half, side = length_m / 2, width_m / 2
    return meshes.box((-half, -side, -0.2), (half, side, 0.13), Slot.KERB)


def planted_bed(length_m: float, depth_m: float) -> Mesh:
    """Build a bed of soil within kerb stones, its middle at the origin."""
    soil = meshes.box(
        (-length_m / 2 + 0.12, -depth_m / 2 + 0.12, -0.2),
        (length_m / 2 - 0.12, depth_m / 2 - 0.12, 0.17),
        Slot.GRASS,
    )
    return meshes.merge([kerb_island(length_m, depth_m), soil])


def keep_right_sign(height_m: float) -> Mesh:
    """Build the low round sign at an island's end, on a broad post, its face towards -x."""
    post = meshes.box((-0.06, -0.12, -0.2), (0.06, 0.12, height_m), Slot.PANEL)
    turn, size = np.linspace(0, 2 * np.pi, 17), 0.26
    rim = size * np.stack([0 * turn, np.cos(turn), np.sin(turn)], axis=1)
    return meshes.merge([post, *sign_plate(rim, np.array([-0.08, 0, height_m + 0.1]), size)])


def keep_right_palette(rng: np.random.Generator) -> Float32:
    """Draw the colours of a low sign: blue on a white, yellow or grey post."""
    posts = [(0.75, 0.75, 0.73), (0.65, 0.50, 0.03), (0.65, 0.50, 0.03), (0.3, 0.3, 0.3)]
    post = posts[int(rng.integers(len(posts)))]
    return palette(
        {
            Slot.PANEL: (*post, float(rng.uniform(0.3, 0.9))),
            Slot.SIGN: (0.03, 0.10, 0.45, float(rng.uniform(0.85, 0.99))),
        }
    )


def bicycle_stand() -> Mesh:
    """Build a hoop along x to which bicycles are locked."""
    corners = np.array([(-0.4, 0, -0.2), (-0.4, 0, 0.8), (0.4, 0, 0.8), (0.4, 0, -0.2)])
    return meshes.merge(
        [meshes.tube(start, end, (0.025, 0.025), Slot.METAL, 6) for start, end in pairwise(corners)]
    )


def panel_palette(rng: np.random.Generator) -> Float32:
    """Draw the colours of boxes, boards and rails."""
    panels = [(0.25, 0.26, 0.25), (0.03, 0.07, 0.04), (0.10, 0.10, 0.10), (0.02, 0.02, 0.02),
              (0.5, 0.5, 0.48), (0.13, 0.12, 0.10), (0.02, 0.04, 0.12), (0.30, 0.04, 0.02),
              (0.42, 0.30, 0.04)]  # fmt: skip
    common = np.array([5, 4, 4, 3, 4, 3, 1.5, 0.7, 0.5])
    panel = np.array(panels[rng.choice(len(panels), p=common / common.sum())])
    panel *= rng.uniform(0.7, 1.2)
    return palette(
        {
            Slot.PANEL: (*panel, float(rng.uniform(0.1, 0.6))),
            Slot.RAIL: (*(rng.uniform(0.1, 0.4) * np.ones(3)), float(rng.uniform(0.15, 0.5))),
            Slot.METAL: (0.30, 0.31, 0.32, float(rng.uniform(0.2, 0.6))),
        }
    )


def _at(x_m: float, y_m: float) -> Float64:
    return se3.from_euler(0.0, 0.0, 0.0, np.array([x_m, y_m, 0.0]))
