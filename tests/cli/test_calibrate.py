"""`trifuse calibrate` finds an error that was made, and leaves the drive's files alone."""

import json

import cv2
import numpy as np
import pytest

from data.kitti.calibration import read_benchmark_calibration
from perception.cli.main import main
from perception.errors import UsageError
from perception.geometry.se3 import from_motion_vector, inverse, rotation_angle_rad
from tests.faults import command, fault


@pytest.fixture(scope="module")
def street(tmp_path_factory):
    """Five frames of a street."""
    root = tmp_path_factory.mktemp("street")
    words = ["--layout", "object", "--frames", "5", "--street", "housing", "--seed", "5"]
    assert main(["synth", str(root), *words]) == 0
    return root


def test_a_rotated_calibration_is_found(street, tmp_path, capsys):
    files = sorted((street / "training" / "calib").glob("*.txt"))
    true = read_benchmark_calibration(files[0]).camera.cam_SE3_velo
    off = from_motion_vector(np.radians([0.6, -0.8, 0.5, 0, 0, 0])) @ true
    row = "Tr_velo_to_cam: " + " ".join(f"{value:.12e}" for value in off[:3].ravel())
    for file in files:
        lines = [
            row if "Tr_velo_to_cam" in line else line for line in file.read_text().splitlines()
        ]
        file.write_text("\n".join(lines) + "\n")
    before = [file.read_bytes() for file in files]
    out = tmp_path / "out"
    assert main(["calibrate", str(street), "--out", str(out)]) == 0
    assert [file.read_bytes() for file in files] == before
    (written,) = out.glob("0*.txt")
    left = read_benchmark_calibration(written).camera.cam_SE3_velo @ inverse(true)
    assert np.degrees(rotation_angle_rad(left)) < 0.2
    assert np.linalg.norm(left[:3, 3]) < 0.1
    assert cv2.imread(str(out / "calibration.png")).shape[1] > 1000
    document = json.loads((out / "calibration.json").read_text())
    assert document["score"] > document["given_score"] + 0.05
    printed = capsys.readouterr().out
    assert "roll, about the optical axis [deg]" in printed
    assert f"calibration: {written}, to be copied to {files[len(files) // 2]}" in printed
    with fault(
        UsageError, str(out), "a folder without results", advice="replace them with --overwrite"
    ):
        command("calibrate", street, "--out", out)
