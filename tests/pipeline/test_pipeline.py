"""The pipeline on a short synthetic drive: what it says against exact truth, and what it forgets."""

from dataclasses import replace

import numpy as np
import pytest

from data.synthetic.drive import SyntheticDrive
from perception.errors import MountingError, PoseError, UsageError
from perception.evaluation.ground import GROUND_CLASSES
from perception.obstacles.config import MotionConfig
from perception.pipeline import Pipeline, PipelineConfig
from perception.sensor import HDL_32E, HDL_64E, VLP_16
from perception.types import PointState

FRAMES = 6
LIDAR_ALONE = PipelineConfig.for_motion()


@pytest.fixture(scope="module")
def drive():
    return SyntheticDrive(FRAMES, images=False)


@pytest.fixture(scope="module")
def frames(drive):
    return list(drive)


def iou(said, true):
    return np.count_nonzero(said & true) / np.count_nonzero(said | true)


# Of sixteen beams few points are left in the area, and those at the foot of things weigh more.
@pytest.mark.parametrize(
    ("sensor", "min_iou"),
    [(HDL_64E, 0.95), (HDL_32E, 0.95), (VLP_16, 0.90)],
    ids=lambda value: getattr(value, "name", ""),
)
def test_ground_and_motion_on_every_sensor_without_touching_a_constant(sensor, min_iou):
    drive = SyntheticDrive(FRAMES, sensor=sensor, images=False)
    pipeline = Pipeline(sensor, LIDAR_ALONE)
    results = [pipeline.step(frame) for frame in drive]
    truth = drive.point_truth(FRAMES - 1)
    states = results[-1].obstacles.point_states
    inside = states != PointState.OUTSIDE
    on_ground = np.isin(truth.classes, GROUND_CLASSES)
    assert iou((states == PointState.GROUND)[inside], on_ground[inside]) > min_iou
    assert iou((states == PointState.MOVING)[inside], truth.is_moving[inside]) > 0.5


def test_the_pipeline_is_deterministic(frames):
    results = []
    for _ in range(2):
        pipeline = Pipeline(config=LIDAR_ALONE)
        result = [pipeline.step(frame) for frame in frames][-1]
        results.append((result.obstacles.point_states, result.world_SE3_velo))
    assert np.array_equal(results[0][0], results[1][0])
    assert np.array_equal(results[0][1], results[1][1])


def test_reset_forgets_the_drive(frames):
    pipeline = Pipeline(config=LIDAR_ALONE)
    first = pipeline.step(frames[0]).obstacles.point_states
    pipeline.step(frames[1])
    pipeline.reset()
    assert np.array_equal(pipeline.step(frames[0]).obstacles.point_states, first)


def test_without_ins_registration_carries_the_pose(drive, frames):
    pipeline = Pipeline(config=LIDAR_ALONE)
    results = [pipeline.step(replace(frame, world_SE3_velo=None)) for frame in frames]
    travelled = results[-1].world_SE3_velo[:3, 3]
    truth = np.linalg.inv(drive.true_world_SE3_velo(0)) @ drive.true_world_SE3_velo(FRAMES - 1)
    assert np.linalg.norm(travelled - truth[:3, 3]) < 0.1


def test_the_vehicle_itself_is_no_obstacle(frames):
    own = np.array([[-1.0, 1.3, -0.5, 0.2]], np.float32)
    frame = replace(frames[0], points_velo=np.concatenate([frames[0].points_velo, own]))
    assert Pipeline(config=LIDAR_ALONE).step(frame).obstacles.point_states[-1] == PointState.OUTSIDE


def test_a_frame_given_twice_gives_the_same_result(frames):
    pipeline = Pipeline(config=LIDAR_ALONE)
    for frame in frames[:3]:
        before = pipeline.step(frame)
    again = pipeline.step(frames[2])
    assert np.array_equal(again.world_SE3_velo, before.world_SE3_velo)


def test_an_ins_jump_of_metres_is_an_error_that_names_the_frame(frames):
    jumped = frames[2].world_SE3_velo.copy()
    jumped[:2, 3] += 8.0
    pipeline = Pipeline(config=LIDAR_ALONE)
    pipeline.step(frames[0])
    pipeline.step(frames[1])
    with pytest.raises(PoseError) as error:
        pipeline.step(replace(frames[2], world_SE3_velo=jumped, source="frame 2"))
    assert error.value.where == "frame 2"
    assert error.value.found.startswith("a jump of")


def test_an_upside_down_lidar_is_an_error(frames):
    points = frames[0].points_velo * np.array([1, -1, -1, 1], np.float32)
    with pytest.raises(MountingError) as error:
        Pipeline(config=LIDAR_ALONE).step(replace(frames[0], points_velo=points))
    assert error.value.found.endswith("m above the LiDAR")


def test_a_window_without_history_is_refused():
    with pytest.raises(UsageError) as error:
        MotionConfig(previous_scans=0)
    assert (error.value.where, error.value.found) == ("previous_scans", "0")


@pytest.mark.parametrize("size_m", [0.0, -1.0, float("nan")])
def test_a_voxel_without_an_edge_is_refused_before_any_frame(size_m):
    with pytest.raises(UsageError) as error:
        MotionConfig(voxel_size_m=size_m)
    assert (error.value.where, error.value.expected) == ("voxel_size_m", "above 0")
