"""KITTI's label rules on scenes small enough to reason about."""

import numpy as np
import pytest

from data.synthetic import labelling, meshes
from data.synthetic.lidar import velo_poses
from data.synthetic.materials import Slot, palette
from data.synthetic.rig import PinholeCamera, default_calibration
from data.synthetic.street import Part
from data.synthetic.world import World
from perception.geometry.boxes import corners, points_inside, transform_boxes
from perception.geometry.camera import project
from perception.sensor import HDL_64E
from perception.types import Labels


def label(world: World, *, is_tracking: bool = False) -> Labels:
    pose = velo_poses(world, HDL_64E, np.zeros(1))[0]
    camera = default_calibration().camera
    return labelling.label(world, camera, pose, 0.0, is_tracking=is_tracking)


def screen(low_y: float, high_y: float) -> Part:
    """Stand a wall between the camera and a car 15 m ahead."""
    return Part(meshes.box((8.0, low_y, 0.0), (8.1, high_y, 4.0), Slot.WALL), palette())


def test_a_car_ahead_is_labelled_where_it_is(flat_world):
    found = label(flat_world(cars=[(15.0, 0.0, 0.0)]))
    assert list(found.types) == ["Car"]
    assert found.boxes_velo.bottom_m[0] == pytest.approx([15.0, 0.0, -1.73], abs=1e-6)
    assert found.boxes_velo.yaw_rad[0] == pytest.approx(0.0, abs=1e-9)
    assert (found.truncation[0], found.occlusion[0]) == (0.0, 0)
    assert len(found.dont_care_px) == 0


@pytest.mark.parametrize(("covered_to_y", "level"), [(-1.2, 0), (0.0, 1), (0.35, 2)])
def test_occlusion_grows_as_a_wall_covers_the_car(flat_world, covered_to_y, level):
    found = label(flat_world([screen(-4.0, covered_to_y)], cars=[(15.0, 0.0, 0.0)]))
    assert found.occlusion.tolist() == [level]


def test_a_car_behind_a_wall_is_no_label_and_no_region(flat_world):
    found = label(flat_world([screen(-4.0, 4.0)], cars=[(15.0, 0.0, 0.0)]))
    assert len(found) == 0
    assert len(found.dont_care_px) == 0


def test_a_car_that_peeps_out_is_a_dont_care_region(flat_world):
    found = label(flat_world([screen(-4.0, 0.42)], cars=[(15.0, 0.0, 0.0)]))
    assert len(found) == 0
    assert len(found.dont_care_px) == 1


def test_far_and_behind(flat_world):
    found = label(flat_world(cars=[(100.0, 0.0, 0.0), (-10.0, 0.0, 0.0)]))
    assert len(found) == 0
    assert len(found.dont_care_px) == 1


def test_truncation_at_the_image_edge(flat_world):
    # The image reaches 0.85 m to the side for each metre ahead: this car's centre is on its edge.
    world = flat_world(cars=[(10.0, 8.5, 0.0)])
    share, level = label(world), label(world, is_tracking=True)
    assert 0.3 < share.truncation[0] < 0.7
    assert level.truncation[0] in (1, 2)
    assert share.boxes_px[0, 0] == pytest.approx(0, abs=1e-6)
    assert label(flat_world(cars=[(15.0, 0.0, 0.0)]), is_tracking=True).truncation[0] == 0


def test_small_cars_have_unknown_occlusion(flat_world):
    found = label(flat_world(cars=[(75.0, 0.0, 0.0)]))
    assert found.occlusion.tolist() == [3]
    height = found.boxes_px[0, 3] - found.boxes_px[0, 1]
    assert 12 <= height < 16


def test_boxes_hold_the_points_of_their_objects(street_drive):
    for index in (0, 20, 39):
        labels, scan = street_drive.labels(index), street_drive.scan(index)
        inside = points_inside(labels.boxes_velo, scan.points_velo, margin_m=0.25)
        for row, track in enumerate(labels.track_ids):
            own = scan.truth.instances == track + 1
            if own.sum() >= 30:
                assert inside[row, own].mean() > 0.9, (index, track, labels.types[row])


def test_points_of_an_object_fall_into_its_2d_box(street_drive):
    checked = 0
    for index in (0, 20, 39):
        labels, scan = street_drive.labels(index), street_drive.scan(index)
        pixels, _ = project(street_drive.calibration.image_P_velo, scan.points_velo)
        for row, track in enumerate(labels.track_ids):
            own = pixels[scan.truth.instances == track + 1]
            with np.errstate(invalid="ignore"):
                own = own[((own >= 0) & (own < (1242, 375))).all(axis=1)]
            if len(own) < 20:
                continue
            low, high = labels.boxes_px[row, :2] - 6, labels.boxes_px[row, 2:] + 6
            assert ((own > low) & (own < high)).all(axis=1).mean() > 0.95
            checked += 1
    assert checked > 10


def test_the_box_of_a_vehicle_is_its_cuboid_as_the_camera_sees_it(flat_world, saloon):
    found = label(flat_world(cars=[(20.0, 3.0, 0.4)]))
    pose = velo_poses(flat_world(), HDL_64E, np.zeros(1))[0]
    camera = PinholeCamera(default_calibration().camera, pose)
    corners_m = corners(transform_boxes(pose, found.boxes_velo))[0]
    pixels, _ = camera.project(corners_m)
    np.testing.assert_allclose(
        found.boxes_px[0], [*pixels.min(axis=0), *pixels.max(axis=0)], atol=1e-3
    )
    np.testing.assert_allclose(found.boxes_velo.size_m[0], saloon.size_m, rtol=1e-6)
