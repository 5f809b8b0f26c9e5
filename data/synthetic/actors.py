"""Actors of the traffic: vehicles, cyclists and pedestrians, parked or moving."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from data.synthetic import heavy_vehicles, people, vehicles
from data.synthetic.heavy_vehicles import HeavyKind
from data.synthetic.materials import (
    CARGO_PAINTS,
    SemanticClass,
    Slot,
    palette,
    random_clothes,
    random_paint,
)
from data.synthetic.meshes import Mesh
from data.synthetic.motion import Path, upright_poses, vehicle_poses
from data.synthetic.people import Figure, Luggage
from data.synthetic.road import Road
from data.synthetic.vehicle_designs import BodyStyle, draw_design
from perception.types import Float32, Float64

_HITCH_M = 0.6  # from a vehicle to its trailer
MOVING_M_S = 0.1  # slower is standing

_CLASS_OF = {
    "Car": SemanticClass.CAR,
    "Van": SemanticClass.OTHER_VEHICLE,
    "Truck": SemanticClass.TRUCK,
    "Tram": SemanticClass.ON_RAILS,
    "Misc": SemanticClass.OTHER_VEHICLE,
    "Pedestrian": SemanticClass.PERSON,
    "Cyclist": SemanticClass.BICYCLIST,
    "Motorcycle": SemanticClass.MOTORCYCLIST,
}


@dataclass(frozen=True)
class Body:
    """A shape shared by several actors.

    Attributes:
        kind: Class name of KITTI.
        size_m: Length, width and height of its label in metres.
        poses: Meshes of one cycle of steps or pedal turns; a single one for a rigid body.
        cycle_m: Distance covered in a cycle in metres.
        category: Class by a finer table, in which buses, trailers and motorcycles are classes; else that
            of KITTI, where riders of motorcycles are cyclists.
        trailer: What it tows, None for nothing.
    """

    kind: str
    size_m: tuple[float, float, float]
    poses: tuple[Mesh, ...]
    cycle_m: float = 1.0
    category: str = ""
    trailer: "Body | None" = None

    def __post_init__(self) -> None:
        """Take the class of KITTI where no finer one is given."""
        object.__setattr__(self, "category", self.category or self.kind)

    @property
    def towed_m(self) -> float:
        """Distance from its middle to that of its trailer in metres, 0 without one."""
        if self.trailer is None:
            return 0.0
        return _HITCH_M + (self.size_m[0] + self.trailer.size_m[0]) / 2

    @property
    def lane_m(self) -> float:
        """Length of the lane that it takes in metres, as far before its middle as behind it."""
        if self.trailer is None:
            return self.size_m[0]
        return 2 * self.towed_m + self.trailer.size_m[0]

    @property
    def semantic(self) -> int:
        """Class of its points."""
        return int(_CLASS_OF.get(self.category, _CLASS_OF[self.kind]))

    @property
    def is_person(self) -> bool:
        """Whether it stays upright on slopes."""
        return self.kind in ("Pedestrian", "Cyclist")


@dataclass(frozen=True)
class Actor:
    """One participant.

    Attributes:
        track_id: Track id, the same in all frames.
        body: Shape of the actor.
        appearance: (slots, 4) palette of colours and reflectances.
        path: Path of the actor; None for a parked one.
        world_SE3_parked: (4, 4) pose of a parked actor.
        is_steered: Whether it faces along its path, as a turning vehicle does, and not along the road.
    """

    track_id: int
    body: Body
    appearance: Float32
    path: Path | None = None
    world_SE3_parked: Float64 = field(default_factory=lambda: np.eye(4))
    is_steered: bool = False

    def pose(self, road: Road, time_s: float) -> Float64:
        """Return (4, 4) world_SE3_actor."""
        if self.path is None:
            return self.world_SE3_parked
        is_upright = self.body.is_person or self.is_steered
        poses = upright_poses if is_upright else vehicle_poses
        return np.asarray(poses(road, self.path, np.array([time_s]))[0])

    def velocity_m_s(self, road: Road, time_s: float) -> Float64:
        """Return (3,) in world axes."""
        if self.path is None:
            return np.zeros(3)
        s, side = self.path.at(np.array([time_s - 0.05, time_s + 0.05]))
        before, after = road.place(s, side)
        return np.asarray((after - before) / 0.1)

    def phase(self, time_s: float) -> int:
        """Return which of the body's poses it is in."""
        count = len(self.body.poses)
        if self.path is None or count == 1:
            return 0
        return int(self.path.travelled_m(time_s) / self.body.cycle_m * count) % count


