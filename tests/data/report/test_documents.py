"""Reports of JSON documents: evaluations, benchmarks, and the metrics of trainings."""

import json

import numpy as np
import plotly.graph_objects
import pytest

from data.report.document_parts import cell, heading
from data.report.report_file import write_report
from data.report.training_report import scalar_panels
from perception.errors import DriveError, UsageError
from tests.data.report.pages import read_page
from tests.faults import fault

CURVE = {"ap_r40_percent": 52.5, "curve": {"precision": [1.0] * 21 + [0.0] * 20}}
EVALUATION = {
    "measure": "detection",
    "data": {"root": "kitti", "frames": 9},
    "protocol": {"name": "KITTI"},
    "split": "none",
    "networks": {},
    "program": "trifuse 0.1.0",
    "configuration": {"frames": 9},
    "tables": [
        {"title": "AP", "header": ["", "AP [%]"], "rows": [["Car <b>", "52.5"]], "notes": ["Few."]}
    ],
    "results": {
        "classes": {
            "Car": {
                "rows": {
                    name: {"0.7": {"easy": CURVE, "moderate": CURVE}} for name in ("color", "depth")
                },
                "calibration": {
                    "color": {
                        "scores": [0.1, 0.9],
                        "shares": [0.0, 1.0],
                        "counts": [5, 5],
                        "ece": 0.1,
                    }
                },
            }
        },
        "benchmark": {"Car": {"image": {"0.7": {"easy": CURVE}}}},
    },
}
BENCH = {
    "drive": "street", "machine": "a processor", "configuration": {},
    "ground": {
        "Trifuse": {"p50_ms": 5.0, "relative_time": 1.0},
        "RANSAC": {"p50_ms": 50.0, "relative_time": 10.0},
    },
}  # fmt: skip


def page_of(document, tmp_path):
    path = tmp_path / "found.json"
    path.write_text(json.dumps(document))
    assert write_report(path) == tmp_path / "found.html"
    page = read_page(tmp_path / "found.html")
    for figure in page.data["figures"].values():
        plotly.graph_objects.Figure(figure)
    return page


def test_an_evaluation_shows_its_tables_and_curves(tmp_path):
    page = page_of(EVALUATION, tmp_path)
    assert page.texts["h1"] == ["Evaluation: detection"]
    assert page.texts["h2"] == ["Results", "Data", "Protocol", "Configuration"]
    assert page.texts["caption"] == ["AP"]
    assert {"Car <b>", "AP [%]"} <= set(page.texts["th"])
    assert "Few." in page.words
    titles = [
        "Precision-recall: Car, 0.7, moderate",
        "Reliability: detection, classes, Car, calibration",
    ]
    assert page.texts["figcaption"] == titles
    precision, reliability = page.data["figures"].values()
    assert [one["name"] for one in precision["data"]] == ["color  52.5 %", "depth  52.5 %"]
    assert sum(precision["data"][0]["y"]) == 21
    assert reliability["data"][0]["y"] == [0, 1]


def test_an_evaluation_without_printed_tables_shows_all_metrics(tmp_path):
    results = {
        "mde": {"mde_m": 0.0125, "frames": 3},
        "by_range": {"near": {"mde_m": None, "frames": 0}},
    }
    page = page_of({"measure": "ground", "results": results}, tmp_path)
    assert page.texts["caption"] == ["ground, mde", "ground, by range"]
    assert {"mde [m]", "near"} <= set(page.texts["th"])
    assert {"0.0125", "-"} <= set(page.texts["td"])


def test_a_benchmark_shows_relative_times(tmp_path):
    page = page_of(BENCH, tmp_path)
    assert page.texts["h1"] == ["Benchmark"]
    assert "street · a processor" in page.words
    (figure,) = page.data["figures"].values()
    assert figure["data"][0]["y"] == ["Trifuse", "RANSAC"]
    assert figure["data"][0]["x"] == [1, 10]
    assert "p50 [ms]" in page.texts["th"]


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("mde_m", "mde [m]"),
        ("ap_r40_percent", "ap r40 [%]"),
        ("train/loss", "train loss"),
        ("m", "m"),
    ],
)
def test_keys_are_words_with_units(key, words):
    assert heading(key) == words


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, "-"), (0.123456, "0.1235"), (3, "3"), (123456.7, "123457"), ([0.5, "a"], "0.5, a")],
)
def test_values_are_short(value, text):
    assert cell(value) == text


@pytest.mark.parametrize(
    ("text", "found"), [("no", "no JSON"), ("[1]", "a JSON list"), (None, "No such file")]
)
def test_what_is_no_report_is_an_error(text, found, tmp_path):
    path = tmp_path / "found.json"
    if text is not None:
        path.write_text(text)
    with fault(UsageError, where=str(path), expected="a JSON report", found=found):
        write_report(path)


def test_a_folder_of_another_kind_is_an_error(tmp_path):
    with fault(DriveError, where=str(tmp_path), expected="`trifuse run`", found="another"):
        write_report(tmp_path)


def write_training(folder):
    from torch.utils.tensorboard import SummaryWriter

    with SummaryWriter(folder) as writer:
        for step in range(3):
            writer.add_scalar("train/loss", 3.0 - step, step)
            writer.add_scalar("validation/loss", 4.0 - step, step)
            writer.add_scalar("speed/samples_per_s", 50.0, step)
    (folder / "metrics.json").write_text(json.dumps({"epoch": 2, "precision": {"Car 0.7": CURVE}}))
    (folder / "config.yaml").write_text("# trifuse 0.1.0: train detector\nseed: 0\n")


def test_a_training_shows_its_curves_and_its_best_epoch(tmp_path):
    write_training(tmp_path)
    assert write_report(tmp_path) == tmp_path / "report.html"
    page = read_page(tmp_path / "report.html")
    assert page.texts["h2"] == ["Training", "Best epoch", "Configuration"]
    loss, speed, precision = page.data["figures"].values()
    assert [(one["name"], one["y"]) for one in loss["data"]] == [
        ("train", [3, 2, 1]),
        ("validation", [4, 3, 2]),
    ]
    assert speed["data"][0]["y"] == [50, 50, 50]
    assert precision["data"][0]["name"] == "Car 0.7  52.5 %"


def test_damaged_metrics_are_an_error(tmp_path):
    (tmp_path / "metrics.json").write_text("{")
    with fault(UsageError, where="metrics.json", expected="metrics of a training", found="no JSON"):
        write_report(tmp_path)


def test_panels_are_in_the_order_of_interest():
    panels = scalar_panels({"speed/x": {0: 1.0}, "train/loss": {1: 2.0, 0: 1.0}, "lr": {0: 0.1}})
    assert [panel.title for panel in panels] == ["loss", "lr", "x"]
    np.testing.assert_array_equal(panels[0].curves[0].x, [0, 1])
