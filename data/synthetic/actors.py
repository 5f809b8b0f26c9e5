"""Who takes part in traffic: vehicles, cyclists and people, parked or on their way."""

from dataclasses import dataclass, field

import numpy as np

from data.synthetic import people, vehicles
from data.synthetic.materials import SemanticClass, Slot, palette, random_clothes, random_paint
from data.synthetic.meshes import Mesh
from data.synthetic.motion import Path, upright_poses, vehicle_poses
from data.synthetic.road import Road
from data.synthetic.vehicle_designs import BodyStyle, draw_design
from perception.types import Float32, Float64

MOVING_M_S = 0.1  # slower is standing

_CLASS_OF = {
    "Car": SemanticClass.CAR,
    "Van": SemanticClass.OTHER_VEHICLE,
    "Pedestrian": SemanticClass.PERSON,
    "Cyclist": SemanticClass.BICYCLIST,
}


@dataclass(frozen=True)
class Body:
    """A shape shared by several actors.

    Attributes:
        kind: KITTI's type.
        size_m: length, width, height of its label.
        poses: meshes of one cycle of steps or pedal turns; one for what is rigid.
        cycle_m: way covered in a cycle.
    """

    kind: str
    size_m: tuple[float, float, float]
    poses: tuple[Mesh, ...]
    cycle_m: float = 1.0

    @property
    def semantic(self) -> int:
        """Class of its points."""
        return int(_CLASS_OF[self.kind])

    @property
    def is_person(self) -> bool:
        """Whether it stays upright on slopes."""
        return self.kind in ("Pedestrian", "Cyclist")


@dataclass(frozen=True)
class Actor:
    """One participant.

    Attributes:
        track_id: its number, the same in all frames.
        body: its shape.
        looks: (slots, 4) palette.
        path: its way; None for what is parked.
        world_SE3_parked: (4, 4) pose of what is parked.
        is_steered: whether it faces where its way leads, as who turns off does, and not along the road.
    """

    track_id: int
    body: Body
    looks: Float32
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


def draw_vehicles(rng: np.random.Generator, count: int) -> list[Body]:
    """Draw car and van bodies of all styles, the common ones first."""
    common = [
        BodyStyle.HATCHBACK, BodyStyle.ESTATE, BodyStyle.SALOON, BodyStyle.HATCHBACK, BodyStyle.SUV,
        BodyStyle.MINIVAN, BodyStyle.PANEL_VAN, BodyStyle.SALOON, BodyStyle.HATCHBACK, BodyStyle.ESTATE,
    ]  # fmt: skip
    bodies = []
    for number in range(count):
        style = common[number % len(common)]
        design = draw_design(style, rng)
        kind = "Van" if style in (BodyStyle.MINIVAN, BodyStyle.PANEL_VAN) else "Car"
        bodies.append(Body(kind, design.size_m, (vehicles.build(design),)))
    return bodies


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


def draw_standing(rng: np.random.Generator) -> Body:
    """Draw someone who stands still."""
    height = _heights_m(rng, 1.55, 1.92, 1)[0]
    mesh = people.pedestrian(height, 0, is_walking=False)
    return Body("Pedestrian", (0.55, 0.60, height), (mesh,))


def draw_cyclists(rng: np.random.Generator, count: int) -> list[Body]:
    """Draw cyclists of several heights, each in all poses of a pedal turn."""
    bodies = []
    for tall in _heights_m(rng, 1.62, 1.85, count):
        poses = tuple(people.cyclist(tall, phase) for phase in range(people.PHASES))
        height = float(poses[0].vertices_m[:, 2].max())
        bodies.append(Body("Cyclist", (1.80, 0.62, height), poses, people.PEDAL_M))
    return bodies


def draw_looks(body: Body, rng: np.random.Generator) -> Float32:
    """Draw paint or clothes."""
    if body.is_person:
        return random_clothes(rng)
    return palette({Slot.PAINT: random_paint(rng)})
