"""Scripted scenes with one object to track and exact truth: the challenges of tracking, one at a time or together.

Seen from above, the road running to the right; all keep their lanes but who turns:

    l =  0 m   ego  >>>
    l = -3 m            van >>>            overtakes, and hides the object on its way
    l = -6 m                   object >>>  goes at its pace, and turns to its right and back
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path as FilePath
from typing import Literal

import numpy as np
from scipy.ndimage import gaussian_filter1d

from data.synthetic import actors as actor_models
from data.synthetic import town, vehicles
from data.synthetic.actors import Actor, Body
from data.synthetic.drive import SyntheticDrive
from data.synthetic.exposure import Exposure
from data.synthetic.ins import InsNoise
from data.synthetic.motion import Path
from data.synthetic.road import Road, RoadShape
from data.synthetic.town import TownConfig
from data.synthetic.vehicle_designs import BodyStyle, draw_design
from data.synthetic.world import World, assemble
from data.synthetic.world_config import WorldConfig
from perception.errors import UsageError
from perception.evaluation.single_object.track import TrueTrack
from perception.sensor import HDL_64E, LidarModel
from perception.types import Boxes3D, Float64

TargetClass = Literal["Car", "Cyclist", "Pedestrian"]
TARGET_ID = 0  # track id of the object that is followed
_OCCLUDER_ID = 1

_PACE_M_S: dict[TargetClass, float] = {"Car": 6.0, "Cyclist": 4.5, "Pedestrian": 1.5}
_EGO_LANE_M, _VAN_LANE_M, _OBJECT_LANE_M = 0.0, -3.0, -6.0
_GAP_M = 18.0  # from the LiDAR to the object, along the road
_FARTHEST_M, _NEAREST_M = 40.0, 18.0  # the same where the distance changes
_STEP_S = 0.05
_MARGIN_S = 2.0  # ways go on for this long before and after the drive
_OVERTAKES = (
    0.28  # of the gap a second, by which the van is faster than the line of sight it crosses
)
_TURN_RAD = -np.radians(65)
_EGO_LAG_S = 1.0  # over which the ego vehicle evens out the object's speed


class ScenarioChallenge(StrEnum):
    """Challenge while the object is tracked; the attributes of Table 3.2."""

    OCCLUSION = "occlusion"
    ILLUMINATION = "illumination"
    POSE = "pose"
    DISTANCE = "distance"  # and so its size in the image, and the points on it
    VELOCITY = "velocity"


@dataclass(frozen=True)
class Scenario:
    """Events of a scene.

    Attributes:
        kind: Class of the object.
        challenges: Challenges, each in its part of the drive.
        duration_s: Duration of the drive in seconds; all events are stretched with it.
    """

    kind: TargetClass = "Car"
    challenges: frozenset[ScenarioChallenge] = frozenset()
    duration_s: float = 6.0

    def __post_init__(self) -> None:
        """Validate the duration."""
        if self.duration_s < 0.5:
            raise UsageError(
                "scenario", expected="a duration of at least 0.5 s", found=f"{self.duration_s:g} s"
            )

    @property
    def name(self) -> str:
        """Name of the challenges."""
        if len(self.challenges) == len(ScenarioChallenge):
            return "together"
        return " and ".join(sorted(self.challenges)) or "baseline"

    def has(self, challenge: ScenarioChallenge) -> bool:
        """Return whether the scenario has a challenge."""
        return challenge in self.challenges


def all_scenarios(kind: TargetClass, duration_s: float = 6.0) -> list[Scenario]:
    """Return a scenario without challenges, one for each challenge, and one with all."""
    chosen = [
        frozenset[ScenarioChallenge](),
        *(frozenset([c]) for c in ScenarioChallenge),
        frozenset(ScenarioChallenge),
    ]
    return [Scenario(kind, challenges, duration_s) for challenges in chosen]


class ScenarioDrive(SyntheticDrive):
    """A drive through a scenario, along a flat, wide street; the object is track `TARGET_ID`."""

    def __init__(
        self,
        scenario: Scenario,
        *,
        seed: int = 0,
        sensor: LidarModel = HDL_64E,
        noise: InsNoise | None = None,
        images: bool = True,
    ) -> None:
        """Draw the street and its actors.

        Args:
            scenario: Scenario.
            seed: Seed of the street, of appearances and of all noise.
            sensor: LiDAR model.
            noise: Noise of the INS; else that of KITTI's INS.
            images: Whether frames carry images.
        """
        self.scenario = scenario
        frames = max(round(scenario.duration_s * sensor.rate_hz), 2)
        super().__init__(frames, seed=seed, sensor=sensor, noise=noise, images=images)
        self.name = f"{scenario.kind.lower()} {scenario.name}"
        self.root = FilePath(self.name.replace(" ", "_"))

    def _build_world(self, config: WorldConfig, rng: np.random.Generator) -> World:
        return _build_world(self.scenario, rng)

    def _exposure(self, index: int) -> Exposure:
        """Return a fixed exposure, as metering would compensate the change of light."""
        if not self.scenario.has(ScenarioChallenge.ILLUMINATION):
            return Exposure()
        share = self.stamp_s(index) / self.scenario.duration_s
        return Exposure(_light(share))


def _light(share: float) -> float:
    """Return the light over the drive: as under a bridge, and then brighter than before."""
    into_shade, into_sun = _ramp(np.array([share, share]), [0.35, 0.65], [0.43, 0.70])
    return float(1 - 0.75 * into_shade + 1.15 * into_sun)


def _ramp(
    values: Float64, start: float | Sequence[float], stop: float | Sequence[float]
) -> Float64:
    """Rise smoothly from 0 at the start to 1 at the stop."""
    share = np.clip((values - np.asarray(start)) / (np.asarray(stop) - np.asarray(start)), 0, 1)
    return np.asarray(share**2 * (3 - 2 * share))


def _bump(values: Float64, start: float, stop: float, ramp: float) -> Float64:
    """Rise from 0 to 1 after the start, and fall back to 0 before the stop."""
    return _ramp(values, start, start + ramp) - _ramp(values, stop - ramp, stop)


def _build_world(scenario: Scenario, rng: np.random.Generator) -> World:
    shape = RoadShape(
        curvature_1_m=0.0, slope=0.0, bank=0.0, crown=0.0, lane_m=18.0, parking_m=0.0, kerb_m=0.0
    )
    style = TownConfig(houses=0.5, greenery=0.3, furniture=0.5, parking=0.0)
    config = WorldConfig(road=shape, town=style)
    times_s = np.arange(-_MARGIN_S, scenario.duration_s + _MARGIN_S, _STEP_S)
    target = _object_path(scenario, times_s)
    ego = _ego_path(scenario, target)
    stretch = (float(ego.s_m.min()) - 60, float(target.s_m.max()) + 80)
    road = Road(shape, start_m=stretch[0] - 60, end_m=stretch[1] + 60)
    body = _body(scenario.kind, rng)
    appearance = actor_models.draw_appearance(body, rng)
    actors = [Actor(TARGET_ID, body, appearance, target, is_steered=True)]
    if scenario.has(ScenarioChallenge.OCCLUSION):
        actors.append(_occluder(scenario, target, ego, rng))
    parts = town.lay_out_street(road, stretch, style, [], rng)
    return assemble(config, road, parts, actors, ego, rng)


def _body(kind: TargetClass, rng: np.random.Generator) -> Body:
    if kind == "Pedestrian":
        return actor_models.draw_pedestrians(rng, 1)[0]
    if kind == "Cyclist":
        return actor_models.draw_cyclists(rng, 1)[0]
    return _vehicle("Car", BodyStyle.HATCHBACK, rng)


def _vehicle(kind: Literal["Car", "Van"], style: BodyStyle, rng: np.random.Generator) -> Body:
    design = draw_design(style, rng)
    return Body(kind, design.size_m, (vehicles.build(design),))


def _object_path(scenario: Scenario, times_s: Float64) -> Path:
    """Integrate the object's speed and heading."""
    share = times_s / scenario.duration_s
    speed_m_s = np.full_like(share, _PACE_M_S[scenario.kind])
    if scenario.has(ScenarioChallenge.VELOCITY):
        # Brakes to a crawl within a second, and then goes faster than before.
        speed_m_s *= 1 - 0.9 * _ramp(share, 0.10, 0.25) + 1.2 * _ramp(share, 0.45, 0.62)
    heading_rad = np.zeros_like(share)
    if scenario.has(ScenarioChallenge.POSE):
        heading_rad = _TURN_RAD * _bump(share, 0.55, 0.90, 0.175)
    start = int(np.argmin(np.abs(times_s)))
    s_m = np.cumsum(speed_m_s * np.cos(heading_rad)) * _STEP_S
    l_m = np.cumsum(speed_m_s * np.sin(heading_rad)) * _STEP_S
    return Path(times_s, s_m - s_m[start], _OBJECT_LANE_M + l_m - l_m[start])


