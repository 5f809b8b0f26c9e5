"""`trifuse evaluate detector`: its table, plot, document and pictures, and what it refuses."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest

from data.open_drive import open_drive
from perception.cli.evaluations import detector
from perception.cli.main import main
from perception.detection.detectors.input_size import InputSize
from perception.types import Detections


@dataclass
class LabelSeer:
    """A network that sees the labelled boxes of one frame after the other, and a ghost in each."""

    answers: Iterator[Detections]
    modality: str = "dm"
    filling: str = "default"
    class_names: tuple[str, ...] = ("Car", "Cyclist")
    size: InputSize = field(default_factory=lambda: InputSize(64, 96))

    def __post_init__(self):
        self.model = SimpleNamespace(name="seer.onnx")
        self.metadata = {"training_data": "no street"}

    def detect(self, picture):
        assert picture.shape == (190, 620, 1)
        return next(self.answers)


@pytest.fixture
def seer(car_frames, monkeypatch):
    """Put a network that knows the frames, but misses the second car of the last, in place."""
    drive = open_drive(car_frames)
    answers = []
    for index in range(len(drive)):
        boxes_px = drive.labels(index).boxes_px[: 1 if index == len(drive) - 1 else 2]
        boxes_px = np.concatenate([boxes_px, [[500.0, 10, 600, 80]]])
        scores = np.array([0.9, 0.8, 0.3])[-len(boxes_px) :]
        answers.append(Detections(boxes_px, scores, np.full(len(boxes_px), "Car")))
    network = LabelSeer(iter(answers))
    monkeypatch.setattr(detector, "open_detector", lambda model: network)
    return network


def evaluate(*words):
    return main(["evaluate", "detector", *map(str, words)])


def cells(printed, row):
    return next(line for line in printed.splitlines() if line.startswith(row))[len(row) :].split()


def test_table_plot_document_and_pictures(car_frames, seer, tmp_path, capsys):
    plot, out, pictures = tmp_path / "rm.png", tmp_path / "rm.json", tmp_path / "worst"
    words = ("--model", "dm", "--classes", "car", "--bootstrap", "20", "--worst", "2")
    words += ("--plot", plot, "--json", out, "--pictures", pictures)
    assert evaluate(car_frames, *words) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("seer.onnx: dm, 64x96\n")
    row = cells(printed, f"{car_frames} moderate")
    # Five of six cars are found and nothing else that is as sure.
    assert row[:6] == ["real", "3", "0.7", "6", "83.3", "%"]
    assert (row[6], row[-1]) == ("10.00", "12.5")
    assert "ms a frame in the median" in printed
    document = json.loads(out.read_text())
    assert document["split"] == "the network was trained on: no street"
    hard = document["results"][str(car_frames)]["classes"]["Car"]["iou"]["0.5"]["hard"]
    assert (hard["objects"], hard["detections"]["matches"]) == (6, 5)
    assert hard["detections"]["ap_r40_percent"] == 10.0
    interval = hard["detections"]["ap_r40_interval_percent"]
    assert interval["low"] <= 10.0 <= interval["high"]
    assert plot.stat().st_size > 10_000
    # Only the last frame has a mistake at the best score; there the second car is missed.
    (picture,) = pictures.iterdir()
    assert picture.name.endswith("_cars_Car_00_000003.jpg")


def test_every_class_that_the_network_knows_has_rows(car_frames, seer, capsys):
    assert evaluate(car_frames, "--model", "dm", "--iou", "0.5") == 0
    printed = capsys.readouterr().out
    assert cells(printed, f"{car_frames} Car moderate")[:4] == ["real", "3", "0.5", "6"]
    assert cells(printed, f"{car_frames} Cyclist easy") == ["real", "3", "0.5", "0", "-", "-", "-"]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--classes", "Tram"), "--classes: expected Car, Cyclist, found Tram"),
        (("--worst", "0"), "--worst: expected at least 1, found 0"),
        (("--frames", "0"), "--frames: expected at least 1, found 0"),
    ],
)
def test_what_cannot_work_is_one_sentence(car_frames, seer, capsys, words, sentence):
    assert evaluate(car_frames, "--model", "dm", *words) == 2
    assert sentence in capsys.readouterr().err


def test_a_file_that_is_no_detector(car_frames, tmp_path, capsys):
    assert evaluate(car_frames, "--model", tmp_path / "none.onnx") == 2
    assert "none.onnx: expected a model file" in capsys.readouterr().err
