"""The LiDAR stages in another process: same results, its errors here, and nothing left behind."""

import os
import signal
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from perception.errors import PerceptionError, PoseError
from perception.pipeline import PipelineConfig
from perception.pipeline.lidar_process import LidarProcess
from perception.pipeline.lidar_stages import LidarStages
from perception.pipeline.workers import StageClock
from perception.sensor import HDL_64E

CONFIG = PipelineConfig.for_motion()
STAGES = ["registration", "ground", "voxels", "static and moving", "moving objects"]


@pytest.fixture(scope="module")
def process():
    with closing(LidarProcess(HDL_64E, CONFIG)) as process:
        yield process


@pytest.fixture
def fresh(process):
    process.reset()
    return process


def jumped(frame):
    pose = frame.world_SE3_velo.copy()
    pose[0, 3] += 30.0
    return replace(frame, world_SE3_velo=pose)


def test_equals_the_stages_of_this_process(street_frames, fresh):
    stages = LidarStages(HDL_64E, CONFIG)
    for frame in street_frames:
        here, there = stages.step(frame, StageClock()), fresh.step(frame, StageClock())
        np.testing.assert_array_equal(there.world_SE3_velo, here.world_SE3_velo)
        np.testing.assert_array_equal(there.obstacles.point_states, here.obstacles.point_states)
        np.testing.assert_array_equal(there.tracks.ids, here.tracks.ids)
        assert there.is_reset == here.is_reset
        places = frame.points_velo[::500]
        np.testing.assert_array_equal(
            there.ground.distance_m(places), here.ground.distance_m(places)
        )
    assert there.of_frame(frame).frame is frame


def test_stages_are_timed_by_the_clock_that_is_given(street_frames, fresh):
    clock = StageClock("obstacles")
    spans = fresh.step(street_frames[0], clock).spans
    assert [span.stage for span in spans] == STAGES
    assert {span.worker for span in spans} == {"obstacles"}
    edges = [edge for span in spans for edge in (span.start_s, span.stop_s)]
    assert edges[0] >= 0
    assert edges == sorted(edges)


def test_an_error_comes_here_and_the_process_goes_on(street_frames, fresh):
    fresh.step(street_frames[0], StageClock())
    with pytest.raises(PoseError) as error:
        fresh.step(jumped(street_frames[1]), StageClock())
    assert error.value.where == street_frames[1].source
    assert not fresh.step(street_frames[1], StageClock()).is_reset
    fresh.reset()
    assert fresh.step(jumped(street_frames[1]), StageClock()).is_reset


def test_an_interrupt_is_left_to_the_one_that_started_it(street_frames, fresh):
    os.kill(fresh.process_id, signal.SIGINT)
    assert fresh.step(street_frames[0], StageClock()).is_reset


def test_modules_in_the_working_folder_are_not_imported(street_frames, monkeypatch, tmp_path):
    (tmp_path / "perception").mkdir()
    for name in ("perception/__init__", "random", "types", "numpy"):
        (tmp_path / f"{name}.py").write_text("raise RuntimeError('a file of the user')\n")
    monkeypatch.chdir(tmp_path)
    with closing(LidarProcess(HDL_64E, CONFIG)) as process:
        assert process.step(street_frames[0], StageClock()).is_reset


def test_one_that_has_ended_is_said_to_have(street_frames):
    process = LidarProcess(HDL_64E, CONFIG)
    process.reset()
    os.kill(process.process_id, signal.SIGKILL)
    with pytest.raises(PerceptionError) as error:
        process.step(street_frames[0], StageClock())
    assert error.value.where == "process of the LiDAR stages"
    assert error.value.found.endswith("exit code -9")
    process.close()


def test_closing_ends_it_and_leaves_nothing(street_frames):
    process = LidarProcess(HDL_64E, CONFIG)
    process.close()
    with pytest.raises(ProcessLookupError):
        os.kill(process.process_id, 0)
    with pytest.raises(PerceptionError) as error:
        process.step(street_frames[0], StageClock())
    assert error.value.where == "process of the LiDAR stages"


def test_without_a_python_to_start_it_says_what_to_do(monkeypatch, tmp_path):
    monkeypatch.setattr("sys.executable", str(tmp_path / "python"))
    with pytest.raises(PerceptionError) as error:
        LidarProcess(HDL_64E, CONFIG)
    assert error.value.where == f"process of {tmp_path / 'python'}"
    assert error.value.advice == "pass --pipeline.no-parallel"
