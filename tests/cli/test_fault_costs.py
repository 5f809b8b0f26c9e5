"""`trifuse evaluate robustness --faults`: kinds with sizes, and finished runs that are not made again."""

import json

import pytest

from data.faults.fault_runs import kinds_and_sizes
from data.results.finished_runs import FinishedRuns
from perception.errors import UsageError
from perception.evaluation.fault_cost import FaultCost
from tests.faults import fault

COST = FaultCost("lidar-fog", 0.1, 0.05, float("nan"), 0.8, 0.7, 1.0)


def test_a_kind_without_a_size_has_all_sizes():
    assert list(kinds_and_sizes(("camera-dirty", "lidar-fog:0.2"))) == [
        ("camera-dirty", 0.1),
        ("camera-dirty", 0.2),
        ("camera-dirty", 0.35),
        ("camera-dirty", 0.5),
        ("lidar-fog", 0.2),
    ]
    assert {kind for kind, _ in kinds_and_sizes(("all",))} > {"calibration-yaw", "ins-absent"}


@pytest.mark.parametrize(("text", "found"), [("snow", "snow"), ("lidar-fog:x", "lidar-fog:x")])
def test_an_unknown_kind_or_size_is_an_error(text, found):
    with fault(UsageError, expected="KIND" if ":" in text else "lidar-fog", found=found):
        list(kinds_and_sizes((text,)))


def test_finished_runs_are_read_back(tmp_path):
    path = tmp_path / "runs.json"
    FinishedRuns.open(path, {"frames": 60}, FaultCost).add("lidar-fog 0.1", COST)
    (name, cost), *others = FinishedRuns.open(path, {"frames": 60}, FaultCost).metrics.items()
    assert (name, str(cost), others) == ("lidar-fog 0.1", str(COST), [])


def test_runs_without_a_file_are_kept_in_memory():
    runs = FinishedRuns.open(None, {}, FaultCost)
    runs.add("none", COST)
    assert runs.metrics == {"none": COST}


def test_runs_of_another_configuration_are_an_error(tmp_path):
    path = tmp_path / "runs.json"
    FinishedRuns.open(path, {"frames": 60}, FaultCost).add("lidar-fog 0.1", COST)
    with fault(UsageError, expected="the same command", found="other frames"):
        FinishedRuns.open(path, {"frames": 61}, FaultCost)


@pytest.mark.parametrize("text", ["", "[]", "{}", json.dumps({"runs": {"none": {"x": 1}}})])
def test_a_damaged_file_is_an_error(text, tmp_path):
    path = tmp_path / "runs.json"
    path.write_text(text)
    with fault(UsageError, expected="the same command", found="a damaged file"):
        FinishedRuns.open(path, {}, FaultCost)
