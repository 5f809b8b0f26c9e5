"""The same drive in other layouts gives the same tables, by every command that measures."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from perception.errors import DriveError, UsageError
from tests.faults import command, fault
from tests.other_layouts import leave_out_instances, write_all

LAYOUTS = {
    "Argoverse 2": (),
    "nuScenes": ("--sequence", "scene-0061"),
    "SemanticKITTI": (),
}


@pytest.fixture(scope="module")
def root(make_once: Callable[[str, Callable[[Path], object]], Path]) -> Path:
    return make_once("other_layouts", write_all)


@pytest.fixture
def evaluate(root: Path, tmp_path: Path) -> Callable[..., dict[str, Any]]:
    """Return a function that evaluates the drive in a layout, with the sensor that took it."""
    sensor = root / "KITTI/training/sensor.json"

    def run(what: str, name: str, *flags: str) -> dict[str, Any]:
        report = tmp_path / f"{name}.json"
        words = (*LAYOUTS.get(name, ()), "--sensor", sensor, "--json", report, *flags)
        command("evaluate", what, root / name, *words)
        return json.loads(report.read_text())["results"]

    return run


@pytest.mark.parametrize("name", LAYOUTS)
def test_check(name, root, capsys):
    command("check", root / name, *LAYOUTS[name], "--sensor", root / "KITTI/training/sensor.json")
    assert "no faults" in capsys.readouterr().out


@pytest.mark.parametrize("name", LAYOUTS)
def test_run(name, root, tmp_path, capsys):
    out = tmp_path / "out"
    command("run", root / name, *LAYOUTS[name], "--out", out, "--frames", 2, "--no-video")
    printed = capsys.readouterr().out
    assert "points against the truth of this drive" in printed
    summary = json.loads((out / "summary.json").read_text())
    assert summary["frames"] == 2


def test_ground(evaluate, capsys):
    kitti = evaluate("ground", "KITTI")
    for name in ("Argoverse 2", "SemanticKITTI"):
        points = evaluate("ground", name)["points"]
        # A point of an object near the ground has no label in Argoverse 2.
        assert points["recall"] == pytest.approx(kitti["points"]["recall"], abs=1e-3)
        assert points["iou"] == pytest.approx(kitti["points"]["iou"], abs=1e-3)
    assert evaluate("ground", "SemanticKITTI")["points"] == kitti["points"]
    # Key frames alone have classes.
    scene = evaluate("ground", "nuScenes")["points"]
    assert 0 < scene["true_points"] < kitti["points"]["true_points"]
    assert "Ground points against exact truth" in capsys.readouterr().out


def test_labels_around_count_for_the_ground(evaluate):
    kitti, log = evaluate("ground", "KITTI")["mde"], evaluate("ground", "Argoverse 2")["mde"]
    assert log["objects"] > kitti["objects"]
    assert log["mde_m"] < 0.1


def test_obstacles(evaluate):
    kitti = evaluate("obstacles", "KITTI")
    for name in ("Argoverse 2", "SemanticKITTI"):
        moving = evaluate("obstacles", name)["points_moving"]
        assert moving["true_points"] > 0
        assert moving == kitti["points_moving"]
    assert kitti["points_moving"]["precision"] > 0.9
    # Key frames alone, the first and the third, have classes.
    first, second, third = (
        _moving_counts(evaluate("obstacles", "KITTI", "--frames", str(count)))
        for count in (1, 2, 3)
    )
    scene = evaluate("obstacles", "nuScenes")
    assert _moving_counts(scene) == pytest.approx(first + third - second)
    assert scene["points_moving"]["precision"] > 0.9
    assert scene["objects"]["objects"] > 0


def _moving_counts(results: dict[str, Any]) -> np.ndarray:
    """Return the numbers of points called moving that do move, and that do not."""
    moving = results["points_moving"]
    found = moving["recall"] * moving["true_points"]
    return np.array([found, found / moving["precision"] - found if found else 0.0])


def test_datmo(evaluate):
    flags = ("--protocol.view", "all", "--methods", "default")
    kitti, log = (evaluate("datmo", one, *flags)["default"] for one in ("KITTI", "Argoverse 2"))
    assert log["frames"] == kitti["frames"] == 4
    # Its tracks have other numbers.
    lengths = [
        sorted(one["length_m"] for one in found["objects"].values()) for found in (log, kitti)
    ]
    assert lengths[0] == pytest.approx(lengths[1])
    # To the digits of the poses in KITTI's text.
    found, known = (
        {key: value for key, value in one["by_distance"].items() if key != "per_alpha"}
        for one in (log, kitti)
    )
    assert found == pytest.approx(known, abs=1e-6)
    assert evaluate("datmo", "nuScenes", *flags)["default"]["frames"] == 4


def test_vehicles(evaluate):
    """Boxes are those of KITTI's layout; hidden ones count as what other boxes and the scan say."""
    flags = ("--detector", "labels", "--noise.sides", "0", "--noise.missing", "0")
    kitti = evaluate("vehicles", "KITTI", *flags)
    for name in ("Argoverse 2", "nuScenes"):
        found = evaluate("vehicles", name, *flags)
        assert found["location"]["0 to 25 m"]["center_p50_m"] < 0.4
        assert (
            found["location"]["0 to 25 m"]["detected"] >= kitti["location"]["0 to 25 m"]["detected"]
        )
        # Of all round, the labels in the image are found.
        cars = found["task"]["classes"]["car"]
        assert (cars["ids"], cars["tp"] + cars["fn"]) == (0, cars["objects"])
        assert 0 < cars["amota"] <= cars["recall"] < 1
    assert "task" not in kitti or kitti["task"] is None


