"""Moving object segmentation by scene: what a scene's drive is, and what the study counts of it."""

import json

import cv2
import numpy as np
import pytest

from benchmarks.studies import motion_scenes
from benchmarks.studies.motion_scenes import MotionScene, MotionScenesConfig, measure_scene
from data.synthetic.world_kinds import STREETS
from perception.errors import UsageError
from perception.sensor import SENSORS
from perception.types import PointTruth
from tests.faults import command, fault


def test_scenes_name_streets_and_sensors():
    for scene in motion_scenes.SCENES.values():
        assert scene.street in STREETS
        assert scene.sensor in SENSORS


def test_a_scene_counts_all_scans_but_the_first(monkeypatch):
    monkeypatch.setattr(
        motion_scenes, "SCENES", {"x": MotionScene("town", "VLP-16", 2.0, has_ins=False)}
    )
    found = measure_scene(("default", "x", 3), 3, MotionScenesConfig(reach_m=30.0).area)
    assert list(found) == ["all", "under 2 m/s", "2 to 5 m/s", "5 to 10 m/s", "over 10 m/s"]
    assert found["all"].scans == 2
    assert found["all"].objects == sum(one.objects for name, one in found.items() if name != "all")
    assert found["all"].points.true_points > 0


def test_what_rolls_to_a_halt_is_neither_moving_nor_static():
    truth = PointTruth(np.full(5, 10), np.arange(5), np.array([False, True, False, False, False]))
    without = motion_scenes._without_creeping(truth, {1: 0.05, 2: 0.05, 3: 0.001, 4: 0.5})
    assert without.classes.tolist() == [10, 10, 0, 10, 10]


@pytest.mark.slow
def test_the_study_has_a_row_a_scene(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(motion_scenes, "SCENES", {"x": MotionScene("town", "VLP-16")})
    out = tmp_path / "scenes.png"
    command("study", "motion-scenes", "--frames", "3", "--workers", "1", "--out", str(out))
    results = json.loads(out.with_suffix(".json").read_text())["results"]
    assert list(results) == ["default", "thesis", "speeds"]
    assert results["thesis"]["x"] == results["thesis"]["Total"]
    assert cv2.imread(str(out)).std() > 5
    assert "false clusters/scan" in capsys.readouterr().out


def test_the_reach_is_above_0():
    with fault(UsageError, "--reach-m", expected="a reach above 0", found="0"):
        command("study", "motion-scenes", "--reach-m", "0")
