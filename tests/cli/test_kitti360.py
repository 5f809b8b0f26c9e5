"""Commands on KITTI-360 as it is downloaded; objects are those of the same drive as an Argoverse 2 log."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from data.open_drive import open_drive
from data.synthetic.ins import InsNoise
from perception.cli.main import main
from perception.localization.frame_registration import FrameRegistration
from perception.sensor import VLP_16, sensor_to_json
from tests.faults import command
from tests.kitti360_writer import FIRST, NAME, write_kitti360
from tests.other_layouts import GridDrive, write_argoverse2

FRAMES, POSED = 6, (1, 2, 4)


@pytest.fixture(scope="module")
def exact() -> GridDrive:
    return GridDrive(FRAMES, seed=3, sensor=VLP_16, noise=InsNoise(0.0, 0.0))


@pytest.fixture(scope="module")
def roots(make_once: Callable[[str, Callable[[Path], object]], Path], exact: GridDrive) -> Path:
    """Return a folder of the drive with all poses, with some, as an Argoverse 2 log, and of its sensor."""

    def write(folder: Path) -> None:
        write_kitti360(folder / "whole", exact, images=False)
        write_kitti360(folder / "gaps", exact, posed=POSED)
        write_argoverse2(folder / "log", exact, images=False, flow=False)
        (folder / "sensor.json").write_text(sensor_to_json(VLP_16))

    return make_once("kitti360_commands", write)


def _evaluate(roots: Path, name: str, out: Path) -> dict[str, Any]:
    words = ("--sensor", roots / "sensor.json", "--json", out / f"{name}.json")
    command("evaluate", "obstacles", roots / name, *words)
    return json.loads((out / f"{name}.json").read_text())["results"]


def test_obstacles_are_those_of_the_same_drive_in_another_layout(roots, tmp_path):
    found, known = (_evaluate(roots, name, tmp_path) for name in ("whole", "log"))
    for name in ("objects", "moving", "static", "moving_tracks", "missed_objects", "false_moving"):
        assert found["objects"][name] == known["objects"][name], name
    # The worlds are turned against each other, and so are their voxels.
    assert found["objects"]["missed_moving"] == pytest.approx(
        known["objects"]["missed_moving"], abs=1
    )
    assert found["objects"]["moving"] > 0 < found["objects"]["static"]
    assert found["objects"]["missed_objects"] == 0


def test_obstacles_of_frames_with_a_pose_alone_count(roots, tmp_path):
    whole, gaps = (_evaluate(roots, name, tmp_path)["objects"] for name in ("whole", "gaps"))
    assert 0 < gaps["objects"] < whole["objects"]


def test_check_states_what_is_left_out_and_interpolated(roots, capsys):
    command("check", roots / "gaps", "--sensor", roots / "sensor.json")
    printed = capsys.readouterr().out
    assert f"{NAME}: {FRAMES} frames" in printed
    assert "with images, INS, labels" in printed
    assert "image_02 and image_03 are left out" in printed
    assert "3 of 6 scans have no pose: 1 interpolated between neighbours, 2 left to" in printed
    assert "no faults" in printed


def test_run(roots, tmp_path, caplog):
    words = ("--sensor", roots / "sensor.json", "--out", tmp_path / "out", "--no-video")
    command("run", roots / "gaps", *words)
    assert json.loads((tmp_path / "out/summary.json").read_text())["frames"] == FRAMES
    assert "3 of 6 scans have no pose: 1 interpolated" in caplog.text
    assert "image_02 and image_03 are left out" in caplog.text


def test_registration_bridges_frames_without_a_pose(roots, exact):
    """The first and the last frame have none; the way between all of them is the truth to some centimetres."""
    drive = open_drive(roots / "gaps", sensor=str(roots / "sensor.json"), images=False)
    assert [drive.world_SE3_velo(index) is None for index in range(FRAMES)] == [
        True, False, False, False, False, True,
    ]  # fmt: skip
    registration = FrameRegistration()
    poses = [registration.update(frame) for frame in drive]
    true = [exact.true_world_SE3_velo(index) for index in range(FRAMES)]
    for index in range(1, FRAMES):
        found, known = (np.linalg.inv(one[0]) @ one[index] for one in (poses, true))
        assert np.linalg.norm(found[:3, 3] - known[:3, 3]) < 0.1


def test_damaged_files_end_with_one_sentence_and_exit_code_2(exact, tmp_path, capsys):
    root = write_kitti360(tmp_path / "set", exact, scans=(0,), images=False)
    poses = root / f"data_poses/{NAME}/poses.txt"
    poses.write_text(poses.read_text()[:-30])
    assert main(["run", str(root), "--out", str(tmp_path / "out"), "--no-video"]) == 2
    error = capsys.readouterr().err
    assert f"poses.txt row {FRAMES}: expected 13 numbers, found" in error
    assert len(error.splitlines()) == 1
    poses.write_text(f"{FIRST} 1 0 0 0 0 1 0 0 0 0 1 0\n")
    boxes = root / f"data_3d_bboxes/train/{NAME}.xml"
    boxes.write_text(boxes.read_text()[:900])
    assert main(["evaluate", "obstacles", str(root)]) == 2
    assert f"{NAME}.xml line 34: expected XML of OpenCV, found an error" in capsys.readouterr().err
