"""Cars and vans: a body lofted over cross-sections, glazed cabin, wheels, lights and plates.

Origin at the centre of the footprint on the road, x forward, y left, z up.

                  roof_front
         roof_rear ____________
              ___/  cabin      \\___
     tail ___/                     \\____bonnet
         |  _                      _    \\nose
         |_/ \\____________________/ \\____|
          rear wheel            front wheel
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from data.synthetic import meshes
from data.synthetic.materials import Slot
from data.synthetic.meshes import Mesh
from perception.types import Bool, Float64, UInt8


class BodyStyle(Enum):
    """How a vehicle is cut."""

    HATCHBACK = "hatchback"
    SALOON = "saloon"
    ESTATE = "estate"
    SUV = "suv"
    MINIVAN = "minivan"
    PANEL_VAN = "panel van"


@dataclass(frozen=True)
class VehicleDesign:
    """Measures of one vehicle in metres; `_ahead` counts back from the nose, `_back` from the tail.

    Attributes:
        style: how it is cut.
        length_m: bumper to bumper.
        width_m: without mirrors.
        height_m: road to roof.
        belt_m: height of the window sills.
        bonnet_m: height of the bonnet at the windscreen.
        nose_m: height of the bonnet's front edge.
        tail_m: height of the boot lid, or of the rear window's lower edge.
        screen_ahead_m: foot of the windscreen.
        roof_ahead_m: front edge of the roof.
        roof_back_m: rear edge of the roof.
        screen_back_m: foot of the rear window.
        roof_width: roof's share of the width.
        wheel_m: wheel radius.
        clearance_m: road to sill.
        has_rear_windows: behind the front doors.
    """

    style: BodyStyle
    length_m: float
    width_m: float
    height_m: float
    belt_m: float
    bonnet_m: float
    nose_m: float
    tail_m: float
    screen_ahead_m: float
    roof_ahead_m: float
    roof_back_m: float
    screen_back_m: float
    roof_width: float = 0.74
    wheel_m: float = 0.31
    clearance_m: float = 0.20
    has_rear_windows: bool = True

    @property
    def size_m(self) -> tuple[float, float, float]:
        """Length, width, height."""
        return self.length_m, self.width_m, self.height_m

    @property
    def axles_m(self) -> tuple[float, float]:
        """Positions of the front and the rear axle along x."""
        return (
            self.length_m / 2 - 0.19 * self.length_m - 0.02,
            -self.length_m / 2 + 0.17 * self.length_m + 0.02,
        )


_DESIGNS = {
    # style: length width height belt bonnet nose tail | screen roof_front roof_back screen_back
    BodyStyle.HATCHBACK: (3.95, 1.70, 1.47, 0.93, 0.95, 0.72, 0.96, 0.98, 1.62, 0.62, 0.16),
    BodyStyle.SALOON: (4.55, 1.78, 1.44, 0.92, 0.93, 0.70, 0.99, 1.20, 1.95, 1.45, 0.72),
    BodyStyle.ESTATE: (4.55, 1.77, 1.48, 0.92, 0.94, 0.71, 0.97, 1.18, 1.92, 0.52, 0.14),
    BodyStyle.SUV: (4.45, 1.83, 1.70, 1.06, 1.08, 0.88, 1.10, 1.12, 1.72, 0.50, 0.16),
    BodyStyle.MINIVAN: (4.55, 1.82, 1.85, 1.02, 1.06, 0.82, 1.08, 0.82, 1.70, 0.28, 0.10),
    BodyStyle.PANEL_VAN: (5.20, 1.95, 2.10, 1.15, 1.20, 0.92, 1.15, 0.72, 1.55, 0.10, 0.05),
}
_TALL = (BodyStyle.MINIVAN, BodyStyle.PANEL_VAN)


def draw_design(style: BodyStyle, rng: np.random.Generator) -> VehicleDesign:
    """Draw a vehicle of one style, its measures a few per cent around the typical ones."""
    values = np.array(_DESIGNS[style])
    values[0] *= rng.uniform(0.94, 1.06)
    values[1] *= rng.uniform(0.97, 1.03)
    values[2:7] *= rng.uniform(0.97, 1.03)
    values[2] *= rng.uniform(0.98, 1.03)
    values[7:11] *= rng.uniform(0.9, 1.1)
    is_tall = style in _TALL
    return VehicleDesign(
        style,
        *(float(value) for value in values),
        roof_width=0.86 if is_tall else float(rng.uniform(0.70, 0.78)),
        wheel_m=float(
            rng.uniform(0.34, 0.37) if style is BodyStyle.SUV else rng.uniform(0.29, 0.33)
        ),
        clearance_m=0.26 if style is BodyStyle.SUV else 0.19,
        has_rear_windows=style is not BodyStyle.PANEL_VAN,
    )


def build(design: VehicleDesign) -> Mesh:
    """Build the whole vehicle."""
    return meshes.merge(
        [_body(design), *_wheels(design), *_plates(design), *_mirrors(design), *_interior(design)]
    )


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
    ]
    x = np.unique(np.round(np.concatenate(marks), 3))
    return x[np.concatenate([[True], np.diff(x) > 0.008])]


def _pillars(design: VehicleDesign) -> Float64:
    """Return (P, 2) x at both edges of the pillars between the side windows."""
    half = design.length_m / 2
    front, rear = half - design.roof_ahead_m, -half + design.roof_back_m
    middle = (
        front - 0.42 * (front - rear) if design.style is not BodyStyle.PANEL_VAN else front - 0.75
    )
    centres = np.array([middle, rear + 0.22 * (middle - rear)])
    return centres[:, None] + np.array([-0.05, 0.05])


def _section(design: VehicleDesign, x: Float64) -> tuple[Float64, Float64]:
    """Return (K, R) half-widths and heights of each cross-section, underbody to roof centre."""
    half, width = design.length_m / 2, design.width_m / 2
    top = _outline(design, x)
    belt = np.minimum(design.belt_m + 0.015 * (half - x) / design.length_m, top - 0.025)
    ends = np.clip((0.65 - (half - np.abs(x))) / 0.65, 0, 1)
    strength = 0.10 if design.style in _TALL else 0.17
    half_width = width * (1 - strength * ends**2.5)
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
    roof = design.roof_width * width * (1 - 0.5 * strength * ends**2)
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
    """Return the (K,) height of the body's top seen from the side."""
    half, height = design.length_m / 2, design.height_m
    roof_front, roof_rear = half - design.roof_ahead_m, -half + design.roof_back_m
    screen, rear_screen = half - design.screen_ahead_m, -half + design.screen_back_m
    points = [
        (-half, design.tail_m - 0.09),
        (min(-half + 0.05, rear_screen - 0.01), design.tail_m - 0.01),
        (rear_screen, design.tail_m),
        (roof_rear, height - (0.05 if design.style not in _TALL else 0.02)),
        (0.6 * roof_rear + 0.4 * roof_front, height - 0.005),
        (roof_front - 0.15, height - 0.03),
        (roof_front, height - 0.07),
        (screen, design.bonnet_m),
        (half - 0.45, 0.35 * design.bonnet_m + 0.65 * design.nose_m),
        (half - 0.12, design.nose_m - 0.02),
        (half - 0.04, design.nose_m - 0.07),
        (half, design.nose_m - 0.16),
    ]
    where, what = np.array(points).T
    return np.interp(x, where, what)


