"""Errors of registered motions against exact poses."""

import numpy as np
import pytest

from benchmarks.registration import compare_registration, motion_errors
from benchmarks.stages import prepare
from data.derived.moving_methods import true_poses
from data.open_drive import open_drive
from data.synthetic.collection import SynthConfig, write_drives
from data.synthetic.drive import SyntheticDrive
from perception.geometry.se3 import from_euler, from_rotation_translation
from perception.pipeline import PipelineConfig
from perception.sensor import VLP_16


def straight_poses(frames, step_m):
    return [from_rotation_translation(np.eye(3), (step_m * k, 0, 0)) for k in range(frames)]


def test_exact_poses_of_another_world_have_no_error():
    truth = straight_poses(13, 1.0)
    world = from_euler(0.0, 0.0, 0.7, np.array([5.0, -3.0, 1.0]))
    errors = motion_errors([world @ pose for pose in truth], np.array(truth))
    assert errors.shape == (3, 4, 4)  # of a second each
    assert errors == pytest.approx(np.tile(np.eye(4), (3, 1, 1)))


def test_steps_too_long_by_a_centimetre_add_up_to_ten_in_a_second():
    errors = motion_errors(straight_poses(12, 1.01), np.array(straight_poses(12, 1.0)))
    assert errors[:, 0, 3] == pytest.approx([0.1, 0.1])


def test_a_drive_shorter_than_a_second_is_measured_as_a_whole():
    errors = motion_errors(straight_poses(4, 1.01), np.array(straight_poses(4, 1.0)))
    assert errors[:, 0, 3] == pytest.approx([0.03])


def test_exact_poses_of_a_written_drive_are_those_of_its_ins_but_for_its_noise(tmp_path):
    config = SynthConfig(frames=2, sensor=VLP_16, images=False)
    drive = open_drive(write_drives(tmp_path, config)[0])
    poses_ins = [frame.world_SE3_velo for frame in drive]
    assert np.array(true_poses(drive)) == pytest.approx(np.array(poses_ins), abs=0.2)


def test_without_exact_poses_errors_are_those_beside_the_ins():
    frames = list(SyntheticDrive(3, sensor=VLP_16, images=False))
    prepared = prepare(frames, 3, PipelineConfig.for_obstacles())
    table = compare_registration(prepared)
    assert table.title == "registration, errors beside the INS"
    rows = {name: dict(zip(table.header[1:], cells, strict=True)) for name, *cells in table.cells}
    assert 0 < float(rows["Trifuse"]["1 s p50 [mm]"]) < 100
