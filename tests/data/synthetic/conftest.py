"""A short drive that many tests look at, and worlds small enough to check by eye."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from data.synthetic import vehicles
from data.synthetic.actors import Actor, Body
from data.synthetic.drive import SyntheticDrive
from data.synthetic.materials import palette
from data.synthetic.motion import Path
from data.synthetic.road import Road, RoadShape
from data.synthetic.street import Part, ground
from data.synthetic.vehicle_designs import BodyStyle, draw_design
from data.synthetic.world import World, assemble
from data.synthetic.world_config import WorldConfig
from perception.geometry import se3

FLAT = RoadShape(curvature_1_m=0.0, slope=0.0, bank=0.0, crown=0.0, kerb_m=0.0)


@pytest.fixture(scope="session")
def street_drive() -> SyntheticDrive:
    return SyntheticDrive(40, seed=3)


@pytest.fixture(scope="session")
def saloon() -> Body:
    design = draw_design(BodyStyle.SALOON, np.random.default_rng(0))
    return Body("Car", design.size_m, (vehicles.build(design),))


@pytest.fixture(scope="session")
def flat_world(saloon: Body) -> Callable[..., World]:
    """Make a flat empty plain with some parts and with saloons parked at (x, y, heading)."""

    def make(
        parts: Sequence[Part] = (),
        cars: Sequence[tuple[float, float, float]] = (),
        ego_m_s: float = 0.0,
    ) -> World:
        road = Road(FLAT, start_m=-200, end_m=200)
        actors = [
            Actor(number, saloon, palette(), None, se3.from_euler(0, 0, yaw, np.array([x, y, 0.0])))
            for number, (x, y, yaw) in enumerate(cars)
        ]
        times = np.arange(-1.0, 3.0, 0.05)
        ego = Path(times, ego_m_s * times, np.zeros_like(times))
        plain = ground(road, -150, 150)
        config = WorldConfig(road=FLAT)
        return assemble(config, road, [plain, *parts], actors, ego, np.random.default_rng(1))

    return make