def _body(design: VehicleDesign) -> Mesh:
    """Loft the body, glaze it, and close nose and tail."""
    x = _stations(design)
    half_widths, heights = _section(design, x)
    left = np.stack([np.broadcast_to(x[:, None], heights.shape), half_widths, heights], axis=-1)
    right = left[:, ::-1][:, 1:] * (1, -1, 1)
    ring = np.concatenate([left, right], axis=1)
    slots = _body_slots(design, x, heights)
    shell = meshes.grid(ring, np.concatenate([slots, slots[:, ::-1]], axis=1))
    caps = [_cap(design, ring[row, 1:10], sign) for row, sign in ((0, -1), (-1, 1))]
    return meshes.smooth(meshes.merge([shell, *caps]), np.radians(38))


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
    slots[_is_pillar(design, middle) & (ring == 6)] = Slot.TRIM
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


def _is_pillar(design: VehicleDesign, x: Float64) -> Bool:
    edges = _pillars(design)
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
        slots[1:2, 2:-2] = Slot.TRIM  # air intake
        slots[3:4, 3:-3] = Slot.TRIM  # grille
        slots[3:5, [0, 1, 2, -3, -2, -1]] = Slot.HEADLIGHT
    else:
        slots[3:5, [0, 1, -2, -1]] = Slot.TAILLIGHT
        slots[1:2, 1:-1] = Slot.TRIM
    return meshes.grid(
        points if sign < 0 else points[:, ::-1], slots if sign < 0 else slots[:, ::-1]
    )


