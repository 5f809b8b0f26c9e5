"""Bicycles and motorcycles without riders.

Origin on the ground below the middle, x forward, y left, z up.
"""

from functools import lru_cache

import numpy as np

from data.synthetic import meshes
from data.synthetic.materials import Slot
from data.synthetic.meshes import Mesh
from perception.types import Float64


def _wheel(centre_m: Float64, radius_m: float, tyre_m: float = 0.022) -> Mesh:
    """Build a tyre of some thickness, from its middle outwards, and a few spokes."""
    turn = np.linspace(0, 2 * np.pi, 25)[:, None]
    around = np.linspace(0, 2 * np.pi, 7)[None]
    reach = radius_m + tyre_m * (np.cos(around) - 1)
    ring = np.stack(
        np.broadcast_arrays(
            reach * np.cos(turn), tyre_m * np.sin(around) + 0 * turn, reach * np.sin(turn)
        ),
        axis=-1,
    )
    tyre = meshes.smooth(meshes.grid(centre_m + ring, Slot.TYRE))
    angles = np.arange(6) * np.pi / 6
    tips = (radius_m - 0.02) * np.stack([np.cos(angles), 0 * angles, np.sin(angles)], axis=1)
    spokes = [
        meshes.tube(centre_m - tip, centre_m + tip, (0.004, 0.004), Slot.RIM, 4) for tip in tips
    ]
    return meshes.merge([tyre, *spokes])


@lru_cache
def bicycle() -> Mesh:
    """Build a bicycle."""
    rear, front = np.array([-0.52, 0, 0.34]), np.array([0.55, 0, 0.34])
    crank, seat, head = (
        np.array([-0.08, 0, 0.30]),
        np.array([-0.25, 0, 0.90]),
        np.array([0.40, 0, 0.92]),
    )
    lines = [(rear, crank), (crank, seat), (seat - np.array([0, 0, 0.15]), head), (crank, head - np.array([0, 0, 0.12])),
             (rear, seat - np.array([0, 0, 0.12])), (front, head)]  # fmt: skip
    tubes = [meshes.tube(*line, (0.018, 0.018), Slot.BICYCLE, 6) for line in lines]
    stem = head + np.array([0.02, 0, 0.10])
    parts = [
        *tubes,
        meshes.tube(head, stem, (0.015, 0.015), Slot.BICYCLE, 6),
        meshes.tube(
            stem - np.array([0, 0.28, 0]),
            stem + np.array([0, 0.28, 0]),
            (0.014, 0.014),
            Slot.BICYCLE,
            6,
        ),
        meshes.ellipsoid(seat + np.array([0.0, 0, 0.02]), (0.13, 0.07, 0.035), Slot.TRIM),
        _wheel(rear, 0.34),
        _wheel(front, 0.34),
    ]
    return meshes.merge(parts)


@lru_cache
def motorcycle() -> Mesh:
    """Build a motorcycle: engine and tank between two broad wheels."""
    rear, front = np.array([-0.70, 0, 0.31]), np.array([0.72, 0, 0.31])
    head, tail = np.array([0.45, 0, 0.92]), np.array([-0.95, 0, 0.72])
    return meshes.merge(
        [
            _wheel(rear, 0.31, 0.07),
            _wheel(front, 0.31, 0.055),
            *_fork(front, head, 0.09, 0.025),
            *_handlebar(head + np.array([-0.05, 0, 0.12]), 0.37),
            meshes.tube(rear, (-0.15, 0, 0.45), (0.05, 0.05), Slot.METAL, 6),
            meshes.box((-0.22, -0.17, 0.20), (0.28, 0.17, 0.55), Slot.METAL),
            meshes.ellipsoid((0.16, 0, 0.76), (0.30, 0.16, 0.15), Slot.PAINT, 10),
            meshes.ellipsoid((-0.42, 0, 0.74), (0.42, 0.13, 0.07), Slot.TRIM, 10),
            meshes.tube((-0.5, 0, 0.68), tail, (0.09, 0.05), Slot.PAINT, 8),
            meshes.tube((0.1, -0.16, 0.25), (-0.85, -0.17, 0.38), (0.04, 0.06), Slot.RIM),
            *_lamp(head + np.array([0.08, 0, -0.06]), Slot.TRIM),
            *_rear_lights(tail),
        ]
    )


