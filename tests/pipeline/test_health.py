"""The pipeline goes on without a sensor that fails, and with it again once it works."""

from dataclasses import replace

import numpy as np
import pytest

from data.faults.injection import Fault, inject
from data.synthetic.drive import SyntheticDrive
from perception.detection.config import NO_DETECTION
from perception.geometry.se3 import inverse
from perception.pipeline import Pipeline, PipelineConfig
from perception.types import CAMERA, INS, LIDAR, HealthLevel, PointState

FRAMES = 10


@pytest.fixture(scope="module")
def drive():
    return list(SyntheticDrive(FRAMES, images=False))


def results_with(drive, *faults):
    config = PipelineConfig(detection=NO_DETECTION, parallel=False)
    with Pipeline(config=config) as pipeline:
        return [pipeline.step(frame) for frame in inject(drive, faults)]


def test_a_dark_camera_is_not_used(street_frames, stages_in_turn):
    first, *rest = street_frames
    dark = replace(rest[0], image=np.zeros_like(rest[0].image))
    with Pipeline(config=stages_in_turn) as pipeline:
        results = [pipeline.step(frame) for frame in (first, dark, rest[1])]
    levels = [one.health.level_of(CAMERA) for one in results]
    assert levels == [HealthLevel.OK, HealthLevel.ERROR, HealthLevel.OK]
    assert ["rgb" in one.modality_detections for one in results] == [True, False, True]
    assert results[1].frame is dark


@pytest.mark.parametrize("has_image", [True, False])
def test_a_repeated_scan_is_not_used_and_the_image_is(street_frames, stages_in_turn, has_image):
    first, second, third = street_frames
    image = second.image if has_image else None
    repeated = replace(second, points_velo=first.points_velo, image=image)
    with Pipeline(config=stages_in_turn) as pipeline:
        results = [pipeline.step(frame) for frame in (first, repeated, third)]
    levels = [one.health.level_of(LIDAR) for one in results]
    assert levels == [HealthLevel.OK, HealthLevel.ERROR, HealthLevel.OK]
    used = [set(one.modality_detections) for one in results]
    assert used == [{"rgb", "dm", "rm"}, {"rgb"} if has_image else set(), {"rgb", "dm", "rm"}]
    assert [one.depthcn is None for one in results] == [False, True, False]
    assert results[1].frame is repeated
    found = results[1].vehicles
    assert (found is not None) == has_image
    if has_image:
        assert len(found) > 0 and np.isnan(found.distances_m).all()
        assert found.owners.tolist() == [-1] * len(repeated.points_velo)


def test_an_ins_that_jumps_is_not_used(drive):
    clean, faulty = results_with(drive), results_with(drive, Fault("ins-jumping", 6, 6, 30.0))
    assert [one.health.level_of(INS).name for one in faulty] == ["OK"] * 6 + ["ERROR"] + ["OK"] * 3
    assert faulty[6].health.faults == ("INS jumping",)
    off_m = [
        np.linalg.norm((a.world_SE3_velo - b.world_SE3_velo)[:3, 3])
        for a, b in zip(clean, faulty, strict=True)
    ]
    assert max(off_m) < 0.1


def test_scans_out_of_order_and_repeated_are_predicted(drive):
    faults = (Fault("lidar-out-of-order", 5, 5), Fault("lidar-repeated", 7, 7))
    faulty = results_with(drive, *faults)
    clean = results_with(drive)
    names = [one.health.faults for one in faulty]
    assert names[5:9] == [("scan out of order",), (), ("scan repeated",), ()]
    for row in (5, 7):
        assert faulty[row].health.level_of(LIDAR) is HealthLevel.ERROR
        assert (faulty[row].obstacles.point_states == PointState.OUTSIDE).all()
        assert not faulty[row].tracks.is_observed.any()
    for row in (6, 7, 9):
        off_m = (faulty[row].world_SE3_velo - clean[row].world_SE3_velo)[:3, 3]
        assert np.linalg.norm(off_m) < 0.15
    states = faulty[9].obstacles.point_states
    assert np.count_nonzero(states == PointState.GROUND) > 0.3 * len(states)


def test_without_scans_the_pose_is_that_of_the_ins(drive):
    lost = results_with(drive, Fault("lidar-lost", 6, 9))
    for row in range(6, 10):
        by_ins = inverse(drive[5].world_SE3_velo) @ drive[row].world_SE3_velo
        found = inverse(lost[5].world_SE3_velo) @ lost[row].world_SE3_velo
        np.testing.assert_allclose(found, by_ins, atol=1e-9)


def test_a_lost_scan_and_a_clock_that_was_set_do_not_stop_the_pipeline(drive):
    faulty = results_with(drive, Fault("lidar-lost", 6, 7), Fault("time-jump", 8, 9, -100.0))
    assert [one.health.faults for one in faulty][6:] == [
        ("scan lost",),
        ("scan lost",),
        ("scan out of order",),
        ("time jump",),
    ]
    assert faulty[9].frame.stamp_s < 0