def _wheels(design: VehicleDesign) -> list[Mesh]:
    """Build four wheels with rims of five spokes."""
    radius, sides = design.wheel_m, 20
    turn = np.linspace(0, 2 * np.pi, sides + 1)
    # Outer face from the hub outwards, tread, inner face.
    radii = radius * np.array([0, 0.2, 0.62, 0.68, 0.97, 1.0, 1.0, 0.97, 0])
    depth = np.array([0.0, 0.0, 0.02, 0.0, 0.0, 0.02, 0.17, 0.20, 0.20])
    spokes = np.where(np.arange(sides) % 4 < 2, Slot.RIM, Slot.TRIM)
    ring_slots = [Slot.RIM, spokes, Slot.RIM, *[Slot.TYRE] * 5]
    slots = np.stack([np.broadcast_to(slot, sides) for slot in ring_slots])
    found = []
    for axle in design.axles_m:
        for side in (1, -1):
            outer = design.width_m / 2 - 0.025
            points = np.stack(
                np.broadcast_arrays(
                    axle + radii[:, None] * np.cos(turn),
                    side * (outer - depth)[:, None],
                    radius + radii[:, None] * np.sin(turn),
                ),
                axis=-1,
            )
            found.append(meshes.smooth(meshes.grid(points, slots), np.radians(40)))
    return found


def _plates(design: VehicleDesign) -> list[Mesh]:
    """Build the number plates, a centimetre before the bumpers."""
    half = design.length_m / 2
    rear_z = 0.62 if design.style is not BodyStyle.PANEL_VAN else 0.75
    return [
        meshes.box((half - 0.02, -0.26, 0.40), (half + 0.003, 0.26, 0.51), Slot.PLATE),
        meshes.box((-half - 0.003, -0.26, rear_z), (-half + 0.02, 0.26, rear_z + 0.11), Slot.PLATE),
    ]


def _mirrors(design: VehicleDesign) -> list[Mesh]:
    x = design.length_m / 2 - design.screen_ahead_m - 0.38
    y, z = design.width_m / 2 + 0.03, design.belt_m + 0.07
    return [meshes.ellipsoid((x, side * y, z), (0.06, 0.10, 0.075), Slot.PAINT) for side in (1, -1)]


def _interior(design: VehicleDesign) -> list[Mesh]:
    """Build seats and floor, which a laser sees through the windows."""
    half, width = design.length_m / 2, design.width_m / 2 - 0.2
    front = half - design.roof_ahead_m - 0.35
    rear = max(front - 0.95, -half + 0.5)
    belt, seats = design.belt_m, []
    for x in (front, rear):
        for side in (1, -1):
            y = sorted((side * 0.12, side * (width - 0.08)))
            seats.append(meshes.box((x - 0.14, y[0], 0.35), (x, y[1], belt + 0.12), Slot.INTERIOR))
            head = (x - 0.10, side * 0.36, belt + 0.24)
            seats.append(meshes.ellipsoid(head, (0.06, 0.13, 0.10), Slot.INTERIOR))
    floor = meshes.box((-half + 0.5, -width, 0.30), (half - 0.9, width, 0.38), Slot.INTERIOR)
    return [floor, *seats]
