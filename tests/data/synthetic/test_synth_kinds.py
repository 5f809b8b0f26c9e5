"""Worlds of every kind can be built, and nobody in them stands in anybody else."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from data.synthetic import actors, clutter, world_kinds
from data.synthetic.clutter import ClutterConfig
from data.synthetic.drive import SyntheticDrive
from data.synthetic.heavy_vehicles import HeavyKind
from data.synthetic.materials import SemanticClass
from data.synthetic.raycasting import Rays, near_any
from data.synthetic.road import Road, RoadShape
from data.synthetic.roadside import Plot
from data.synthetic.traffic_generator import _apart
from data.synthetic.world import build_world
from data.synthetic.world_config import WorldConfig
from perception.errors import UsageError
from perception.geometry.box_overlap import iou_bev
from tests.faults import fault

KINDS = [
    world_kinds.town_street,
    world_kinds.housing_street,
    world_kinds.main_road,
    world_kinds.open_junction,
    world_kinds.country_road,
    world_kinds.industrial_street,
    world_kinds.cycling_street,
    world_kinds.shopping_street,
    world_kinds.park_road,
    world_kinds.traffic_jam,
    world_kinds.open_field,
    world_kinds.road_tunnel,
    world_kinds.furnished_street,
]


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_no_two_vehicles_touch(kind):
    config = kind(np.random.default_rng(5))
    drive = SyntheticDrive(20, seed=5, config=config, images=False)
    for index in (0, 19):
        labels = drive.labels_around(index)
        vehicles = labels.boxes_velo[np.isin(labels.types, ["Car", "Van", "Truck", "Tram", "Misc"])]
        overlap = iou_bev(vehicles, vehicles) - np.eye(len(vehicles))
        assert len(vehicles) > (0 if kind is world_kinds.open_field else 2)
        assert overlap.max() < 1e-3


@pytest.mark.slow
def test_in_a_jam_long_vehicles_creep_stop_and_go_on():
    config = world_kinds.traffic_jam(np.random.default_rng(2))
    world = SyntheticDrive(150, seed=2, config=config, images=False).world
    driving = [actor for actor in world.actors if actor.path and not actor.body.is_person]
    assert np.mean([actor.body.size_m[0] > 5.5 for actor in driving]) > 0.25
    times_s = np.arange(0.0, 15.0, 0.1)
    speeds = np.array([actor.path.speed_m_s(times_s) for actor in driving])
    assert speeds.max() < 5.0
    stops = (speeds < 0.1).any(axis=1)
    goes_on = stops & (speeds > 0.5).any(axis=1)
    assert 0.1 < goes_on.mean() < 0.9


def test_a_place_full_of_clutter_has_all_of_it():
    road = Road(RoadShape(lanes=2, land_m=(1.5, -1.0), roughness_m=0.1))
    everything = ClutterConfig(20, 20, 5, 0.5, 0.5, 20, 5, 10, 10, 5, 5, 5, 5, 5, 5, 5)
    parts = clutter.place_clutter(road, (0.0, 100.0), everything, [], np.random.default_rng(0))
    assert len(parts) > 300
    heights = [
        part.mesh.vertices_m[:, 2].max() - part.mesh.vertices_m[:, 2].min() for part in parts
    ]
    assert max(heights) < 12
    assert not clutter.place_clutter(
        road, (0.0, 100.0), ClutterConfig(), [], np.random.default_rng(0)
    )


def test_bushes_do_not_grow_over_the_road():
    road = Road(RoadShape(pavement_m=0.5))
    parts = clutter.place_clutter(
        road, (0.0, 100.0), ClutterConfig(bushes=30, conifers=10), [], np.random.default_rng(1)
    )
    for part in parts:
        _, side = road.locate(part.mesh.vertices_m[:, :2].astype(float))
        assert np.quantile(np.abs(side), 0.05) > road.shape.half_width_m


@pytest.mark.parametrize("amount", ["trimmed", "structures", "enclosures"])
def test_a_parking_lot_holds_no_large_vehicle(amount):
    road, lot = Road(RoadShape(curvature_1_m=0.0)), Plot(40.0, 30.0, 1)
    parts = clutter.place_clutter(
        road,
        (0.0, 100.0),
        replace(ClutterConfig(), **{amount: 20.0}),
        [],
        np.random.default_rng(0),
        lambda s_m, length_m, side: not lot.overlaps(s_m, length_m, side),
    )
    assert len(parts) > 10
    for part in parts:
        s_m, l_m = road.locate(
            part.mesh.vertices_m[:, :2].mean(axis=0, keepdims=True).astype(float)
        )
        assert not (l_m[0] > 0 and 40.0 < s_m[0] < 70.0)


def kinds_of_actors(kind):
    """Count the actors of two worlds of one kind."""
    counts = Counter()
    for seed in range(2):
        config = kind(np.random.default_rng(seed))
        world = build_world(config, 2.0, np.random.default_rng(seed))
        counts.update(actor.body.kind for actor in world.actors)
    return counts


@pytest.mark.slow
def test_kinds_of_streets_are_full_of_what_they_are_named_after():
    industry = kinds_of_actors(world_kinds.industrial_street)
    assert industry["Truck"] + industry["Misc"] > 0.07 * industry.total()
    assert industry["Van"] > 0.15 * industry.total()
    cycling = kinds_of_actors(world_kinds.cycling_street)
    assert cycling["Cyclist"] > 20
    shopping = kinds_of_actors(world_kinds.shopping_street)
    assert shopping["Pedestrian"] > 60


def test_slopes_and_bumps_begin_beyond_the_pavement():
    shape = RoadShape(land_m=(-1.0, 2.0), land_reach_m=4.0, roughness_m=0.2, crown=0.0, bank=0.0)
    rough, smooth = Road(shape), Road(replace(shape, roughness_m=0.0, land_m=(0.0, 0.0)))
    s = np.linspace(0, 80, 400)
    inside, outside = shape.outer_m - 0.01, shape.outer_m + 6.0
    for side in (inside, -inside):
        assert rough.height_m(s, side) == pytest.approx(smooth.height_m(s, side), abs=1e-9)
    left = rough.height_m(s, outside) - smooth.height_m(s, outside)
    right = rough.height_m(s, -outside) - smooth.height_m(s, -outside)
    assert left.mean() == pytest.approx(2.0, abs=0.1)
    assert right.mean() == pytest.approx(-1.0, abs=0.1)
    assert left.std() == pytest.approx(0.2, rel=0.3)


def test_no_building_stands_on_a_yard_of_the_same_side():
    parking_lot = Plot(10.0, 20.0, 1)
    assert parking_lot.overlaps(25.0, 10.0, 1)
    assert not parking_lot.overlaps(25.0, 10.0, -1)
    assert not parking_lot.overlaps(30.0, 5.0, 1)


def test_trucks_start_apart_from_the_ego_vehicle():
    place = _apart(np.array([12.0, 0.0, -9.0]), np.array([16.0, 4.6, 12.0]), 1)
    assert place == pytest.approx([13.3, 0.0, -11.3])
    free = np.array([40.0, 0.0, -30.0])
    assert _apart(free, np.array([16.0, 4.6, 12.0]), 1) is free


def test_heavy_vehicles_fill_their_boxes():
    for body in actors.draw_heavy_vehicles(np.random.default_rng(0), 7):
        low, high = body.poses[0].vertices_m.min(axis=0), body.poses[0].vertices_m.max(axis=0)
        length, width, height = body.size_m
        assert body.kind in ("Truck", "Misc")
        assert high[0] - low[0] == pytest.approx(length, abs=0.06)
        assert width - 0.05 < high[1] - low[1] < width + 0.35  # mirrors
        assert (low[2], high[2]) == pytest.approx((0.0, height), abs=0.02)


@pytest.mark.parametrize(
    ("kind", "label"), [(HeavyKind.TRAM, "Tram"), (HeavyKind.SEMI_TRAILER, "Misc")]
)
def test_trams_and_parked_trailers_are_neither_trucks_nor_larger_than_their_boxes(kind, label):
    body = actors.draw_heavy(kind, np.random.default_rng(0))
    low, high = body.poses[0].vertices_m.min(axis=0), body.poses[0].vertices_m.max(axis=0)
    assert body.kind == label
    assert high - low == pytest.approx(np.array(body.size_m), abs=0.06)
    assert low[2] == pytest.approx(0.0, abs=0.02)


def test_a_group_of_pedestrians_stays_together():
    config = replace(WorldConfig(), groups=1.0, pedestrians=3.0, crossing_every_s=0.0, cyclists=0.0)
    world = build_world(config, 2.0, np.random.default_rng(0))
    for time_s in (0.0, 2.0):
        places = np.array(
            [
                world.state(a, time_s).world_SE3_object[:2, 3]
                for a in world.actors
                if a.body.is_person
            ]
        )
        away_m = np.linalg.norm(places[:, None] - places, axis=2)
        np.fill_diagonal(away_m, np.inf)
        assert len(places) > 8
        assert np.median(away_m.min(axis=1)) < 1.0
        assert away_m.min() > 0.4


def test_people_of_all_sizes_stand_upright_and_have_the_widths_of_people():
    rng = np.random.default_rng(0)
    bodies = [actors.draw_standing_figure(rng) for _ in range(60)] + actors.draw_figures(rng, 4)
    heights_m = np.array([body.size_m[2] for body in bodies])
    assert 1.0 <= heights_m.min() < 1.25
    assert 1.8 < heights_m.max() <= 2.0
    assert 0.05 < (heights_m < 1.5).mean() < 0.3
    for body in bodies:
        assert 0.25 < body.size_m[1] < 0.9
        for mesh in body.poses:
            low, high = mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)
            assert (low[2], high[2]) == pytest.approx((0, body.size_m[2]), abs=0.06)
            assert 0.15 < high[0] - low[0] < 1.6


def test_bystanders_wait_in_groups_and_beside_parked_vehicles():
    road = RoadShape(curvature_1_m=0.0, parking_m=2.2, pavement_m=4.0)
    config = WorldConfig(road=road, pedestrians=0.0, cyclists=0.0, crossing_every_s=0.0)
    nobody = build_world(config, 1.0, np.random.default_rng(2))
    assert not any(actor.body.is_person for actor in nobody.actors)
    world = build_world(
        replace(config, is_mixed_crowd=True, waiting=3.0, at_vehicles=0.5),
        1.0,
        np.random.default_rng(2),
    )
    assert [actor.track_id for actor in world.actors] == list(range(len(world.actors)))
    people = [actor for actor in world.actors if actor.body.is_person]
    assert len(people) > 15
    parked = [a for a in world.actors if a.path is None and not a.body.is_person]
    for person in people:
        place_m = person.world_SE3_parked[:2, 3]
        for vehicle in parked:
            pose = vehicle.world_SE3_parked
            local_m = np.abs((place_m - pose[:2, 3]) @ pose[:2, :2])
            assert (local_m > np.array(vehicle.body.size_m[:2]) / 2 + 0.1).any()
    places_m = np.array([person.world_SE3_parked[:2, 3] for person in people])
    away_m = np.linalg.norm(places_m[:, None] - places_m, axis=2) + 9 * np.eye(len(people))
    assert away_m.min() > 0.45
    near_vehicle = [
        min(np.linalg.norm(vehicle.world_SE3_parked[:2, 3] - place) for vehicle in parked) < 3.5
        for place in places_m
    ]
    assert sum(near_vehicle) > 3


def test_trailers_follow_the_cars_that_tow_them_and_touch_nobody():
    config = replace(WorldConfig(), trailers=0.5, pedestrians=0.0, cyclists=0.0, stop_every_s=20.0)
    world = build_world(config, 4.0, np.random.default_rng(0))
    parked = [actor for actor in world.actors if actor.path is None]
    assert any(actor.body.category == "Trailer" for actor in parked)
    driving = [actor for actor in world.actors if actor.path is not None]
    towing = [actor for actor in driving if actor.body.trailer is not None]
    assert len(towing) > 3
    for time_s in (0.0, 2.0, 4.0):
        along_m = np.array([actor.path.at(time_s)[0] for actor in driving])
        lanes_m = np.array([actor.path.at(time_s)[1] for actor in driving])
        lengths_m = np.array([actor.body.size_m[0] for actor in driving])
        gaps_m = np.abs(along_m[:, None] - along_m) - (lengths_m[:, None] + lengths_m) / 2
        gaps_m[np.abs(lanes_m[:, None] - lanes_m) > 2.0] = np.inf
        np.fill_diagonal(gaps_m, np.inf)
        assert gaps_m.min() > 0.5
    for car in towing:
        trailer = world.actors[car.track_id + 1]
        assert (trailer.body.kind, trailer.body.category) == ("Misc", "Trailer")
        behind_m = car.path.facing * (car.path.s_m - trailer.path.s_m)
        assert behind_m == pytest.approx(car.body.towed_m)


def test_people_take_the_footpath():
    config = replace(WorldConfig(), footpath_m=10.0, crossing_every_s=0.0)
    world = build_world(config, 2.0, np.random.default_rng(0))
    paths = [actor.path for actor in world.actors if actor.body.is_person]
    out_m = np.array([abs(path.l_m[0]) for path in paths]) - config.road.outer_m
    is_on_footpath = np.abs(out_m - 10.0) <= 1.0
    assert 0.3 < is_on_footpath.mean() < 0.7
    assert (out_m[~is_on_footpath] < 0).all()


def test_a_mixed_fleet_spans_the_sizes_of_cars():
    bodies = actors.draw_mixed_vehicles(np.random.default_rng(0), 120)
    sizes = np.array([body.size_m for body in bodies if body.kind == "Car"])
    assert sizes[:, 0].min() < 3.5
    assert sizes[:, 0].max() > 4.6
    assert sizes[:, 2].min() < 1.36
    assert sizes[:, 2].max() > 1.8
    # KITTI's labels of cars measure 3.88 x 1.63 x 1.53 m on average.
    assert sizes.mean(axis=0) == pytest.approx([3.88, 1.63, 1.53], rel=0.04)


def test_points_on_trucks_are_labelled_so():
    config = replace(WorldConfig(), heavy=1.0)
    scan = SyntheticDrive(2, seed=1, config=config, images=False).scan(0)
    assert (scan.truth.classes == SemanticClass.TRUCK).sum() > 500


def test_an_ego_lane_that_the_road_lacks_is_refused():
    with fault(UsageError, expected="ego_lane below the 1 lanes"):
        WorldConfig(ego_lane=1)


def test_an_open_field_has_nothing_above_ground_beside_the_road():
    config = world_kinds.open_field(np.random.default_rng(3))
    drive = SyntheticDrive(2, seed=3, config=config, images=False)
    scan = drive.scan(0)
    low = [40, 48, 70, 72]  # road, pavement, grass, land
    is_low = np.isin(scan.truth.classes, low)
    above_ground = ~is_low & (scan.truth.instances == 0)
    assert above_ground.mean() < 0.01


def test_a_tunnel_encloses_the_road_and_no_daylight_reaches_its_middle():
    config = WorldConfig(tunnel_m=(-50.0, 150.0))
    world = build_world(config, 1.0, np.random.default_rng(1))
    assert world.tunnel is not None
    outer_m = config.road.outer_m
    places = world.road.place(
        np.array([50.0, 50.0, -49.0, -60.0, 50.0]), np.array([0, 2.0, 0, 0, outer_m + 2])
    )
    share = world.tunnel.daylight_share(places.astype(np.float32))
    assert share == pytest.approx([0.03, 0.03, np.exp(-1 / 7), 1.0, 1.0], abs=0.02)
    middle = world.road.place(np.array(50.0), np.array(0.0)) + np.array([0, 0, 1.5])
    angles = np.linspace(0, np.pi, 20)[1:-1]
    heading = float(world.road.heading_rad(np.array(50.0)))
    across = np.array([-np.sin(heading), np.cos(heading), 0.0])
    directions = np.cos(angles)[:, None] * across + np.sin(angles)[:, None] * [0, 0, 1.0]
    origins = np.tile(middle, (len(directions), 1)).astype(np.float32)
    aimed = directions.astype(np.float32)
    rays = Rays(origins, aimed, np.zeros(len(aimed), np.float32), near_any(origins, aimed))
    hits = world.scene.cast(rays, [])
    assert (hits.distance_m < outer_m + 2.5).all()


def test_light_trucks_are_no_longer_than_vans_and_fill_their_boxes():
    bodies = actors.draw_light_trucks(np.random.default_rng(0), 12)
    for body in bodies:
        low, high = body.poses[0].vertices_m.min(axis=0), body.poses[0].vertices_m.max(axis=0)
        assert body.category == "Truck"
        assert 4.5 < body.size_m[0] < 6.7
        assert (low[2], high[2]) == pytest.approx((0.0, body.size_m[2]), abs=0.05)
        assert high[0] - low[0] == pytest.approx(body.size_m[0], abs=0.06)
    assert {body.kind for body in bodies} == {"Truck", "Car"}  # KITTI calls pick-ups cars


def test_light_trucks_drive_and_park():
    road = RoadShape(curvature_1_m=0.0, parking_m=2.3)
    world = build_world(WorldConfig(road=road, light_trucks=0.5), 1.0, np.random.default_rng(0))
    trucks = [actor for actor in world.actors if actor.body.category == "Truck"]
    assert any(actor.path is None for actor in trucks)
    assert any(actor.path is not None for actor in trucks)


def test_groups_wait_under_roofs():
    road = RoadShape(curvature_1_m=0.0, pavement_m=4.0)
    config = WorldConfig(road=road, pedestrians=0.0, cyclists=0.0, waiting=3.0, crossing_every_s=0.0)  # fmt: skip
    worlds = [
        build_world(replace(config, sheltered=share), 1.0, np.random.default_rng(2))
        for share in (0.0, 1.0)
    ]
    above = []
    for world in worlds:
        people = [actor for actor in world.actors if actor.body.is_person]
        feet_m = np.array([person.world_SE3_parked[:3, 3] for person in people])
        heads_m = (feet_m + np.array([0.0, 0.0, 2.1])).astype(np.float32)
        up = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (len(heads_m), 1))
        rays = Rays(heads_m, up, np.zeros(len(up), np.float32), near_any(heads_m, up))
        above.append((world.scene.cast(rays, []).distance_m < 1.5).mean())
    assert above[0] < 0.1  # trees and signs
    assert above[1] > 0.5
