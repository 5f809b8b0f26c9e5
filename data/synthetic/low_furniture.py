"""Low street furniture, as wide and as high as people: signs, beacons, bollards, meters, bins, pillars, plants.

All stands at the origin, its face towards -x, as what traffic comes towards.
"""

from collections.abc import Callable

import numpy as np

from data.synthetic import furniture, meshes, vegetation
from data.synthetic.materials import Slot
from data.synthetic.meshes import Mesh
from perception.geometry import se3
from perception.types import Float32, Float64

_Build = Callable[[np.random.Generator], Mesh]


def keep_right_sign(rng: np.random.Generator) -> Mesh:
    """Build a round sign, its middle 0.7 to 1.5 m high, on a thin tube or a broad post, some before a mast."""
    middle_m, size = float(rng.uniform(0.7, 1.5)), float(rng.uniform(0.18, 0.34))
    turn = np.linspace(0, 2 * np.pi, 17)
    rim = size * np.stack([0 * turn, np.cos(turn), np.sin(turn)], axis=1)
    half_m = float(rng.uniform(0.025, 0.16))
    if rng.random() < 0.5:
        post = meshes.tube((0, 0, -0.2), (0, 0, middle_m), (half_m, half_m), Slot.PANEL)
    else:
        post = meshes.box((-0.05, -half_m, -0.2), (0.05, half_m, middle_m), Slot.PANEL)
        half_m = 0.05
    plate = furniture.sign_plate(rim, np.array([-half_m - 0.02, 0, middle_m]), size)
    parts = [post, *plate]
    if rng.random() < 0.4:
        sleeve_m = half_m + 0.01
        parts.append(meshes.tube((0, 0, 0.3), (0, 0, 0.5), (sleeve_m, sleeve_m), Slot.SIGN))
    if rng.random() < 0.3:
        mast_m, x_m = float(rng.uniform(0.04, 0.11)), float(rng.uniform(0.2, 0.7))
        parts.append(meshes.tube((x_m, 0, -0.2), (x_m, 0, 6.0), (mast_m, mast_m), Slot.METAL))
    return meshes.merge(parts)


def beacon(rng: np.random.Generator) -> Mesh:
    """Build a striped board with or without a foot, or a lit body with a sign on its face."""
    height_m = float(rng.uniform(0.7, 1.4))
    if rng.random() < 0.4:
        return furniture.beacon(height_m)
    half_m, depth_m = rng.uniform([0.1, 0.04], [0.24, 0.16]).tolist()
    body = meshes.box((-depth_m, -half_m, -0.1), (depth_m, half_m, height_m), Slot.PANEL)
    face = meshes.box(
        (-depth_m - 0.01, -0.8 * half_m, 0.45 * height_m),
        (-depth_m, 0.8 * half_m, 0.95 * height_m),
        Slot.SIGN,
    )
    return meshes.merge([body, face])


def bollard(rng: np.random.Generator) -> Mesh:
    """Build a post of steel or stone, tapered or with a ball, some with a bright band."""
    height_m, radius_m = rng.uniform([0.45, 0.04], [1.25, 0.17]).tolist()
    slot = int(rng.choice([Slot.METAL, Slot.CONCRETE, Slot.PANEL]))
    parts = [meshes.tube((0, 0, -0.2), (0, 0, height_m), (1.1 * radius_m, radius_m), slot)]
    if rng.random() < 0.2:
        parts.append(meshes.ellipsoid((0, 0, height_m), [1.4 * radius_m] * 3, slot))
    if rng.random() < 0.4:
        band_m, wide_m = 0.85 * height_m, 1.1 * radius_m + 0.005
        parts.append(meshes.tube((0, 0, band_m - 0.1), (0, 0, band_m), (wide_m, wide_m), Slot.SIGN))
    return meshes.merge(parts)


def meter(rng: np.random.Generator) -> Mesh:
    """Build a parking meter, a letter box or a box of switches on a post."""
    low_m, radius_m, half_m = rng.uniform([0.4, 0.025, 0.09], [1.3, 0.07, 0.28]).tolist()
    high_m = low_m + float(rng.uniform(0.25, 0.7))
    post_m = high_m if rng.random() < 0.5 else float(rng.uniform(high_m, 6.0))
    return meshes.merge(
        [
            meshes.tube((0, 0, -0.2), (0, 0, post_m), (radius_m, radius_m), Slot.METAL),
            meshes.box((-0.7 * half_m, -half_m, low_m), (0.7 * half_m, half_m, high_m), Slot.PANEL),
        ]
    )


def info_pillar(rng: np.random.Generator) -> Mesh:
    """Build a stele, a ticket machine or a thin round pillar."""
    depth_m, width_m, height_m = rng.uniform([0.05, 0.14, 1.0], [0.3, 0.5, 2.4]).tolist()
    if rng.random() < 0.3:
        return meshes.tube((0, 0, -0.2), (0, 0, height_m), (width_m, width_m), Slot.PANEL, 12)
    foot_m = float(rng.choice([-0.2, 0.3, 0.6]))
    board = meshes.box((-depth_m, -width_m, foot_m), (depth_m, width_m, height_m), Slot.PANEL)
    feet = [
        meshes.tube((0, y, -0.2), (0, y, 0.7), (0.03, 0.03), Slot.METAL, 6)
        for y in (-0.8 * width_m, 0.8 * width_m)
    ]
    return meshes.merge([board, *(feet if foot_m > 0 else [])])