@pytest.fixture
def points_alone(root: Path, tmp_path: Path) -> Path:
    """Return the sequence of SemanticKITTI without instances."""
    copy = shutil.copytree(root / "SemanticKITTI", tmp_path / "SemanticKITTI")
    return leave_out_instances(copy)


def test_vehicles_are_tracks_of_boxes(evaluate, points_alone):
    cars = evaluate("vehicles", "SemanticKITTI")["task"]["classes"]["car"]
    assert (cars["objects"], cars["ids"]) == (59, 0)
    assert 0.5 < cars["amota"] < cars["recall"]
    with fault(DriveError, "08", "labelled boxes that have track ids", "no boxes", "synth"):
        command("evaluate", "vehicles", points_alone)


@pytest.mark.parametrize("name", ["Argoverse 2", "nuScenes"])
def test_detection(name, evaluate, capsys):
    found = evaluate(
        "detection", name, "--detector", "depthcn", "--bootstrap", "0", "--classes", "Car"
    )
    (drive,) = found.values()
    assert drive["frames"] == 4
    assert "objects" in capsys.readouterr().out.lower()


def test_datmo_takes_boxes(points_alone):
    found = "a drive without labels with tracks"
    with fault(DriveError, "08", "labels with tracks", found, advice="with both"):
        command("evaluate", "datmo", points_alone)


@pytest.mark.parametrize(("name", "frames"), [("Argoverse 2", 4), ("nuScenes", 2), ("KITTI", 4)])
def test_detection_by_the_protocol_of_nuscenes(name, frames, evaluate):
    words = ("--protocol", "nuscenes", "--no-report", "--detection.modalities", "rgb,dm,rm")
    (drive,) = evaluate("detection", name, *words).values()
    assert drive["frames"] == frames
    car, bus = (drive["classes"][one] for one in ("car", "bus"))
    assert (car["objects"] > 10 * frames, bus["objects"]) == (name != "KITTI", 0)
    assert car["mean_ap"] > 0.05
    assert car["trans_err"] < 0.3
    # A bicycle with its rider is one box of nuScenes and KITTI; in Argoverse 2 each has its own.
    assert (drive["classes"]["bicycle"]["objects"] > 0) == (name == "nuScenes")


def test_flags_of_kittis_protocol_alone(root):
    words = ("evaluate", "detection", root / "KITTI", "--protocol", "nuscenes")
    for flag, value in (("--classes", "Car"), ("--detector", "dm"), ("--worst-frames", "frames")):
        with fault(UsageError, flag, "none, as nuScenes' detection task measures all classes"):
            command(*words, flag, value)
