"""Traffic that does not collide, roads that are what their formula says, cars that look like cars."""

import numpy as np
import pytest

from data.synthetic import people, vehicles
from data.synthetic.materials import Slot
from data.synthetic.road import Road, RoadShape
from data.synthetic.traffic import Block, Lane, Slowdown, simulate_lane, simulation_times
from data.synthetic.vehicle_designs import BodyStyle, draw_design
from data.synthetic.world_config import WorldConfig
from data.synthetic.world_kinds import draw_config
from perception.errors import UsageError
from tests.faults import fault


def test_a_place_on_the_road_is_found_again():
    road = Road(RoadShape(curvature_1_m=1 / 120), np.array([0.3, 1.0, 2.0]))
    s, side = np.array([-50.0, 0.0, 33.3, 120.0]), np.array([-5.0, 3.0, 8.0, 0.0])
    found_s, found_side = road.locate(road.place(s, side))
    assert found_s == pytest.approx(s, abs=0.02)
    assert found_side == pytest.approx(side, abs=0.02)


def test_the_kerb_is_a_step():
    shape = RoadShape(kerb_m=0.13, crown=0.02)
    edge = shape.half_width_m
    step = np.diff(shape_heights(shape, edge - 0.01, edge + 0.01))
    assert step[0] == pytest.approx(0.13, abs=0.002)


def shape_heights(shape: RoadShape, *l_m: float) -> np.ndarray:
    return Road(shape).section_m(np.array(l_m))


def lane_of_three() -> Lane:
    return Lane(np.array([40.0, 20.0, 0.0]), np.full(3, 4.5), np.array([8.0, 10.0, 12.0]))


def test_followers_keep_their_distance_when_the_first_stops():
    times = simulation_times(15.0)
    places = simulate_lane(lane_of_three(), times, [], [Slowdown(0, 3.0, 8.0, 0.0)])
    assert (places[:, :-1] - places[:, 1:] - 4.5).min() > 1.0
    assert (np.diff(places, axis=0) >= 0).all()
    speed = np.diff(places[:, 0]) / 0.05
    assert speed.min() == 0
    assert speed[-1] > 4


def test_a_closed_lane_stops_who_can_stop():
    times = simulation_times(12.0)
    places = simulate_lane(lane_of_three(), times, [Block(100.0, 0.0, 8.0)], [])
    at_closing, at_opening = np.searchsorted(times, [0.0, 8.0])
    held = places[at_closing] < 80.0
    assert held.any()
    assert (places[at_opening, held] + 2.25 < 100.5).all()
    assert places[-1, held].max() > 100.0


def test_nobody_runs_into_the_ego_vehicle(street_drive):
    world = street_drive.world
    for time in np.arange(0.0, 4.0, 0.2):
        ego = world.world_SE3_body(np.array([time]))[0]
        for actor in world.actors:
            pose = actor.pose(world.road, time)
            offset = ego[:3, :3].T @ (pose[:3, 3] - ego[:3, 3])
            length, width, _ = actor.body.size_m
            apart_x = abs(offset[0]) - (length + 4.6) / 2
            apart_y = abs(offset[1]) - (width + 1.8) / 2
            assert max(apart_x, apart_y) > 0, (time, actor.track_id, actor.body.kind)


def test_the_street_is_lively(street_drive):
    kinds = {actor.body.kind for actor in street_drive.world.actors}
    assert kinds == {"Car", "Van", "Pedestrian", "Cyclist"}
    moving = set()
    for index in (0, 20, 39):
        scan = street_drive.scan(index)
        points = scan.points_velo
        ahead = (points[:, 0] > 0) & (points[:, 0] < 25) & (np.abs(points[:, 1]) < 10)
        moving |= set(scan.truth.instances[ahead & scan.truth.is_moving])
    assert len(moving) >= 5


@pytest.mark.parametrize("style", list(BodyStyle))
def test_vehicles_fill_their_boxes(style):
    design = draw_design(style, np.random.default_rng(2))
    mesh = vehicles.build(design)
    low, high = mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)
    assert high[0] - low[0] == pytest.approx(design.length_m, abs=0.05)
    assert low[2] == pytest.approx(0.0, abs=0.01)
    assert high[2] == pytest.approx(design.height_m, abs=0.02)
    body = mesh.vertices_m[mesh.triangles[mesh.slots == Slot.TYRE]]
    assert np.ptp(body[..., 1]) == pytest.approx(design.width_m, abs=0.12)
    for slot in (Slot.PAINT, Slot.GLASS, Slot.TYRE, Slot.HEADLIGHT, Slot.TAILLIGHT, Slot.PLATE):
        assert (mesh.slots == slot).any()


def test_legs_move_with_the_phase():
    poses = [people.pedestrian(1.75, phase) for phase in (0, 3, 6)]
    spread = [np.ptp(mesh.vertices_m[:, 0]) for mesh in poses]
    assert spread[1] > spread[0] + 0.1
    assert all(np.ptp(mesh.vertices_m[:, 2]) == pytest.approx(1.75, abs=0.08) for mesh in poses)
    assert not np.array_equal(
        people.cyclist(1.75, 0).vertices_m, people.cyclist(1.75, 3).vertices_m
    )


def test_drawn_configurations_differ_and_are_possible():
    rng = np.random.default_rng(0)
    drawn = [draw_config(rng) for _ in range(20)]
    assert len({(config.road.lane_m, config.road.pavement_m) for config in drawn}) == 20
    with fault(UsageError, expected="leader_gap_m from 9"):
        WorldConfig(leader_gap_m=3.0)
