"""The LiDAR against geometry that is known exactly."""

from dataclasses import replace

import numpy as np
import pytest

from data.synthetic import lidar, meshes
from data.synthetic.materials import SemanticClass, Slot, palette
from data.synthetic.street import Part
from perception.errors import UsageError
from perception.geometry.grids import EgoVehicle
from perception.sensor import HDL_64E, SENSORS
from tests.faults import fault

WALL = Part(meshes.box((10.0, -8.0, -1.0), (11.0, 8.0, 4.0), Slot.WALL), palette())


def ranges_to_wall(points: np.ndarray) -> np.ndarray:
    """Return measured less true range of points on the face x = 10."""
    on_face = (np.abs(points[:, 1]) < 7.5) & (points[:, 0] > 9) & (points[:, 2] > -1.5)
    face = points[on_face, :3].astype(float)
    measured = np.linalg.norm(face, axis=1)
    return measured - measured * 10.0 / face[:, 0]


def test_range_noise_is_the_sensors(flat_world):
    scan = lidar.scan(flat_world([WALL]), HDL_64E, 0.0, np.random.default_rng(0))
    error = ranges_to_wall(scan.points_velo)
    assert len(error) > 5000
    assert error.std() == pytest.approx(0.02, rel=0.05)
    assert abs(error.mean()) < 0.001


def test_the_vehicle_hides_the_road_below_it(flat_world):
    sensor = SENSORS["OS0-32"]
    scan = lidar.scan(flat_world([WALL]), sensor, 0.0, np.random.default_rng(0))
    assert not EgoVehicle().contains_xy(scan.points_velo).any()
    # Beside it, the lowest beam meets the road.
    lowest_m = sensor.height_m / np.tan(-sensor.elevations_rad[-1])
    nearest_m = np.linalg.norm(scan.points_velo[:, :2], axis=1).min()
    assert nearest_m == pytest.approx(lowest_m, abs=0.2)
    assert len(scan.truth.classes) == len(scan.points_velo)


def test_a_wall_stays_flat_while_the_vehicle_drives(flat_world):
    exact = replace(HDL_64E, range_noise_m=0.0)
    world = flat_world([WALL], ego_m_s=10.0)
    scan = lidar.scan(world, exact, 0.0, np.random.default_rng(0))
    pose = lidar.velo_poses(world, exact, np.zeros(1))[0]
    points = scan.points_velo[:, :3] @ pose[:3, :3].T + pose[:3, 3]
    face = (np.abs(points[:, 1]) < 7.5) & (points[:, 0] > 9) & (points[:, 2] > 0.1)
    assert face.sum() > 5000
    assert points[face, 0] == pytest.approx(10.0, abs=0.001)


@pytest.mark.parametrize("name", ["HDL-64E", "HDL-32E", "VLP-16", "VLP-32C", "OS0-32", "AT128"])
def test_every_sensor_fires_its_own_beams(flat_world, name):
    sensor = replace(SENSORS[name], range_noise_m=0.0)
    scan = lidar.scan(flat_world([WALL]), sensor, 0.0, np.random.default_rng(0))
    points = scan.points_velo.astype(float)
    distance = np.linalg.norm(points[:, :3], axis=1)
    elevation = np.arcsin(points[:, 2] / distance)
    nearest = np.abs(elevation[:, None] - sensor.elevations_rad).min(axis=1)
    assert nearest.max() < 1e-4
    assert distance.min() >= sensor.min_range_m
    assert distance.max() <= sensor.max_range_m
    assert points[:, 2].min() == pytest.approx(-sensor.height_m, abs=0.01)


def test_returns_thin_out_with_range_and_grazing(flat_world):
    scan = lidar.scan(flat_world(), HDL_64E, 0.0, np.random.default_rng(0))
    distance = np.linalg.norm(scan.points_velo[:, :3], axis=1)
    rings = np.histogram(distance, bins=[5, 10, 60, 120])[0]
    steep = HDL_64E.elevations_rad[HDL_64E.elevations_rad < -np.arcsin(1.73 / 10)]
    fired = (np.sin(-steep) * 5 < 1.73).sum() * HDL_64E.columns
    assert rings[0] > 0.95 * fired
    assert rings[2] < 0.05 * rings[1]


