"""Whole cars and vans: the body with its wheels, plates, mirrors and seats.

Origin at the centre of the footprint on the road, x forward, y left, z up.
"""

from collections.abc import Sequence

import numpy as np

from data.synthetic import meshes
from data.synthetic.materials import Slot
from data.synthetic.meshes import Mesh
from data.synthetic.vehicle_bodies import body
from data.synthetic.vehicle_designs import VehicleDesign


def build(design: VehicleDesign) -> Mesh:
    """Build the whole vehicle."""
    rolling = wheels(design.axles_m, design.wheel_m, design.width_m)
    return meshes.merge(
        [body(design), *rolling, *_plates(design), *_mirrors(design), *_interior(design)]
    )


def wheels(axles_m: Sequence[float], radius_m: float, width_m: float) -> list[Mesh]:
    """Build a wheel with a rim of five spokes at both ends of every axle."""
    sides = 15
    turn = np.linspace(0, 2 * np.pi, sides + 1)
    # Outer face from the hub outwards, tread, inner face.
    radii = radius_m * np.array([0, 0.2, 0.62, 0.68, 0.97, 1.0, 1.0, 0.97, 0])
    depth = np.array([0.0, 0.0, 0.02, 0.0, 0.0, 0.02, 0.17, 0.20, 0.20])
    spokes = np.where(np.arange(sides) % 3 < 2, Slot.RIM, Slot.TRIM)
    slots = np.full((len(radii) - 1, sides), Slot.TYRE, np.uint8)
    slots[:3] = Slot.RIM
    slots[1] = spokes
    found = []
    for axle in axles_m:
        for side in (1, -1):
            outer = width_m / 2 - 0.025
            points = np.stack(
                np.broadcast_arrays(
                    axle + radii[:, None] * np.cos(turn),
                    side * (outer - depth)[:, None],
                    radius_m + radii[:, None] * np.sin(turn),
                ),
                axis=-1,
            )
            found.append(meshes.smooth(meshes.grid(points, slots), np.radians(40)))
    return found


def _plates(design: VehicleDesign) -> list[Mesh]:
    """Build the number plates, a hair before the bumpers."""
    half = design.length_m / 2
    rear_z = 0.62 if design.has_rear_windows else 0.75
    across, up = np.array([-0.26, 0.26, 0.26, -0.26]), np.array([0.0, 0.0, 0.11, 0.11])
    found = []
    for x, z in ((half + 0.003, 0.38), (-half - 0.003, rear_z)):
        corners = np.stack([np.full(4, x), np.sign(x) * across, z + up], axis=1)
        face = meshes.quads(corners[None], Slot.PLATE)
        found.append(meshes.textured(face, np.stack([across / 0.52 + 0.5, up / 0.11], axis=1)))
    return found


def _mirrors(design: VehicleDesign) -> list[Mesh]:
    x = design.length_m / 2 - design.screen_ahead_m - 0.38
    y, z = design.width_m / 2 + 0.03, design.belt_m + 0.07
    return [meshes.ellipsoid((x, side * y, z), (0.06, 0.10, 0.075), Slot.PAINT) for side in (1, -1)]


def _interior(design: VehicleDesign) -> list[Mesh]:
    """Build seats and floor, which a laser reaches through the windows."""
    half, width = design.length_m / 2, design.width_m / 2 - 0.2
    front = half - design.roof_ahead_m - 0.35
    rear = max(front - 0.95, -half + 0.5)
    belt, seats = design.belt_m, []
    for x in (front, rear) if design.has_rear_seats else (front,):
        for side in (1, -1):
            y = sorted((side * 0.12, side * (width - 0.08)))
            seats.append(meshes.box((x - 0.14, y[0], 0.35), (x, y[1], belt + 0.12), Slot.INTERIOR))
            head = (x - 0.10, side * 0.36, belt + 0.24)
            seats.append(meshes.ellipsoid(head, (0.06, 0.13, 0.10), Slot.INTERIOR))
    floor = meshes.box((-half + 0.5, -width, 0.30), (half - 0.9, width, 0.38), Slot.INTERIOR)
    return [floor, *seats]
