"""What a run tells of vehicles, with networks that call what is bright a car: files of a sequence, and of single frames."""

import json
from pathlib import Path

import numpy as np
import pytest

from data.kitti.detection_rows import read_detection_set
from data.kitti.tracking_rows import read_result_rows
from data.results.documents import to_serializable
from data.results.objects import FrameVehicles
from data.results.records import read_records
from perception.cli.main import main
from perception.types import DETECTOR_MODALITIES, MODALITIES
from tests.car_frames import write_car_frames_with_a_gap
from tests.detection.bright_cells import bright_cells


@pytest.fixture(scope="module")
def networks(tmp_path_factory) -> list[str]:
    """Return the flags that name a network for each view."""
    folder = tmp_path_factory.mktemp("networks")
    flags = ["--pipeline.detection.method", "thesis"]
    for modality in MODALITIES:
        path = folder / f"{modality}.onnx"
        path.write_bytes(bright_cells(modality))
        flags += [f"--pipeline.detection.{modality}-model", str(path)]
    return flags


@pytest.fixture(scope="module")
def cars(tmp_path_factory) -> Path:
    """Return object frames 0, 2 and 3, as `car_frames` does, for all tests of the run."""
    return write_car_frames_with_a_gap(tmp_path_factory.mktemp("frames") / "cars")


@pytest.fixture(scope="module")
def run_of_cars(cars, networks, tmp_path_factory) -> Path:
    """Run the object frames 0, 2 and 3."""
    out = tmp_path_factory.mktemp("out")
    words = ["run", str(cars), "--out", str(out), "--video", "false"]
    assert main([*words, "--min-vehicle-score", "0", *networks]) == 0
    return out


def test_result_files_are_named_as_frames_and_read_by_our_evaluator(run_of_cars, cars):
    assert sorted(path.name for path in (run_of_cars / "data").iterdir()) == [
        *("000000.txt", "000002.txt", "000003.txt")
    ]
    found = read_detection_set(run_of_cars, cars / "training").detections
    lines = [json.loads(line) for line in (run_of_cars / "vehicles.jsonl").read_text().splitlines()]
    assert [line["frame"] for line in lines] == [0, 1, 2]
    told = [vehicle for line in lines for vehicle in line["vehicles"]]
    assert len(told) == len(found.scores) > 0
    np.testing.assert_allclose([one["score"] for one in told], found.scores, atol=1e-4)
    for path in (run_of_cars / "data").iterdir():
        rows = [line.split() for line in path.read_text().splitlines()]
        assert {len(row) for row in rows} <= {16}
        assert {tuple(row[:3]) for row in rows} <= {("Car", "-1", "-1")}


def test_frames_that_are_no_sequence_have_no_tracks_of_vehicles(run_of_cars):
    assert not (run_of_cars / "vehicles").exists()
    lines = (run_of_cars / "vehicles.jsonl").read_text().splitlines()
    assert {one["id"] for line in lines for one in json.loads(line)["vehicles"]} == {None}
    assert json.loads((run_of_cars / "summary.json").read_text())["vehicles"]["ids"] == 0


def test_every_vehicle_has_the_scores_of_its_detectors(run_of_cars):
    lines = read_records(run_of_cars / "vehicles.jsonl", FrameVehicles)
    written = [json.loads(line) for line in (run_of_cars / "vehicles.jsonl").open()]
    assert [to_serializable(line) for line in lines] == written
    for one in (vehicle for line in lines for vehicle in line.vehicles):
        assert set(one.scores) == set(DETECTOR_MODALITIES)
        # There is no image, so that only the detectors of the LiDAR's maps run.
        assert one.scores["rgb"] is None
        assert one.dominant_modality in ("dm", "rm")
        assert one.scores[one.dominant_modality] is not None


def test_a_sequence_has_a_file_of_tracked_vehicles(networks, street, tmp_path):
    out = tmp_path / "of_street"
    assert main(["run", str(street), "--frames", "3", "--out", str(out), *networks]) == 0
    rows = read_result_rows(out / "vehicles" / f"{street.name}.txt", 3)
    lines = [json.loads(line) for line in (out / "vehicles.jsonl").read_text().splitlines()]
    followed = [one for line in lines for one in line["vehicles"] if one["id"] is not None]
    assert len(rows) == len(followed)
    assert (out / "video.mp4").is_file()
    stages = json.loads((out / "summary.json").read_text())["stages_ms"]
    assert {"maps", "dm detector", "rm detector", "fusion", "vehicles", "DepthCN"} < set(stages)


@pytest.mark.parametrize("looks", [True, False])
def test_detectors_read_an_image_that_is_not_drawn(networks, street, tmp_path, looks):
    out = tmp_path / "out"
    words = ["run", str(street), "--frames", "2", "--out", str(out), "--no-video", *networks]
    words.append("--pipeline.no-parallel")
    assert (
        main([*words, "--pipeline.detection.modalities", '["rgb","dm"]' if looks else '["dm"]'])
        == 0
    )
    stages = json.loads((out / "summary.json").read_text())["stages_ms"]
    assert ("rgb detector" in stages) == looks
    assert "dm detector" in stages


def test_without_detectors_there_are_no_files_of_vehicles(car_frames, tmp_path):
    out = tmp_path / "out"
    words = ["run", str(car_frames), "--out", str(out), "--video", "false"]
    none = [
        "--pipeline.detection.modalities",
        "[]",
        "--pipeline.detection.depthcn.enabled",
        "false",
    ]
    assert main([*words, *none]) == 0
    names = {path.name for path in out.iterdir()}
    assert not names & {"data", "vehicles", "vehicles.jsonl"}
    assert json.loads((out / "summary.json").read_text())["vehicles"] is None
