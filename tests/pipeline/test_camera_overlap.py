"""Where the images of two cameras overlap, each object of a street is one vehicle."""

import numpy as np

from data.synthetic.drive import SyntheticDrive
from data.synthetic.rig import camera_calibration
from data.synthetic.world_kinds import STREETS
from perception.geometry.box_overlap import iou_bev
from perception.geometry.camera import box_outlines_px
from perception.pipeline import Pipeline
from perception.sensor import HDL_32E
from perception.types import Boxes3D

CAMERAS = ("front", "front_left")


def are_in_both_images(boxes: Boxes3D):
    rigs = [camera_calibration(camera) for camera in CAMERAS]
    outlines_px = [box_outlines_px(one.image_P_velo, boxes, one.image_size_px) for one in rigs]
    return np.all(
        [np.ptp(px.reshape(-1, 2, 2), axis=1).min(axis=1) > 15 for px in outlines_px], axis=0
    )


def test_no_object_is_a_vehicle_of_each_camera():
    town = STREETS["town"](np.random.default_rng(402))
    drive = SyntheticDrive(5, seed=402, sensor=HDL_32E, config=town, cameras=CAMERAS)
    found = in_both = 0
    with Pipeline(drive.sensor) as pipeline:
        for frame in drive:
            vehicles = pipeline.step(frame).vehicles
            has_box = np.isfinite(vehicles.boxes.yaw_rad) & (vehicles.ids >= 0)
            sure = vehicles.select(np.flatnonzero(has_box))
            objects = drive.labels_around(frame.index).boxes_velo
            is_of = iou_bev(objects, sure.boxes) > 0.1
            for row in is_of:
                assert len(set(sure.cameras[row].tolist())) <= 1
            seen = is_of.any(axis=1)
            found += seen.sum()
            in_both += (seen & are_in_both_images(objects)).sum()
    # Over five frames; the overlap of the images is narrow.
    assert found >= 8
    assert in_both >= 2