_COMMON_STYLES = [
    BodyStyle.HATCHBACK, BodyStyle.ESTATE, BodyStyle.SALOON, BodyStyle.HATCHBACK, BodyStyle.SUV,
    BodyStyle.MINIVAN, BodyStyle.PANEL_VAN, BodyStyle.SALOON, BodyStyle.HATCHBACK, BodyStyle.ESTATE,
]  # fmt: skip
# How many in a hundred vehicles of a mixed fleet are of a style.
_MIXED_STYLES = {
    BodyStyle.HATCHBACK: 27, BodyStyle.ESTATE: 13, BodyStyle.SALOON: 13, BodyStyle.COMPACT_MPV: 11,
    BodyStyle.CITY_CAR: 12, BodyStyle.SUV: 5, BodyStyle.LIMOUSINE: 3, BodyStyle.COUPE: 4,
    BodyStyle.OFF_ROADER: 2, BodyStyle.PICK_UP: 0.5, BodyStyle.MINIVAN: 4, BodyStyle.PANEL_VAN: 3,
    BodyStyle.SMALL_VAN: 3, BodyStyle.HIGH_VAN: 2,
}  # fmt: skip
_VAN_STYLES = [
    BodyStyle.PANEL_VAN, BodyStyle.SMALL_VAN, BodyStyle.HIGH_VAN, BodyStyle.MINIVAN,
    BodyStyle.PANEL_VAN, BodyStyle.HIGH_VAN,
]  # fmt: skip
_SIZES = (0.87, 1.0)  # of a mixed fleet's cars, old and new
_HEAVY_KINDS = [
    HeavyKind.BOX_TRUCK, HeavyKind.BUS, HeavyKind.ARTICULATED, HeavyKind.BOX_TRUCK,
    HeavyKind.FLATBED, HeavyKind.TRAILER, HeavyKind.BUS,
]  # fmt: skip

_LIGHT_TRUCKS = (HeavyKind.LIGHT_BOX, HeavyKind.LIGHT_FLATBED)
_PICK_UPS = 0.25  # share of the light trucks

_HEAVY_LABELS = {
    HeavyKind.TRAILER: "Misc", HeavyKind.SEMI_TRAILER: "Misc", HeavyKind.TRAM: "Tram",
}  # fmt: skip
_HEAVY_CATEGORIES = {
    HeavyKind.TRAILER: "Trailer", HeavyKind.SEMI_TRAILER: "Trailer", HeavyKind.BUS: "Bus",
}  # fmt: skip


def draw_vehicles(rng: np.random.Generator, count: int) -> list[Body]:
    """Draw car and van bodies of the commonest styles, in turn."""
    return [_vehicle(_COMMON_STYLES[n % len(_COMMON_STYLES)], rng) for n in range(count)]


def draw_mixed_vehicles(rng: np.random.Generator, count: int) -> list[Body]:
    """Draw car and van bodies of all styles, as often as on a street."""
    weights = np.array(list(_MIXED_STYLES.values()), float)
    styles = rng.choice(len(weights), size=count, p=weights / weights.sum())
    bodies = []
    for style in [list(_MIXED_STYLES)[number] for number in styles]:
        size = float(rng.uniform(*_SIZES))
        bodies.append(_vehicle(style, rng, 1.0 if style.is_van else size))
    return bodies


def draw_light_trucks(rng: np.random.Generator, count: int) -> list[Body]:
    """Draw trucks no longer than a van, and pick-ups, which only the finer table calls trucks."""
    bodies = []
    for number in range(count):
        if rng.random() < _PICK_UPS:
            pick_up = _vehicle(BodyStyle.PICK_UP, rng, float(rng.uniform(0.98, 1.1)))
            bodies.append(replace(pick_up, category="Truck"))
        else:
            bodies.append(draw_heavy(_LIGHT_TRUCKS[number % len(_LIGHT_TRUCKS)], rng))
    return bodies


def _vehicle(style: BodyStyle, rng: np.random.Generator, size: float = 1.0) -> Body:
    design = draw_design(style, rng, size)
    return Body("Van" if style.is_van else "Car", design.size_m, (vehicles.build(design),))


def draw_vans(rng: np.random.Generator, count: int) -> list[Body]:
    """Draw vans of all styles."""
    return [_vehicle(_VAN_STYLES[n], rng) for n in rng.integers(len(_VAN_STYLES), size=count)]


def draw_heavy_vehicles(rng: np.random.Generator, count: int) -> list[Body]:
    """Draw trucks, buses and trailers in turn, from one of them on."""
    first = int(rng.integers(len(_HEAVY_KINDS)))
    return [
        draw_heavy(_HEAVY_KINDS[(first + number) % len(_HEAVY_KINDS)], rng)
        for number in range(count)
    ]


def draw_heavy(kind: HeavyKind, rng: np.random.Generator) -> Body:
    """Draw a heavy vehicle of one kind; KITTI labels buses trucks, and trailers miscellaneous."""
    design = heavy_vehicles.draw_design(kind, rng)
    label, category = _HEAVY_LABELS.get(kind, "Truck"), _HEAVY_CATEGORIES.get(kind, "")
    return Body(label, design.size_m, (heavy_vehicles.build(design),), category=category)


