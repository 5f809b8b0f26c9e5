"""The study of tracked objects over time."""

import json

import cv2
import pytest

from data.derived.object_truth import DriveObjects
from data.open_drive import open_drive
from data.synthetic.drive import SyntheticDrive
from data.synthetic.writer import write_tracking
from perception.errors import UsageError
from perception.sensor import VLP_16
from tests.faults import command, fault


@pytest.mark.slow
def test_an_object_is_a_row_of_instants(tmp_path, capsys):
    drive = SyntheticDrive(15, sensor=VLP_16, images=False)
    folder = write_tracking(drive, tmp_path / "drive", 0, lambda: None)
    track_id = DriveObjects.of(open_drive(folder)).sequences(15)[-1].track_id
    image_path = tmp_path / "results.jpg"
    words = ("--set", "present", "--track-id", track_id, "--tracker", "3d-ms", "--instants", "2")
    command("study", "tracking-results", folder, *words, "--out", image_path)
    rows = json.loads(image_path.with_suffix(".json").read_text())["results"]["tracks"]
    assert [row["frames"] for row in rows.values()] == [15]
    assert cv2.imread(str(image_path)).shape == (516, 2 * 644, 3)
    assert "E3D [m]" in capsys.readouterr().out


def test_no_instant_is_an_error(tmp_path):
    with fault(UsageError, where="--instants", found="0"):
        command("study", "tracking-results", tmp_path, "--instants", "0")