def _ego_path(scenario: Scenario, target: Path) -> Path:
    """Return the ego path, which follows the object at a smoothed speed."""
    evened_m = gaussian_filter1d(target.s_m, _EGO_LAG_S / _STEP_S, mode="nearest")
    gap_m = np.full_like(evened_m, _GAP_M)
    if scenario.has(ScenarioChallenge.DISTANCE):
        share = target.times_s / scenario.duration_s
        gap_m = _FARTHEST_M + (_NEAREST_M - _FARTHEST_M) * _ramp(share, 0.0, 1.0)
    return Path(target.times_s, evened_m - gap_m, np.full_like(gap_m, _EGO_LANE_M))


def _occluder(scenario: Scenario, target: Path, ego: Path, rng: np.random.Generator) -> Actor:
    """Return a van that overtakes and occludes the object at a third of the drive."""
    gap_m = target.s_m - ego.s_m
    crossing_m = ego.s_m + gap_m * (_VAN_LANE_M - ego.l_m) / (target.l_m - ego.l_m)
    ahead_m = _OVERTAKES * gap_m * (target.times_s - 0.36 * scenario.duration_s)
    path = Path(target.times_s, crossing_m + ahead_m, np.full_like(gap_m, _VAN_LANE_M))
    van = _vehicle("Van", BodyStyle.PANEL_VAN, rng)
    return Actor(_OCCLUDER_ID, van, actor_models.draw_appearance(van, rng), path)