def draw_pedestrians(rng: np.random.Generator, count: int) -> list[Body]:
    """Draw people of several heights, each in all poses of a step."""
    bodies = []
    for height in _heights_m(rng, 1.55, 1.92, count):
        poses = tuple(people.pedestrian(height, phase) for phase in range(people.PHASES))
        bodies.append(Body("Pedestrian", (0.85, 0.60, float(height)), poses, people.STRIDE_M))
    return bodies


def _heights_m(rng: np.random.Generator, low: float, high: float, count: int) -> list[float]:
    """Draw heights in steps of 2 cm, so that bodies are built once for many worlds."""
    return [round(float(height) / 0.02) * 0.02 for height in rng.uniform(low, high, count)]


def draw_standing_pedestrian(rng: np.random.Generator) -> Body:
    """Draw a pedestrian who does not move."""
    height = _heights_m(rng, 1.55, 1.92, 1)[0]
    mesh = people.pedestrian(height, 0, is_walking=False)
    return Body("Pedestrian", (0.55, 0.60, height), (mesh,))


# How many in a hundred pedestrians are children, and wear or carry something.
_CHILDREN, _LUGGAGE = 0.12, {
    Luggage.NOTHING: 0.4, Luggage.COAT: 0.2, Luggage.BACKPACK: 0.2, Luggage.BAG: 0.2,
}  # fmt: skip


def draw_figure(rng: np.random.Generator) -> Figure:
    """Draw a person of any age and build."""
    is_child = rng.random() < _CHILDREN
    height_m = float(rng.uniform(1.0, 1.5) if is_child else np.clip(rng.normal(1.71, 0.1), 1.5, 2))
    luggage = list(_LUGGAGE)[int(rng.choice(len(_LUGGAGE), p=list(_LUGGAGE.values())))]
    bends_rad = (float(rng.choice([0.1, 0.35, 1.5])), float(rng.choice([0.1, 0.35, 1.5])))
    return Figure(height_m, float(rng.uniform(0.88, 1.25)), luggage, bends_rad)


def draw_figures(rng: np.random.Generator, count: int) -> list[Body]:
    """Draw walking people of any age and build, each in all poses of a step."""
    bodies = []
    for figure in [draw_figure(rng) for _ in range(count)]:
        poses = tuple(figure.pose(phase) for phase in range(people.PHASES))
        stride_m = people.STRIDE_M * figure.height_m / 1.75
        bodies.append(Body("Pedestrian", _size_m(poses), poses, stride_m))
    return bodies


def draw_standing_figure(rng: np.random.Generator) -> Body:
    """Draw a person of any age and build who stands, or is caught in the middle of a step."""
    figure, phase, is_walking = draw_figure(rng), int(rng.integers(4)), rng.random() < 0.3
    poses = (figure.pose(phase, is_walking=is_walking),)
    return Body("Pedestrian", _size_m(poses), poses)


def _size_m(poses: Sequence[Mesh]) -> tuple[float, float, float]:
    """Return the size of a body in its mean pose, as annotators draw boxes of people."""
    sizes_m = np.array([np.ptp(mesh.vertices_m, axis=0) for mesh in poses])
    length, width, height = sizes_m.mean(axis=0).tolist()
    return max(length, 0.3 * height), width, height


def draw_cyclists(rng: np.random.Generator, count: int) -> list[Body]:
    """Draw cyclists of several heights, each in all poses of a pedal turn."""
    bodies = []
    for tall in _heights_m(rng, 1.62, 1.85, count):
        poses = tuple(people.cyclist(tall, phase) for phase in range(people.PHASES))
        height = float(poses[0].vertices_m[:, 2].max())
        bodies.append(Body("Cyclist", (1.80, 0.62, height), poses, people.PEDAL_M))
    return bodies


def draw_motorcyclists(rng: np.random.Generator, count: int) -> list[Body]:
    """Draw riders of motorcycles and scooters in turn."""
    bodies = []
    for number, tall in enumerate(_heights_m(rng, 1.62, 1.88, count)):
        mesh = people.motorcyclist(tall, is_scooter=number % 2 == 1)
        length, width, height = np.ptp(mesh.vertices_m, axis=0).tolist()
        bodies.append(Body("Cyclist", (length, width, height), (mesh,), category="Motorcycle"))
    return bodies


def draw_appearance(body: Body, rng: np.random.Generator) -> Float32:
    """Draw paint or clothes."""
    if body.is_person:
        appearance = random_clothes(rng)
        if body.category == "Motorcycle":
            appearance[Slot.PAINT] = random_paint(rng)
        return appearance
    paints = {Slot.PAINT: random_paint(rng)}
    if body.kind in ("Truck", "Tram", "Misc"):
        paints[Slot.CARGO] = random_paint(rng, CARGO_PAINTS)
    return palette(paints)