def test_dark_glass_gives_fewer_returns_than_paint(flat_world):
    def returns(slot: Slot) -> int:
        pane = Part(meshes.box((10.0, -8.0, -1.0), (11.0, 8.0, 4.0), slot), palette())
        scan = lidar.scan(flat_world([pane]), HDL_64E, 0.0, np.random.default_rng(0))
        return len(ranges_to_wall(scan.points_velo))

    assert returns(Slot.GLASS) < 0.3 * returns(Slot.PAINT)


def test_reflectance_is_that_of_the_material(flat_world):
    def median(slot: Slot) -> float:
        part = Part(meshes.box((10.0, -2.0, -1.0), (11.0, 2.0, 4.0), slot), palette())
        scan = lidar.scan(flat_world([part]), HDL_64E, 0.0, np.random.default_rng(0))
        points = scan.points_velo
        face = (points[:, 0] > 9) & (np.abs(points[:, 1]) < 2) & (points[:, 2] > -1.5)
        return float(np.median(points[face, 3]))

    assert median(Slot.SIGN) > 0.9
    assert median(Slot.TYRE) < 0.15 < median(Slot.WALL)


def test_ground_points_lie_on_the_road(street_drive):
    index = 20
    scan = street_drive.scan(index)
    road = street_drive.world.road
    ground = np.isin(scan.truth.classes, [SemanticClass.ROAD])
    pose = lidar.velo_poses(
        street_drive.world, street_drive.sensor, np.array([street_drive.stamp_s(index)])
    )[0]
    world = scan.points_velo[ground, :3] @ pose[:3, :3].T + pose[:3, 3]
    s, side = road.locate(world)
    error = world[:, 2] - road.height_m(s, side)
    assert len(error) > 20000
    assert abs(np.median(error)) < 0.003
    assert np.quantile(np.abs(error), 0.99) < 0.03
    assert (np.abs(side) < road.shape.half_width_m + 0.1).all()


def test_points_of_moving_objects_are_labelled_moving(street_drive):
    index = 10
    truth = street_drive.point_truth(index)
    world, time = street_drive.world, street_drive.stamp_s(index)
    seen = [a for a in world.actors if (truth.instances == a.track_id + 1).sum() > 5]
    assert len(seen) > 10
    for actor in seen:
        own = truth.instances == actor.track_id + 1
        speed = np.linalg.norm(actor.velocity_m_s(world.road, time))
        assert (truth.is_moving[own] == (speed > 0.1)).all()
        assert (truth.classes[own] == actor.body.semantic).all()
    assert any(truth.is_moving)
    assert not truth.is_moving[truth.instances == 0].any()


def test_a_passing_car_is_where_it_is_when_the_beam_meets_it(street_drive):
    """A moving car is smeared by its motion in a scan, and no more."""
    truth, points = street_drive.point_truth(10), street_drive.scan(10).points_velo
    labels = street_drive.labels(10)
    moving = truth.instances[truth.is_moving]
    for box, track in zip(range(len(labels)), labels.track_ids, strict=True):
        if track + 1 not in moving or labels.types[box] not in ("Car", "Van"):
            continue
        own = points[truth.instances == track + 1, :3]
        length = labels.boxes_velo.size_m[box, 0]
        reach = np.linalg.norm(own[:, :2] - labels.boxes_velo.bottom_m[box, :2], axis=1)
        assert reach.max() < length / 2 + 1.0


def test_a_lidar_of_120_degrees_has_no_returns_behind(flat_world):
    sensor = SENSORS["AT128"]
    scan = lidar.scan(flat_world([WALL]), sensor, 0.0, np.random.default_rng(0))
    azimuth_deg = np.degrees(np.arctan2(scan.points_velo[:, 1], scan.points_velo[:, 0]))
    assert np.abs(azimuth_deg).max() == pytest.approx(60, abs=0.2)
    assert len(scan.truth.classes) == len(scan.points_velo)


def test_a_lidar_without_rings_is_not_simulated(flat_world):
    with fault(UsageError, "sensor Avia", "keep their elevations", advice="another sensor"):
        lidar.scan(flat_world(), SENSORS["Avia"], 0.0, np.random.default_rng(0))
