"""What grows along a street: trees of several shapes, hedges and bushes, wild ones of loose leaves that rays pass between."""

import numpy as np

from data.synthetic import meshes
from data.synthetic.materials import Slot, palette
from data.synthetic.meshes import Mesh
from perception.types import Float32, Float64

CROWN_REACH = 0.38  # of a tree's height, from its trunk
_LEAVES_PER_M2 = 60.0  # of the body of a trimmed bush
_STEM, _LOW_STEM = (0.28, 0.4), (-0.05, 0.1)  # share of a tree's height below its crown


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


def tree(
    height_m: float, rng: np.random.Generator, leaves: int = 1700, *, is_low: bool = False
) -> Mesh:
    """Build a trunk with boughs and a crown of loose leaf clusters, high up or down to the ground."""
    stem = rng.uniform(*(_LOW_STEM if is_low else _STEM)) * height_m
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
    # Fewer leaves are larger, so that a crown hides as much.
    leaf_m = (0.085 + 0.007 * height_m) * np.sqrt(1700 / leaves)
    crown = _leaf_cards(np.concatenate(centres), np.concatenate(outward), leaf_m, rng)
    return meshes.merge([*parts, crown])


def foliage_palette(rng: np.random.Generator) -> Float32:
    """Draw a green."""
    green = np.array([0.055, 0.085, 0.024]) * rng.uniform([0.6, 0.7, 0.6], [1.6, 1.3, 1.5])
    return palette({Slot.LEAVES: (*green, rng.uniform(0.38, 0.6))})


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
    core = meshes.textured(core, core.vertices_m[:, :2] + core.vertices_m[:, 1:])
    return meshes.merge([core, _leaf_cards(centres, outward, 0.07, rng)])


def trimmed(core: Mesh, rng: np.random.Generator) -> Mesh:
    """Cover a body with leaves, as of a bush that is cut to a shape."""
    corners = core.vertices_m[core.triangles].astype(np.float64)
    doubled = meshes.face_areas(core.vertices_m[core.triangles])
    areas_m2 = np.linalg.norm(doubled, axis=1) / 2
    count = int(_LEAVES_PER_M2 * areas_m2.sum())
    of = rng.choice(len(areas_m2), size=count, p=areas_m2 / areas_m2.sum())
    shares = rng.dirichlet((1.0, 1.0, 1.0), count)
    centres = np.einsum("nc,nca->na", shares, corners[of])
    cards = _leaf_cards(centres, doubled[of] / (2 * areas_m2[of, None]), 0.06, rng)
    return meshes.merge([core, cards])


def block(size_m: Float64 | list[float]) -> Mesh:
    """Build the body of a bush that is cut to a block, of given length, depth and height."""
    length, depth, height = size_m
    core = meshes.box((-length / 2, -depth / 2, -0.3), (length / 2, depth / 2, height), Slot.LEAVES)
    return meshes.textured(core, core.vertices_m[:, :2] + core.vertices_m[:, 1:])


def trimmed_bush(size_m: Float64, rng: np.random.Generator) -> Mesh:
    """Build a bush cut to a block, a ball or a cone, of given length, depth and height."""
    length, depth, height = size_m.tolist()
    shape = rng.choice(["block", "block", "ball", "cone"])
    if shape == "block":
        core = block(size_m)
    elif shape == "ball":
        core = meshes.ellipsoid(
            (0, 0, 0.48 * height), (length / 2, depth / 2, 0.52 * height), Slot.LEAVES, 14
        )
    else:
        cone = meshes.tube((0, 0, -0.1), (0, 0, 1), (0.5, 0.1), Slot.LEAVES, 14)
        core = meshes.stretched(cone, (0.7 * length, 0.7 * length, 1.2 * height))
    core = meshes.textured(core, core.vertices_m[:, :2] + core.vertices_m[:, 1:])
    return trimmed(core, rng)


def conifer(height_m: float, rng: np.random.Generator, leaves: int = 1500) -> Mesh:
    """Build a cone of twigs that begins low over the ground, as firs and young trees do."""
    trunk = meshes.tube((0, 0, -0.3), (0, 0, 0.9 * height_m), (0.1, 0.03), Slot.TRUNK, 6)
    level = 1 - np.sqrt(rng.uniform(0, 1, leaves))
    turn = rng.uniform(0, 2 * np.pi, leaves)
    outward = np.stack([np.cos(turn), np.sin(turn), np.full(leaves, 0.3)], axis=1)
    reach = rng.uniform(0.18, 0.30) * height_m * (1 - level) * rng.uniform(0.6, 1.0, leaves)
    centres = outward * reach[:, None]
    centres[:, 2] = (0.06 + 0.94 * level) * height_m - 0.15 * reach
    return meshes.merge([trunk, _leaf_cards(centres, outward, 0.07 + 0.006 * height_m, rng)])


def bush(rng: np.random.Generator, leaves: int = 360) -> Mesh:
    """Build a bush of some lobes, 1 m high and about as wide, to be stretched to its size."""
    lobes = int(rng.integers(2, 6))
    middles = rng.uniform([-0.3, -0.3, 0.25], [0.3, 0.3, 0.55], (lobes, 3))
    radii = rng.uniform(0.2, 0.42, (lobes, 3))
    middles[0], radii[0] = (0, 0, 0.3), (0.45, 0.45, 0.32)
    of = rng.integers(lobes, size=leaves)
    unit = rng.normal(size=(leaves, 3))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    depth = rng.uniform(0.55, 1.0, (leaves, 1)) ** 0.5
    centres = middles[of] + unit * radii[of] * depth
    centres[:, 2] = np.abs(centres[:, 2])
    return _leaf_cards(centres, unit, 0.052, rng)


def tuft(rng: np.random.Generator, blades: int = 80) -> Mesh:
    """Build a patch of tall grass 1 m across and 1 m high, to be stretched to its size."""
    feet = np.column_stack([rng.normal(0, 0.28, (blades, 2)), np.zeros(blades)])
    tips = feet + np.column_stack([rng.normal(0, 0.16, (blades, 2)), rng.uniform(0.4, 1.0, blades)])
    across = 0.03 * np.column_stack([rng.normal(size=(blades, 2)), np.zeros(blades)])
    corners = np.stack([feet - across, feet + across, tips], axis=1)
    numbers = np.arange(3 * blades).reshape(-1, 3)
    return meshes.make(corners.reshape(-1, 3), numbers, Slot.LEAVES)