_HIDDEN = 2  # occlusion of what is there and not labelled in the image


def true_track(drive: ScenarioDrive) -> TrueTrack:
    """Return the object in all frames.

    Its rectangle in the image is NaN where so little of it is seen that nobody would label it.
    """
    frames = range(len(drive))
    boxes = [_exact_box(drive, index) for index in frames]
    boxes_px, occlusion = np.full((len(drive), 4), np.nan), np.full(len(drive), _HIDDEN)
    for index in frames:
        seen = drive.labels(index)
        row = np.flatnonzero(seen.track_ids == TARGET_ID)
        if len(row):
            boxes_px[index], occlusion[index] = seen.boxes_px[row[0]], seen.occlusion[row[0]]
    return TrueTrack(
        frames=np.arange(len(drive)),
        stamps_s=np.array([drive.stamp_s(index) for index in frames]),
        boxes_velo=Boxes3D(
            np.concatenate([box.bottom_m for box in boxes]),
            np.concatenate([box.size_m for box in boxes]),
            np.concatenate([box.yaw_rad for box in boxes]),
        ),
        boxes_px=boxes_px,
        velocities_m_s=np.array([_velocity_m_s(drive, index) for index in frames]),
        occlusion=occlusion,
    )


def _exact_box(drive: ScenarioDrive, index: int) -> Boxes3D:
    labels = drive.labels_around(index)
    return labels.boxes_velo[labels.track_ids == TARGET_ID]


def _velocity_m_s(drive: ScenarioDrive, index: int) -> Float64:
    """Return (2,) along x and y of the LiDAR frame."""
    world_m_s = drive.world.actors[TARGET_ID].velocity_m_s(drive.world.road, drive.stamp_s(index))
    # A row vector: times the world's axes in the LiDAR frame.
    return np.asarray((world_m_s @ drive.true_world_SE3_velo(index)[:3, :3])[:2])
