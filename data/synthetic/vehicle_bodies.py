"""The painted body of a vehicle: lofted over cross-sections, glazed, with lights and door gaps.

Each cross-section is a row of points from the middle of the underbody over sill, waist, shoulder and
window to the middle of the roof; rings of cells between them carry the materials.
"""

import numpy as np

from data.synthetic import meshes
from data.synthetic.materials import Slot
from data.synthetic.meshes import Mesh
from data.synthetic.vehicle_designs import VehicleDesign
from perception.types import Bool, Float32, Float64, UInt8

# Texture coordinates are metres along the sides of a body, or END_U plus metres across its ends; and shares of the
# height from sill (0) to waist (1), shifted by SILL_V and by VARIANT_V for each variant of the trim.
END_U, SILL_V, VARIANT_V, VARIANTS = 50.0, 2.0, 10.0, 8


def _stations(design: VehicleDesign) -> Float64:
    """Return the (K,) positions along x of the cross-sections, tail to nose."""
    half = design.length_m / 2
    arch = (design.wheel_m + 0.07) * np.array([-1.02, -0.97, -0.8, -0.5, 0, 0.5, 0.8, 0.97, 1.02])
    screen, roof = half - design.screen_ahead_m, half - design.roof_ahead_m
    rear_roof, rear_screen = -half + design.roof_back_m, -half + design.screen_back_m
    marks = [
        half - np.array([0, 0.02, 0.06, 0.14, 0.28, 0.45]),
        -half + np.array([0, 0.015, 0.05, 0.12, 0.25, 0.42]),
        *(axle + arch for axle in design.axles_m),
        np.linspace(screen, roof, 5),
        np.linspace(roof, rear_roof, 7),
        np.linspace(rear_screen, rear_roof, 4),
        _pillars(design).ravel(),
        _seams(design).ravel(),
    ]
    x = np.unique(np.round(np.concatenate(marks), 3))
    return np.asarray(x[np.concatenate([[True], np.diff(x) > 0.008])])


def _pillars(design: VehicleDesign) -> Float64:
    """Return (P, 2) x at both edges of the pillars between the side windows."""
    half = design.length_m / 2
    front, rear = half - design.roof_ahead_m, -half + design.roof_back_m
    middle = front - 0.42 * (front - rear) if design.has_rear_windows else front - 0.75
    centres = np.array([middle, rear + 0.22 * (middle - rear)])
    return np.asarray(centres[:, None] + (-0.05, 0.05))


def _seams(design: VehicleDesign) -> Float64:
    """Return (S, 2) x at both edges of the gaps around the doors."""
    half = design.length_m / 2
    front_axle, rear_axle = design.axles_m
    arch = design.wheel_m + 0.12
    fore = min(half - design.screen_ahead_m - 0.15, front_axle - arch)
    middle = _pillars(design)[0].mean()
    aft = rear_axle + arch
    return np.asarray(np.array([fore, middle, aft])[:, None] + (-0.007, 0.007))


def _section(design: VehicleDesign, x: Float64) -> tuple[Float64, Float64]:
    """Return (K, R) half-widths and heights of each cross-section, underbody to roof centre."""
    half, width = design.length_m / 2, design.width_m / 2
    top = _outline(design, x)
    belt = np.minimum(design.belt_m + 0.015 * (half - x) / design.length_m, top - 0.025)
    ends = np.clip((0.65 - (half - np.abs(x))) / 0.65, 0, 1)
    taper = 0.10 if design.is_tall else 0.17
    half_width = width * (1 - taper * ends**2.5)
    bottom = design.clearance_m + 0.10 * np.clip((0.3 - (half - np.abs(x))) / 0.3, 0, 1) ** 2
    arch = np.zeros_like(x)
    for axle in design.axles_m:
        reach = (design.wheel_m + 0.07) ** 2 - (x - axle) ** 2
        arch = np.maximum(
            arch, np.where(reach > 0, design.wheel_m + np.sqrt(np.maximum(reach, 0)), 0)
        )
    sill = np.maximum(bottom + 0.05, arch)
    waist = np.maximum(bottom + 0.45 * (belt - bottom), arch + 0.03)
    shoulder = np.maximum(belt - 0.10, waist + 0.01)
    cabin = top - belt
    roof = design.roof_width * width * (1 - 0.5 * taper * ends**2)
    lean = half_width * 0.93 - roof
    crown = 0.02 + 0.02 * (cabin > 0.2)
    flat = np.ones_like(x)
    half_widths = [
        0 * flat, 0.70 * half_width, 0.955 * half_width, half_width, 0.985 * half_width,
        0.935 * half_width, 0.935 * half_width - 0.06 * lean, roof + 0.12 * lean, roof - 0.03 * flat,
        0.5 * roof, 0 * flat,
    ]  # fmt: skip
    heights = [
        bottom, bottom, sill, waist, shoulder, belt, belt + 0.08 * cabin, belt + 0.86 * cabin,
        belt + 0.985 * cabin, top + 0.6 * (crown - 0.02), top + crown - 0.02,
    ]  # fmt: skip
    return np.stack(half_widths, axis=1), np.minimum(np.stack(heights, axis=1), design.height_m)


