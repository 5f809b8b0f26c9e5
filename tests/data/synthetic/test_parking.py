"""Rows of parked vehicles at every angle, dense and apart, and their labels."""

from dataclasses import replace

import numpy as np
import pytest

from data.synthetic import labelling, world_kinds
from data.synthetic.fleet import Fleet
from data.synthetic.lidar import velo_poses
from data.synthetic.parking import Parking
from data.synthetic.rig import default_calibration
from data.synthetic.road import Road, RoadShape
from data.synthetic.roadside import Plot, land_outside
from data.synthetic.world_config import WorldConfig
from perception.geometry.box_overlap import iou_bev
from perception.geometry.boxes import corners
from perception.sensor import HDL_64E
from perception.types import Boxes3D

SHAPE = RoadShape(curvature_1_m=1 / 110, slope=0.0, bank=0.0)


def parked(angle_rad: float, seed: int, bays: list[Plot]) -> tuple[Road, Boxes3D]:
    """Fill both parking lanes of 90 m of a curved road."""
    road = Road(replace(SHAPE, parking_m=5.1 if angle_rad > 0 else 2.1))
    rng = np.random.default_rng(seed)
    fleet = Fleet(WorldConfig(is_mixed_fleet=True, vans=0.3), rng)
    parking = Parking(road, fleet, 1.0, [], rng)
    parking.along_road((0.0, 100.0), [], angle_rad, land_outside(bays))
    poses = np.array([actor.world_SE3_parked for actor in parking.actors])
    boxes = Boxes3D(
        poses[:, :3, 3],
        np.array([actor.body.size_m for actor in parking.actors]),
        np.arctan2(poses[:, 1, 0], poses[:, 0, 0]),
    )
    return road, boxes


@pytest.mark.parametrize(
    ("angle_rad", "min_count"), [(0.0, 28), (np.pi / 4, 40), (np.pi / 3, 42), (np.pi / 2, 48)]
)
def test_parked_rows_are_dense_and_no_two_vehicles_touch(angle_rad, min_count):
    for seed in range(2):
        road, boxes = parked(angle_rad, seed, [])
        assert len(boxes) >= min_count
        overlap = iou_bev(boxes, boxes) - np.eye(len(boxes))
        assert overlap.max() < 1e-3
        s_m, l_m = road.locate(boxes.bottom_m)
        turn_rad = boxes.yaw_rad - road.heading_rad(s_m) + angle_rad - np.pi * (l_m > 0)
        assert np.abs(np.sin(turn_rad)).max() < 0.1
        corners_m = corners(boxes).reshape(-1, 3)
        out_m = np.abs(road.locate(corners_m)[1])
        assert out_m.min() > road.shape.lanes_m - 0.35
        assert out_m.max() < road.shape.half_width_m + 0.35


@pytest.mark.parametrize("angle_rad", [0.0, np.pi / 4, np.pi / 2])
def test_no_vehicle_parks_in_a_bay(angle_rad):
    bay = Plot(40.0, 8.0, -1)
    road, boxes = parked(angle_rad, 0, [bay])
    s_m, l_m = road.locate(corners(boxes).reshape(-1, 3))
    is_right = l_m < 0
    assert not ((s_m > 40.2) & (s_m < 47.8) & is_right).any()
    assert ((s_m > 40.2) & (s_m < 47.8) & ~is_right).any()


def test_cars_hidden_in_a_row_keep_whole_boxes_and_higher_occlusion(flat_world, saloon):
    places = [(12.0 + 2.5 * number, 5.5, np.pi / 2) for number in range(4)]
    world = flat_world(cars=places)
    pose = velo_poses(world, HDL_64E, np.zeros(1))[0]
    labels = labelling.label(world, default_calibration().camera, pose, 0.0, is_tracking=False)
    assert labels.occlusion.tolist() == [0, 2, 2, 2]
    np.testing.assert_allclose(labels.boxes_velo.size_m, [saloon.size_m] * 4, rtol=1e-6)
    width_px = labels.boxes_px[:, 2] - labels.boxes_px[:, 0]
    assert (np.diff(width_px) < 0).all()


def test_housing_streets_have_parking_at_several_angles():
    configs = [world_kinds.housing_street(np.random.default_rng(seed)) for seed in range(80)]
    angles_rad = np.array([config.town.parking_rad for config in configs])
    widths_m = np.array([config.road.parking_m for config in configs])
    assert len(np.unique(angles_rad)) == 4
    assert 0.2 < (angles_rad > 0).mean() < 0.5
    assert (widths_m[angles_rad > 0] >= 4.9).all()
    assert (widths_m[angles_rad == 0] <= 2.3).all()
