"""Labels that are proposed for a drive, reviewed, and read by the drive."""

import json
import re

import numpy as np
import pytest

from data.open_drive import open_drive
from perception.cli.main import main
from perception.errors import UsageError
from tests.faults import command, fault


@pytest.fixture
def proposed(drive_folder, tmp_path):
    root, out = drive_folder("", frames=6), tmp_path / "out"
    assert main(f"label {root} --out {out} --min-confidence 0.2 --form labelcloud".split()) == 0
    return root, out


def test_proposals_are_reviewed_and_become_labels(proposed, capsys):
    root, out = proposed
    objects = json.loads((out / "proposals.json").read_text())["objects"]
    assert objects
    page = (out / "review.html").read_text()
    shown = json.loads(re.search(r'id="objects">(.*?)</script>', page)[1])
    assert len(shown["objects"]) == len(objects)
    assert "http" not in page
    assert len(list((out / "boxes").iterdir())) == 6
    decisions = {str(one["number"]): {"decision": "reject"} for one in objects[1:]}
    decisions[str(objects[0]["number"])] = {"decision": "accept", "type": "Bus"}
    (out / "review.json").write_text(json.dumps({"format": shown["format"], "objects": decisions}))
    capsys.readouterr()
    words = f"label {root} --out {out} --form labelcloud --review {out}/review.json"
    assert main(words.split()) == 0
    assert capsys.readouterr().out.startswith(f"1 of {len(objects)} objects")
    (root / "drive.yaml").write_text((root / "drive.yaml").read_text() + "labels: labels\n")
    (out / "boxes").rename(root / "labels")
    drive, boxes = open_drive(root), np.array(objects[0]["boxes"])
    labels = [drive.labels_around(index) for index in objects[0]["frames"]]
    assert {kind for one in labels for kind in one.types.tolist()} == {"Bus"}
    np.testing.assert_allclose(labels[0].boxes_velo.size_m[0], boxes[0, 3:6], atol=1e-3)


def test_labels_are_not_of_images(proposed):
    root, out = proposed
    with fault(UsageError, "--form yolo", "3D boxes", "images"):
        command(*f"label {root} --out {out} --form yolo".split())
    with fault(UsageError, "out", "a folder without results", "trifuse label", "--overwrite"):
        command(*f"label {root} --out {out}".split())