def _outline(design: VehicleDesign, x: Float64) -> Float64:
    """Return (K,) heights of the body's outline from the side."""
    half, height = design.length_m / 2, design.height_m
    roof_front, roof_rear = half - design.roof_ahead_m, -half + design.roof_back_m
    screen, rear_screen = half - design.screen_ahead_m, -half + design.screen_back_m
    points = [
        (-half, design.tail_m - 0.09),
        (min(-half + 0.05, rear_screen - 0.01), design.tail_m - 0.01),
        (rear_screen, design.tail_m),
        (roof_rear, height - (0.05 if not design.is_tall else 0.02)),
        (0.6 * roof_rear + 0.4 * roof_front, height - 0.005),
        (roof_front - 0.15, height - 0.03),
        (roof_front, height - 0.07),
        (screen, design.bonnet_m),
        (half - 0.45, 0.25 * design.bonnet_m + 0.75 * design.nose_m),
        (half - 0.14, design.nose_m - 0.02),
        (half - 0.05, design.nose_m - 0.06),
        (half, design.nose_m - 0.14),
    ]
    where, what = np.array(points).T
    return np.asarray(np.interp(x, where, what))


def body(design: VehicleDesign) -> Mesh:
    """Loft the body, glaze it, and close nose and tail."""
    x = _stations(design)
    half_widths, heights = _section(design, x)
    left = np.stack([np.broadcast_to(x[:, None], heights.shape), half_widths, heights], axis=-1)
    right = left[:, ::-1][:, 1:] * (1, -1, 1)
    ring = np.concatenate([left, right], axis=1)
    slots = _body_slots(design, x, heights)
    shell = meshes.grid(ring, np.concatenate([slots, slots[:, ::-1]], axis=1))
    caps = [_cap(design, ring[row, 1:10], sign) for row, sign in ((0, -1), (-1, 1))]
    x, y, z = shell.vertices_m.T
    shell = _textured(design, shell, x + 0.8 * y * (z > design.belt_m + 0.02))
    caps = [_textured(design, cap, END_U + cap.vertices_m[:, 1]) for cap in caps]
    return meshes.smooth(meshes.merge([shell, *caps]), np.radians(38))


def _textured(design: VehicleDesign, mesh: Mesh, along_m: Float32) -> Mesh:
    """Lay texture coordinates over a body: metres along it, and shares of the way from sill to waist."""
    share = (mesh.vertices_m[:, 2] - design.clearance_m) / (design.belt_m - design.clearance_m)
    first = VARIANT_V * (1 + round(1000 * design.length_m) % VARIANTS)
    return meshes.textured(mesh, np.column_stack([along_m, first + SILL_V + share]))


def _body_slots(design: VehicleDesign, x: Float64, heights: Float64) -> UInt8:
    """Return (K-1, R-1) the material of each cell of the left half of the body."""
    half = design.length_m / 2
    middle = (x[1:] + x[:-1])[:, None] / 2
    ring = np.arange(heights.shape[1] - 1)[None]
    top = _outline(design, middle[:, 0])[:, None]
    cabin = top - np.minimum(design.belt_m, top)
    slots = np.full((len(x) - 1, ring.shape[1]), Slot.PAINT, np.uint8)
    slots[np.broadcast_to(ring <= 1, slots.shape)] = Slot.TRIM
    is_end = half - np.abs(middle) < 0.30
    slots[(ring == 2) & ((half - np.abs(middle)) < 0.10)] = Slot.TRIM
    slots[_is_side_glass(design, middle) & (ring == 6) & (cabin > 0.22)] = Slot.GLASS
    slots[_is_between(_pillars(design), middle) & (ring == 6)] = Slot.TRIM
    slots[_is_between(_seams(design), middle) & (ring >= 2) & (ring <= 4)] = Slot.TRIM
    screen = (middle < half - design.screen_ahead_m - 0.03) & (middle > half - design.roof_ahead_m)
    back = (middle > -half + design.screen_back_m + 0.01) & (
        middle < -half + design.roof_back_m - 0.04
    )
    slots[(screen | back & design.has_rear_windows) & (ring >= 8)] = Slot.GLASS
    slots[is_end & (middle > 0) & (ring == 4)] = Slot.HEADLIGHT
    slots[is_end & (half - np.abs(middle) < 0.18) & (middle < 0) & (ring == 4)] = Slot.TAILLIGHT
    return slots


def _is_side_glass(design: VehicleDesign, x: Float64) -> Bool:
    half = design.length_m / 2
    front = half - 0.55 * design.screen_ahead_m - 0.45 * design.roof_ahead_m
    rear = -half + design.roof_back_m + 0.02
    if not design.has_rear_windows:
        rear = half - design.roof_ahead_m - 0.75
    return np.asarray((x < front) & (x > rear))


def _is_between(edges: Float64, x: Float64) -> Bool:
    return np.asarray(((x[..., None] > edges[:, 0]) & (x[..., None] < edges[:, 1])).any(axis=-1))


def _cap(design: VehicleDesign, section: Float64, sign: int) -> Mesh:
    """Close one end: rows from the sill up, columns from right to left."""
    across = np.linspace(-1, 1, 13)
    bulge = 0.02 * sign * (1 - across**2)
    points = np.empty((len(section), len(across), 3))
    points[..., 0] = (
        np.minimum(np.abs(section[:, :1] + bulge - 0.02 * sign), design.length_m / 2) * sign
    )
    points[..., 1] = section[:, 1:2] * across
    points[..., 2] = section[:, 2:]
    slots = np.full((len(section) - 1, len(across) - 1), Slot.PAINT, np.uint8)
    slots[0] = Slot.TRIM
    if sign > 0:
        slots[1, 2:-2] = Slot.TRIM  # air intake
        slots[3:4, 3:-3] = Slot.TRIM  # grille
        slots[3:5, [0, 1, 2, -3, -2, -1]] = Slot.HEADLIGHT
    else:
        slots[3:5, [0, 1, -2, -1]] = Slot.TAILLIGHT
        if design.has_dark_bumpers:
            slots[1, 1:-1] = Slot.TRIM
    return meshes.grid(
        points if sign < 0 else points[:, ::-1], slots if sign < 0 else slots[:, ::-1]
    )