@lru_cache
def scooter() -> Mesh:
    """Build a motor scooter: a shield before the legs, a body below the seat, small wheels."""
    rear, front = np.array([-0.62, 0, 0.22]), np.array([0.63, 0, 0.22])
    head, tail = np.array([0.42, 0, 0.98]), np.array([-0.86, 0, 0.66])
    return meshes.merge(
        [
            _wheel(rear, 0.22, 0.06),
            _wheel(front, 0.22, 0.06),
            *_fork(front, head, 0.06, 0.03),
            *_handlebar(head + np.array([-0.03, 0, 0.10]), 0.34),
            _shield(),
            meshes.box((-0.35, -0.17, 0.22), (0.40, 0.17, 0.29), Slot.TRIM),
            meshes.ellipsoid((-0.48, 0, 0.50), (0.40, 0.20, 0.24), Slot.PAINT, 12),
            meshes.ellipsoid((-0.40, 0, 0.76), (0.40, 0.15, 0.06), Slot.TRIM, 10),
            meshes.ellipsoid(front + np.array([0, 0, 0.16]), (0.20, 0.08, 0.09), Slot.PAINT, 10),
            *_lamp(head + np.array([0.02, 0, 0.0]), Slot.PAINT),
            *_rear_lights(tail),
        ]
    )


def _fork(axle_m: Float64, head_m: Float64, half_m: float, radius_m: float) -> list[Mesh]:
    """Build the two legs of a front fork."""
    return [
        meshes.tube(axle_m + beside, head_m + beside, (radius_m, radius_m), Slot.METAL, 6)
        for beside in np.array([[0, -half_m, 0], [0, half_m, 0]])
    ]


def _lamp(middle_m: Float64, slot: Slot) -> list[Mesh]:
    """Build a headlight within its housing."""
    housing = meshes.ellipsoid(middle_m, (0.11, 0.13, 0.11), slot, 10)
    glass = meshes.ellipsoid(
        middle_m + np.array([0.06, 0, 0]), (0.06, 0.085, 0.07), Slot.HEADLIGHT, 8
    )
    return [housing, glass]


def _handlebar(middle_m: Float64, half_m: float) -> list[Mesh]:
    """Build a handlebar and two mirrors on it."""
    left = np.array([0, half_m, 0])
    bar = meshes.tube(middle_m - left, middle_m + left, (0.016, 0.016), Slot.TRIM, 6)
    mirrors = [
        meshes.ellipsoid(
            middle_m + share * left + np.array([-0.02, 0, 0.15]), (0.02, 0.06, 0.04), Slot.TRIM, 6
        )
        for share in (-0.8, 0.8)
    ]
    return [bar, *mirrors]


def _shield() -> Mesh:
    """Build the curved sheet before the rider's legs."""
    y, z = np.linspace(-0.22, 0.22, 7), np.array([0.25, 0.45, 0.70, 0.92])
    x = 0.46 - 0.12 * (z[:, None] - 0.25) - 1.6 * y[None] ** 2
    return meshes.smooth(
        meshes.grid(np.stack(np.broadcast_arrays(x, y[None], z[:, None]), axis=-1), Slot.PAINT)
    )


def _rear_lights(tail_m: Float64) -> list[Mesh]:
    """Build tail light and plate."""
    x, _, z = tail_m
    light = meshes.box((x - 0.04, -0.07, z - 0.04), (x, 0.07, z + 0.03), Slot.TAILLIGHT)
    across = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    corners = np.column_stack(
        [np.full(4, x - 0.02), 0.09 - 0.18 * across[:, 0], z - 0.30 + 0.2 * across[:, 1]]
    )
    plate = meshes.textured(meshes.quads(corners[None], Slot.PLATE), across)
    return [light, plate]
