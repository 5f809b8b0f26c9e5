"""`trifuse adopt`: the table, drive.yaml, and the questions on what cannot be seen."""

import builtins
import sys

import cv2
import numpy as np
import pytest

from data.layouts import OpenConfig
from data.open_drive import open_drive
from perception.cli.main import main
from perception.errors import DriveError, PerceptionError, UsageError
from tests.data.folder.conftest import road_scan
from tests.faults import command, fault

CAMERA = ("--intrinsics", "30,30,20,10", "--lidar-to-camera", "0,0,0,90,-90,0")


@pytest.fixture
def folder(tmp_path):
    """Return scans with images and poses beside them."""
    root = tmp_path / "my_drive"
    for name in ("lidar", "camera"):
        (root / name).mkdir(parents=True)
    for index in range(3):
        points = road_scan(index)
        points[:, 3] *= 255
        np.save(root / "lidar" / f"{index:06d}.npy", points)
        cv2.imwrite(str(root / "camera" / f"{index:06d}.png"), np.zeros((20, 40, 3), np.uint8))
    (root / "poses.txt").write_text("".join(f"1 0 0 {x} 0 1 0 0 0 0 1 0\n" for x in range(3)))
    return root


def test_what_is_seen_is_printed_and_written(folder, capsys):
    assert main(["adopt", str(folder)]) == 0
    table = capsys.readouterr().out
    for words in (
        "HDL-32E",
        "x forward, y left, z up",
        "1.73 m",
        "0 to 255",
        "3 images",
        "kitti format",
    ):
        assert words in table
    asked = "rate_hz (guess: 10 Hz), intrinsics, distortion, lidar_to_camera, body_to_lidar"
    assert f"is a question in that file: {asked}" in table
    text = (folder / "drive.yaml").read_text()
    assert "sensor: HDL-32E" in text
    assert "# camera:" in text
    drive = open_drive(folder)
    assert (drive.sensor.name, drive.has_images, drive.has_poses) == ("HDL-32E", False, True)
    assert main(["check", str(folder)]) == 0


def test_flags_state_what_cannot_be_seen(folder, capsys):
    words = [*CAMERA, "--height", "1.8", "--rate", "20", "--body-to-lidar", "1,0,0,0,0,0,1"]
    command(
        "adopt",
        folder,
        *words,
        "--distortion",
        "0.1,0,0,0",
        "--fisheye",
        "--axes",
        "forward,left,up",
    )
    assert "is a question" not in capsys.readouterr().out
    drive = open_drive(folder)
    assert (drive.sensor.height_m, drive.sensor.rate_hz) == (1.8, 20)
    assert drive[0].image.shape == (20, 40, 3)
    np.testing.assert_allclose(
        drive.calibration.cam_SE3_velo[:3, :3], [[0, -1, 0], [0, 0, -1], [1, 0, 0]], atol=1e-9
    )
    np.testing.assert_allclose(drive[0].world_SE3_velo[:3, 3], [-1, 0, 0])


def test_questions_are_asked_on_a_terminal(folder, monkeypatch):
    replies = iter(["20", "30 30 20 10", "", "1,0,0,0, 0,1,0,0, 0,0,1,0", ""])
    asked = []
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True)
    monkeypatch.setattr(builtins, "input", lambda text: asked.append(text) or next(replies))
    command("adopt", folder)
    assert len(asked) == 5
    assert open_drive(folder).calibration.image_P_cam[0, 0] == 30
    monkeypatch.setattr(builtins, "input", lambda text: "many")
    with fault(UsageError, where="rate_hz", expected="numbers", found="many"):
        command("adopt", folder, "--overwrite")


def add_cameras(folder, *names):
    for name in names:
        (folder / name).mkdir(parents=True)
        for index in range(3):
            image = np.zeros((20, 40, 3), np.uint8)
            cv2.imwrite(str(folder / name / f"{index:06d}.png"), image)


