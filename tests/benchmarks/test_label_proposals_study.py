"""Proposals beside labels: made of the labels themselves, and moved, missing and invented ones."""

import json

import numpy as np
import pytest

from benchmarks.studies.label_proposals import LabelledBoxes, ProposedBoxes, proposal_metrics
from data.derived.motion_labels import evaluation_labels
from data.label_proposals.proposals import Proposal, ProposalFile
from data.open_drive import open_drive
from data.synthetic.collection import SynthConfig, write_drives
from perception.cli.main import main
from perception.geometry.boxes import transform_boxes
from perception.sensor import VLP_16
from perception.types import Boxes3D


def test_metrics_are_those_of_a_confidence_and_the_best():
    labels = LabelledBoxes(np.array(["car"] * 4), np.array([10.0, 10.0, 30.0, 30.0]))
    found = ProposedBoxes(
        types=np.array(["car"] * 4),
        ranges_m=np.array([10.0, 10.0, 30.0, 30.0]),
        confidences=np.array([0.9, 0.8, 0.3, 0.2]),
        is_right=np.array([True, False, True, True]),
        ious=np.array([0.8, 0.0, 0.6, 0.75]),
        numbers=np.array([1, 1, 2, 3]),
    )
    rows = proposal_metrics(labels, found, 0.5)
    assert list(rows) == ["car", "car, 0 to 20 m", "car, 20 to 35 m"]
    car = rows["car"]
    assert (car.labels, car.precision, car.recall, car.f1) == (4, 0.5, 0.25, pytest.approx(1 / 3))
    assert (car.iou, car.untouched) == (0.8, 0.25)
    assert (car.best, car.best_confidence) == (pytest.approx(0.75), 0.2)
    # The second is of an object that the first confirms; three of four labels are proposed.
    assert car.confirmed == 1.0 and np.isnan(car.at_recall)
    far = proposal_metrics(labels, found, 0.0)["car, 20 to 35 m"]
    assert (far.confirmed, far.at_recall, far.recall) == (1.0, 1.0, 1.0)
    assert (rows["car, 20 to 35 m"].recall, rows["car, 20 to 35 m"].best) == (0.0, 1.0)


@pytest.fixture(scope="module")
def labelled(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drive")
    config = SynthConfig("tracking", 3, sensor=VLP_16, seed=4, images=False, street="jam")
    [path] = write_drives(folder, config)
    return path


def test_labels_as_proposals_are_right(labelled, tmp_path, capsys):
    drive = open_drive(labelled, images=False)
    poses = {index: drive.world_SE3_velo(index) for index in range(3)}
    proposals = []
    for index, pose in poses.items():
        labels = evaluation_labels(drive, index)
        boxes = transform_boxes(pose, labels.boxes_velo)
        for row, kind in enumerate(labels.types.tolist()):
            proposals.append((kind, index, boxes[row : row + 1]))
    cars = [one for one in proposals if one[0] == "Car"]
    kept = cars[1:]  # the first is missed
    kept.append(("Car", 1, Boxes3D(poses[1][None, :3, 3] + (8.0, 30.0, -1.7), np.full((1, 3), 2.0), np.zeros(1))))  # fmt: skip
    ProposalFile(
        [
            Proposal(number, kind, 0.9, True, np.array([index]), box, np.array([20]), index)
            for number, (kind, index, box) in enumerate(kept, start=1)
        ],
        poses,
    ).write(tmp_path)
    out = tmp_path / "study.png"
    words = ["study", "label-proposals", str(labelled), "--proposals", str(tmp_path)]
    assert main([*words, "--match", "iou", "--out", str(out)]) == 0
    row = json.loads(out.with_suffix(".json").read_text())["results"]["proposals"]["car"]
    assert row["iou"] == pytest.approx(1.0, abs=1e-3)
    assert row["confirmed"] == row["precision"] == 1
    assert row["recall"] == pytest.approx((row["labels"] - 1) / row["labels"])
    assert out.is_file()
    assert "untouched" in capsys.readouterr().out