def column(rng: np.random.Generator) -> Mesh:
    """Build a mast or a column of steel or stone, round or square."""
    half_m, height_m = rng.uniform([0.05, 2.2], [0.3, 6.0]).tolist()
    slot = int(rng.choice([Slot.METAL, Slot.CONCRETE, Slot.PANEL]))
    if rng.random() < 0.5:
        return meshes.tube((0, 0, -0.2), (0, 0, height_m), (half_m, half_m), slot)
    return meshes.box((-half_m, -half_m, -0.2), (half_m, half_m, height_m), slot)


def hydrant(rng: np.random.Generator) -> Mesh:
    """Build a hydrant: a body with a cap, and an outlet to each side."""
    height_m, radius_m = rng.uniform([0.5, 0.07], [1.0, 0.16]).tolist()
    level_m = 0.65 * height_m
    return meshes.merge(
        [
            meshes.tube((0, 0, -0.2), (0, 0, 0.9 * height_m), (radius_m, radius_m), Slot.PANEL),
            meshes.ellipsoid((0, 0, 0.9 * height_m), [1.2 * radius_m] * 3, Slot.PANEL),
            meshes.tube(
                (0, -2 * radius_m, level_m), (0, 2 * radius_m, level_m), (0.06, 0.06), Slot.PANEL, 6
            ),
        ]
    )


def litter_bin(rng: np.random.Generator) -> Mesh:
    """Build a round or square bin on the ground, or one that hangs on a post."""
    radius_m, height_m = rng.uniform([0.16, 0.6], [0.4, 1.3]).tolist()
    if rng.random() < 0.4:
        low_m = float(rng.uniform(0.3, 0.7))
        body = meshes.tube(
            (-0.1, 0, low_m), (-0.1, 0, low_m + 0.5), (radius_m, radius_m), Slot.PANEL
        )
        return meshes.merge([body, bollard(rng)])
    if rng.random() < 0.5:
        return meshes.tube((0, 0, -0.1), (0, 0, height_m), (0.85 * radius_m, radius_m), Slot.PANEL)
    return meshes.box(
        (-radius_m, -0.8 * radius_m, -0.1), (radius_m, 0.8 * radius_m, height_m), Slot.PANEL
    )


def sapling(rng: np.random.Generator) -> Mesh:
    """Build a young tree: a thin stem, some with stakes, a small crown or none, bushes at some feet."""
    height_m, radius_m = rng.uniform([1.6, 0.015], [4.0, 0.09]).tolist()
    parts = [meshes.tube((0, 0, -0.3), (0, 0, height_m), (radius_m, 0.5 * radius_m), Slot.TRUNK, 6)]
    if rng.random() < 0.4:
        parts += [
            meshes.tube((0, y, -0.2), (0, y, 1.6), (0.035, 0.035), Slot.TRUNK, 6)
            for y in (-0.3, 0.3)
        ]
    if rng.random() < 0.8:
        parts.append(_bush([*rng.uniform(0.5, 1.4, 2), height_m / 2], 0.6 * height_m, rng))
    if rng.random() < 0.4:
        parts.append(_bush(rng.uniform([0.4, 0.4, 0.4], [1.0, 1.0, 1.8]), 0.0, rng))
    return meshes.merge(parts)


def _bush(size_m: Float64 | list[float], low_m: float, rng: np.random.Generator) -> Mesh:
    """Build a bush of a size, its lower end at a height."""
    lift = se3.from_euler(0.0, 0.0, 0.0, np.array([0.0, 0.0, low_m]))
    return meshes.moved(meshes.stretched(vegetation.bush(rng, 200), size_m), lift)


def shrub(rng: np.random.Generator) -> Mesh:
    """Build a narrow hedge across the face, a column of leaves, or a bush in a tub."""
    draw = rng.random()
    width_m, height_m = rng.uniform([0.4, 0.5], [0.8, 2.1]).tolist()
    if draw < 0.5:
        length_m = float(rng.uniform(0.8, 6.0))
        return vegetation.trimmed(vegetation.block([width_m, length_m, height_m]), rng)
    if draw < 0.8:
        return meshes.stretched(vegetation.bush(rng), (width_m, width_m, height_m))
    tub = meshes.box((-0.3, -0.3, -0.1), (0.3, 0.3, 0.5), Slot.CONCRETE)
    return meshes.merge([tub, _bush([0.7, 0.7, height_m / 1.5], 0.45, rng)])


# How often each is drawn, and how many stand in a row at most.
KINDS: tuple[tuple[_Build, float, int], ...] = (
    (keep_right_sign, 0.16, 2),
    (beacon, 0.12, 6),
    (bollard, 0.18, 9),
    (meter, 0.10, 2),
    (info_pillar, 0.08, 1),
    (column, 0.06, 2),
    (hydrant, 0.03, 1),
    (litter_bin, 0.07, 2),
    (sapling, 0.08, 4),
    (shrub, 0.12, 3),
)  # fmt: skip


def low_palette(rng: np.random.Generator) -> Float32:
    """Draw the colours of a row: panels dull to bright, faces of signs that return the beam to the sensor."""
    appearance = furniture.panel_palette(rng)
    appearance[Slot.PANEL, 3] = rng.uniform(0.05, 0.95)
    appearance[Slot.METAL, 3] = rng.uniform(0.1, 0.9)
    appearance[Slot.SIGN] = (
        *rng.uniform([0.03, 0.1, 0.1], [0.75, 0.75, 0.75]),
        rng.uniform(0.6, 1),
    )
    appearance[Slot.LEAVES] = vegetation.foliage_palette(rng)[Slot.LEAVES]
    return appearance
