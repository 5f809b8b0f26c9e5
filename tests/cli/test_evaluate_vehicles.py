"""`trifuse evaluate vehicles`: what it prints and writes of labels as detections, and what it refuses."""

import json
import shutil
from pathlib import Path

from perception.errors import DriveError
from tests.faults import command, fault


def evaluate(root: Path, *words: object) -> None:
    command("evaluate", "vehicles", root, "--detector", "labels", *words)


def test_labels_as_they_are_give_every_car_its_place_and_no_switch(
    tracking_street, tmp_path, capsys
):
    out = tmp_path / "vehicles.json"
    evaluate(tracking_street, "--noise.sides", 0, "--noise.missing", 0, "--json", out)
    printed = capsys.readouterr().out
    assert "4 of 4 frames, HDL-64E, detector labels, scores from 0.5" in printed
    document = json.loads(out.read_text())
    assert document["data"]["frames_evaluated"] == 4
    label_noise = document["configuration"]["noise"]
    assert (label_noise["sides"], label_noise["missing"]) == (0, 0)
    results = document["results"]
    near = results["location"]["0 to 25 m"]
    assert near["detected"] > 0
    assert near["boxed"] == 1
    assert near["center_p50_m"] < 0.3
    assert set(results["tracking"]) == {"car", "pedestrian"}
    for cars in (results["tracking"]["car"], results["ground_tracking"]["Car"]):
        assert cars["TP"] > 0
        assert cars["IDSW"] == 0
        assert 0.5 < cars["LocA"] <= 1
    assert results["ids"]["same_id"] <= results["ids"]["colocated"]


def test_the_same_seed_gives_the_same_and_frames_can_be_limited(tracking_street, tmp_path):
    documents = []
    for name in ("one", "other"):
        out = tmp_path / f"{name}.json"
        evaluate(tracking_street, "--noise.seed", 3, "--frames", 2, "--json", out)
        documents.append(json.loads(out.read_text())["results"])
    assert documents[0] == documents[1]


def test_a_drive_without_track_labels_is_an_error(tracking_street, tmp_path):
    shutil.copytree(tracking_street, tmp_path, dirs_exist_ok=True)
    shutil.rmtree(tmp_path / "training" / "label_02")
    with fault(DriveError, expected="labelled boxes that have track ids", found="no boxes"):
        evaluate(tmp_path)
