"""The study of poses on a short street and on a written drive: a row for each LiDAR, frame rate and method."""

import json

import cv2
import numpy as np
import pytest

from benchmarks.studies.poses import planar_pose
from data.synthetic.collection import SynthConfig, write_drives
from perception.errors import UsageError
from perception.geometry.se3 import from_euler
from perception.sensor import VLP_16
from tests.faults import command, fault


def errors_of(out, *words):
    command("study", "poses", *words, "--out", out)
    assert cv2.imread(str(out)).std() > 5
    return json.loads(out.with_suffix(".json").read_text())["results"]["poses"]


def test_poses_of_streets_at_two_rates(tmp_path):
    words = ("--sensors", "VLP-16", "--rates", "5,10", "--frames", "5", "--drives", "2")
    errors = errors_of(tmp_path / "poses.png", *words)
    for rate in ("5 Hz", "10 Hz"):
        for prior in ("INS", "planar INS", "no INS"):
            one = errors[f"VLP-16, {rate}: Trifuse, {prior}"]
            assert one["step_p50_cm"] < one["step_p90_cm"] < 8
            assert one["step_max_deg"] < 0.5
            assert one["end_m"] < 0.1


def test_poses_of_a_recorded_drive_are_those_of_its_exact_ones_where_it_has_them(tmp_path, capsys):
    drive = write_drives(tmp_path, SynthConfig(frames=4, sensor=VLP_16, images=False))[0]
    errors = errors_of(tmp_path / "poses.png", drive)
    assert "VLP-16, 10 Hz: Trifuse, no INS" in errors
    assert "beside exact ones" in capsys.readouterr().out
    with fault(UsageError, where="--rates", expected="at most 10 Hz", found="20"):
        command("study", "poses", drive, "--rates", "20")


def test_a_planar_ins_keeps_roll_pitch_heading_and_place():
    pose = from_euler(0.1, 0.2, 0.3, np.array([4.0, 5.0, 6.0]))
    planar = planar_pose(pose, 2.0)
    assert planar[:3, :3] == pytest.approx(pose[:3, :3])
    assert planar[:3, 3] == pytest.approx([4.0, 5.0, 2.0 * np.cos(0.1) * np.cos(0.2)])
