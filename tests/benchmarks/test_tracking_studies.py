import json
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from benchmarks.studies import sensors
from benchmarks.studies.ins_error import InsErrorConfig, ins_error
from benchmarks.studies.report import StreetFlags
from benchmarks.studies.tracking_metrics import METHODS, by_metric, total
from data.synthetic.ins import InsNoise
from perception.errors import UsageError
from perception.evaluation.multi_object.mot_metrics import evaluate_tracks
from perception.evaluation.multi_object.sequence import TrackedFrame
from perception.sensor import HDL_32E, VLP_16
from tests.faults import command, fault

NAMES = ["HOTA [%]", "MOTA [%]", "IDF1 [%]", "false tracks [/min]"]


def report(found: int, missed: int, false_tracks: int) -> SimpleNamespace:
    """Return what comes of one object, perfectly tracked in some frames and missed in others."""
    hit = TrackedFrame(np.array([1]), np.array([7]), np.ones((1, 1)))
    miss = TrackedFrame(np.array([1]), np.zeros(0, np.int64), np.zeros((1, 0)))
    scores = evaluate_tracks([hit] * found + [miss] * missed)
    return SimpleNamespace(
        by_distance=scores,
        false_tracks=SimpleNamespace(ids=range(false_tracks)),
        duration_s=0.1 * (found + missed),
    )


def test_drives_are_measured_as_one():
    measures = total([{"thesis": report(10, 0, 1)}, {"thesis": report(5, 5, 0)}])["thesis"]
    assert list(measures) == NAMES
    assert measures["MOTA [%]"] == pytest.approx(75)  # 15 of 20 boxes
    assert measures["IDF1 [%]"] == pytest.approx(100 * 30 / 35)
    assert measures["false tracks [/min]"] == pytest.approx(30)


def test_measures_go_case_by_case():
    cases = [total([dict.fromkeys(METHODS, report(n, 10 - n, 0))]) for n in (10, 5)]
    np.testing.assert_allclose(by_metric(cases)["MOTA [%]"]["author"], [100, 50])


def test_every_ins_is_measured_once():
    cases = InsErrorConfig(positions_m=(0.0, 1.0), angles_deg=(0.0, 2.0)).cases()
    assert cases == [InsNoise(0, 0), InsNoise(1, 0), InsNoise(0, 2)]


@pytest.mark.slow
def test_ins_error(tmp_path, capsys):
    config = InsErrorConfig(positions_m=(0.0, 1.0), angles_deg=(0.0, 2.0))
    plot_path = tmp_path / "ins.png"
    ins_error(streets=StreetFlags(3), config=config, sensor="VLP-16", out=plot_path)
    assert cv2.imread(str(plot_path)).std() > 5
    document = json.loads(plot_path.with_suffix(".json").read_text())
    rows = document["results"]["tracks"]
    cases = ("0 m, 0°", "1 m, 0°", "0 m, 2°")
    assert list(rows) == [f"{case}: {method}" for case in cases for method in METHODS]
    assert all(0 <= row["HOTA [%]"] <= 100 for row in rows.values())
    assert document["conditions"]["protocol"]["view"] == "all"
    words = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert sum(line[:3] == ["1", "m,", "0°:"] for line in words) == len(METHODS)


def test_sensors(tmp_path, monkeypatch, capsys):
    # The measuring itself is that of the study above: here, what becomes of it.
    found = {"HDL-32E": {0: 10, 1: 10}, "VLP-16": {0: 6, 1: 2}}
    monkeypatch.setattr(
        "data.synthetic.drive.SyntheticDrive", lambda _, seed, sensor, images: (sensor, seed)
    )
    monkeypatch.setattr(
        sensors,
        "measure_methods",
        lambda drive: dict.fromkeys(
            METHODS, report(n := found[drive[0].name][drive[1]], 10 - n, 1)
        ),
    )
    plot_path = tmp_path / "sensors.png"
    monkeypatch.setattr(sensors, "SENSORS", (HDL_32E, VLP_16))
    sensors.sensors(streets=StreetFlags(10, drives=2), out=plot_path)
    rows = json.loads(plot_path.with_suffix(".json").read_text())["results"]["tracks"]
    assert cv2.imread(str(plot_path)).std() > 5
    for sensor, share in (("HDL-32E", 100), ("VLP-16", 40)):
        for method in METHODS:
            row = rows[f"{sensor}: {method}"]
            assert list(row) == NAMES
            assert row["MOTA [%]"] == pytest.approx(share)
            assert row["false tracks [/min]"] == pytest.approx(60)
    assert capsys.readouterr().out.count(": default") == 2


@pytest.mark.parametrize(
    ("words", "where", "expected"),
    [
        ("ins-error --frames 0", "--frames", "at least 1"),
        ("ins-error --sensor HDL-65", "HDL-65", "one of HDL-64E, HDL-32E, VLP-16"),
        ("sensors --drives 0", "--drives", "at least 1"),
    ],
)
def test_unusable_flags_are_an_error(words, where, expected):
    with fault(UsageError, where=where, expected=expected):
        command("study", *words.split())
