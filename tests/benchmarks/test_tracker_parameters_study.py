"""The studies of the gate and of the iterations of the thesis' baselines."""

import json

import cv2
import pytest

from data.synthetic.scenarios import Scenario
from perception.errors import UsageError
from tests.faults import command, fault


@pytest.mark.slow
def test_each_value_of_each_parameter_is_measured(tmp_path, monkeypatch, capsys):
    scenarios = [Scenario("Car", duration_s=0.5)]
    monkeypatch.setattr("data.synthetic.scenarios.all_scenarios", lambda *_: scenarios)
    plot_path = tmp_path / "parameters.png"
    words = ("--gates", "1,6", "--iterations", "3,5", "--sensor", "VLP-16", "--out", plot_path)
    command("study", "tracker-parameters", "synthetic", *words)
    assert cv2.imread(str(plot_path)).std() > 5
    document = json.loads(plot_path.with_suffix(".json").read_text())
    rows = document["results"]["trackers"]
    assert list(rows) == [
        "3d-kf, gate 1",
        "3d-kf, gate 6",
        "3d-ms, 3 iterations",
        "3d-ms, 5 iterations",
    ]
    # Six boxes around the car hold other points, too.
    assert rows["3d-kf, gate 1"]["center_m"] != rows["3d-kf, gate 6"]["center_m"]
    assert rows["3d-ms, 3 iterations"]["overlap_success"] == 1
    assert document["conditions"]["config"]["gates"] == [1, 6]
    assert "\n3d-ms, 5 iterations " in capsys.readouterr().out


@pytest.mark.parametrize(("flag", "value"), [("--gates", "1,0"), ("--iterations", "-1")])
def test_values_that_are_not_positive_are_an_error(flag, value):
    with fault(UsageError, where=flag, expected="values above 0"):
        command("study", "tracker-parameters", "synthetic", f"{flag}={value}")