def test_several_cameras_are_questions_each(folder, capsys):
    add_cameras(folder, "left", "rear")
    command("adopt", folder)
    table = capsys.readouterr().out
    assert "left.intrinsics, left.distortion, left.lidar_to_camera, camera.intrinsics" in table
    text = (folder / "drive.yaml").read_text()
    filled = text[text.index("# cameras:") :].replace("\n# ", "\n").removeprefix("# ")
    (folder / "drive.yaml").write_text(text[: text.index("# cameras:")] + filled)
    frame = open_drive(folder, config=OpenConfig(camera="camera,left,rear"))[0]
    assert [view.camera for view in frame.views] == ["camera", "left", "rear"]


def test_numbers_of_several_cameras_stand_one_after_another(folder, capsys):
    add_cameras(folder, "left", "rear/data")
    numbers = "30,30,20,10,40,40,20,10"
    turns = "0,0,0,90,-90,0,0,1,0,90,-90,0"
    command("adopt", folder, "--intrinsics", numbers, "--lidar-to-camera", turns)
    assert "rear.intrinsics" in capsys.readouterr().out
    text = (folder / "drive.yaml").read_text()
    assert "\ncameras:\n  left:\n    images: left\n    fx_px: 30.0" in text
    assert "\n#   rear:\n#     images: rear/data\n" in text
    frame = open_drive(folder, config=OpenConfig(camera="camera,left"))[0]
    assert [view.calibration.image_P_cam[0, 0] for view in frame.views] == [40, 30]
    assert frame.calibration.cam_SE3_velo[:3, 3].tolist() == [0, 1, 0]
    many = ",".join([numbers] * 2)
    with fault(UsageError, where="lidar_to_camera", expected="each of the 4 cameras", found="6"):
        command("adopt", folder, "--overwrite", "--intrinsics", many, *CAMERA[2:])


def test_each_camera_is_asked_for_on_a_terminal(folder, monkeypatch):
    add_cameras(folder, "left")
    replies = iter(["20", "", "", "", "30 30 20 10", "", "1,0,0,0, 0,1,0,0, 0,0,1,0", ""])
    asked = []
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True)
    monkeypatch.setattr(builtins, "input", lambda text: asked.append(text) or next(replies))
    command("adopt", folder)
    assert [text.partition(":")[0] for text in asked[1:7]] == ["left"] * 3 + ["camera"] * 3
    assert open_drive(folder).calibration.image_P_cam[0, 0] == 30


def test_an_earlier_description_is_kept_unless_it_is_to_be_replaced(folder):
    (folder / "drive.yaml").write_text("lidar: {}\n")
    with fault(UsageError, where="drive.yaml", found="one", advice="--overwrite"):
        command("adopt", folder)
    assert (folder / "drive.yaml").read_text() == "lidar: {}\n"
    command("adopt", folder, "--overwrite")
    assert "HDL-32E" in (folder / "drive.yaml").read_text()


@pytest.mark.parametrize(
    ("words", "where", "expected"),
    [
        (["--columns", "x,y"], "--columns", "x, y, z"),
        (["--axes", "up,up,up"], "axes", "right-handed"),
        (["--rate", "0"], "rate_hz", "a positive number"),
        ([*CAMERA[:3], "1,2"], "lidar_to_camera", "6, 7, 12 or 16"),
        (["--intrinsics", "1", *CAMERA[2:]], "intrinsics", "4 numbers"),
    ],
)
def test_values_that_cannot_be_are_one_sentence(folder, words, where, expected):
    with pytest.raises(PerceptionError) as raised:
        command("adopt", folder, *words)
    assert where in raised.value.where
    assert expected in raised.value.expected
    assert not (folder / "drive.yaml").exists()


def test_a_folder_without_scans_is_an_error(tmp_path):
    with fault(DriveError, where=str(tmp_path), expected="scans", found="empty"):
        command("adopt", tmp_path)


def test_a_drive_of_another_layout_needs_none(tmp_path, capsys):
    (tmp_path / "velodyne_points" / "data").mkdir(parents=True)
    command("adopt", tmp_path)
    assert "KITTI raw, which needs no drive.yaml" in capsys.readouterr().out
