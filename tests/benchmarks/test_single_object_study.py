"""The study of following: what is measured on scenes with exact truth, and what it leaves."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from benchmarks.studies import single_object
from benchmarks.studies.single_object import (
    SingleObjectStudyConfig,
    reacquisition_time_s,
)
from data.synthetic.scenarios import Scenario, ScenarioChallenge, ScenarioDrive, true_track
from perception.errors import UsageError
from perception.evaluation.single_object.metrics import single_object_errors
from perception.evaluation.single_object.track import PredictedTrack, TrueTrack
from perception.types import Boxes3D
from tests.faults import command, fault

FRAMES = 10


def truth_hidden_in(*hidden: int) -> TrueTrack:
    boxes_px = np.tile([10.0, 10, 20, 20], (FRAMES, 1))
    boxes_px[list(hidden)] = np.nan
    bottoms = np.column_stack([np.arange(FRAMES), np.zeros(FRAMES), np.zeros(FRAMES)])
    return TrueTrack(
        np.arange(FRAMES),
        0.1 * np.arange(FRAMES),
        Boxes3D(bottoms.astype(float), np.ones((FRAMES, 3)), np.zeros(FRAMES)),
        boxes_px,
        np.zeros((FRAMES, 2)),
        np.zeros(FRAMES, np.int64),
    )


def tracked_as(truth: TrueTrack, off_m, states) -> PredictedTrack:
    boxes = truth.boxes_velo
    bottoms = boxes.bottom_m + np.array(off_m)[:, None] * (0, 1, 0)
    return PredictedTrack(
        truth.frames,
        np.array(states),
        replace(boxes, bottom_m=bottoms),
        np.full((FRAMES, 4), np.nan),
        np.zeros((FRAMES, 2)),
        np.full(FRAMES, 0.002),
    )


@pytest.mark.parametrize(
    ("off_m", "states", "seconds"),
    [
        ([0.0] * 10, ["seen"] * 10, 0.1),
        ([0.0] * 10, ["seen"] * 6 + ["lost", "predicted"] + ["seen"] * 2, 0.3),
        ([0.0] * 6 + [3.0] * 3 + [0.2], ["seen"] * 10, 0.4),
        ([0.0] * 4 + [3.0] * 6, ["seen"] * 10, np.inf),
    ],
)
def test_reacquired_is_observed_and_near_after_occlusion(off_m, states, seconds):
    truth = truth_hidden_in(4, 5)
    errors = single_object_errors(truth, tracked_as(truth, off_m, states))
    assert reacquisition_time_s(truth, errors) == pytest.approx(seconds)


def test_an_object_that_was_never_hidden_has_no_reacquisition_time():
    truth = truth_hidden_in()
    errors = single_object_errors(truth, tracked_as(truth, [0.0] * 10, ["seen"] * 10))
    assert np.isnan(reacquisition_time_s(truth, errors))


def test_the_truth_of_a_scene_is_exact_and_marks_occlusion():
    scenario = Scenario("Car", frozenset([ScenarioChallenge.OCCLUSION]))
    track = true_track(ScenarioDrive(scenario, images=False))
    assert len(track) == 60
    hidden = np.flatnonzero(np.isnan(track.boxes_px[:, 0]))
    assert 5 < len(hidden) < 25
    assert 15 < hidden.mean() < 30
    assert (track.occlusion[hidden] == 2).all()
    assert track.occlusion[0] == 0
    # Both drive ahead at six metres a second.
    np.testing.assert_allclose(track.velocities_m_s, np.tile([6.0, 0.0], (60, 1)), atol=0.1)


@pytest.mark.slow
def test_the_study_writes_plot_numbers_and_table(tmp_path, monkeypatch, capsys):
    scenarios = [
        Scenario("Car", challenges, 0.5)
        for challenges in (frozenset[ScenarioChallenge](), frozenset([ScenarioChallenge.POSE]))
    ]
    monkeypatch.setattr("data.synthetic.scenarios.all_scenarios", lambda *_: scenarios)
    config = SingleObjectStudyConfig(("default", "3d-kf"), "Car", 0.5)
    plot_path = tmp_path / "single-object.png"
    single_object.single_object(config=config, sensor="VLP-16", out=plot_path)
    assert cv2.imread(str(plot_path)).std() > 5
    document = json.loads(plot_path.with_suffix(".json").read_text())
    rows = document["results"]["trackers"]
    assert list(rows) == ["baseline: default", "baseline: 3d-kf", "pose: default", "pose: 3d-kf"]
    for scene in ("baseline", "pose"):
        assert rows[f"{scene}: default"]["center_m"] < 0.5
        assert rows[f"{scene}: default"]["reacquired_s"] is None  # never hidden
    assert "\npose: 3d-kf " in capsys.readouterr().out


@pytest.mark.parametrize(
    ("flag", "value", "expected", "found"),
    [
        ("--trackers", "default,goat", "some of default", "goat"),
        ("--duration-s", "0.1", "at least 0.5 s", "0.1 s"),
        ("--sensor", "HDL-65", "one of HDL-64E", "neither"),
    ],
)
def test_unusable_flags_are_an_error(flag, value, expected, found):
    with fault(UsageError, expected=expected, found=found):
        command("study", "single-object", flag, value)
