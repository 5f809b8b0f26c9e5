"""A calibration that was found is written in the drive's own format, into a copy, and read again."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

from data.calibration_files import read_calibrated_frames, write_calibration
from data.open_drive import open_drive
from perception.cli.main import main
from perception.errors import CalibrationError
from perception.geometry.se3 import from_motion_vector

MOVED = from_motion_vector(np.array([0.01, -0.02, 0.005, 0.03, -0.02, 0.01]))


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    """One synthetic frame in each layout of KITTI."""
    root = tmp_path_factory.mktemp("drives")
    for layout in ("raw", "tracking", "object"):
        words = [
            "synth",
            str(root / layout),
            "--frames",
            "1",
            "--sensor",
            "VLP-16",
            "--layout",
            layout,
        ]
        assert main(words) == 0
    raw = next((root / "raw").glob("*/*_sync"))
    return {"raw": raw, "tracking": root / "tracking", "object": root / "object"}


@pytest.mark.parametrize("layout", ["raw", "tracking", "object"])
def test_the_copy_holds_the_calibration_that_was_found(drives, layout, tmp_path):
    root = tmp_path / "drive"
    source = drives[layout].parent if layout == "raw" else drives[layout]
    shutil.copytree(source, root)
    path = root / drives[layout].name if layout == "raw" else root
    drive = open_drive(path)
    stated = drive.frame_calibration(0)
    found = MOVED @ stated.cam_SE3_velo
    copy, own = write_calibration(tmp_path, drive, stated, found)
    before = own.read_text()
    assert copy.name == own.name
    assert copy.parent == tmp_path
    assert before != copy.read_text()
    shutil.copy(copy, own)
    again = open_drive(path).frame_calibration(0)
    np.testing.assert_allclose(again.cam_SE3_velo, found, atol=1e-9)
    np.testing.assert_array_equal(again.image_P_cam, stated.image_P_cam)


def test_a_drive_yaml_gets_the_transform_of_its_axes(drives, tmp_path):
    folder = _folder_of_scans(drives["object"], tmp_path / "folder")
    drive = open_drive(folder)
    stated = drive.frame_calibration(0)
    found = MOVED @ stated.cam_SE3_velo
    copy, own = write_calibration(tmp_path, drive, stated, found)
    assert own == folder / "drive.yaml"
    shutil.copy(copy, own)
    np.testing.assert_allclose(open_drive(folder).frame_calibration(0).cam_SE3_velo, found)


def _folder_of_scans(root: Path, folder: Path) -> Path:
    """Return a folder with a scan, an image, and LiDAR axes of its own."""
    (folder / "images").mkdir(parents=True)
    (folder / "scans").mkdir()
    training = root / "training"
    shutil.copy(training / "velodyne" / "000000.bin", folder / "scans")
    shutil.copy(training / "image_2" / "000000.png", folder / "images")
    extrinsics = {"translation_m": [0.0, -0.1, -0.3], "roll_pitch_yaw_deg": [90.0, 0.0, 0.0]}
    camera = {"images": "images", "fx_px": 720.0, "fy_px": 720.0, "cx_px": 610.0, "cy_px": 173.0}
    document = {
        "lidar": {"sensor": "HDL-64E", "axes": ["left", "backward", "up"]},
        "camera": camera | {"lidar_to_camera": extrinsics},
    }
    (folder / "drive.yaml").write_text(yaml.safe_dump(document))
    return folder


def test_frames_of_another_calibration_are_left_out(drives, tmp_path):
    root = tmp_path / "object"
    shutil.copytree(drives["object"], root)
    training = root / "training"
    for number in (1, 2):
        for folder, ending in (("velodyne", "bin"), ("image_2", "png"), ("calib", "txt")):
            first = training / folder / f"000000.{ending}"
            shutil.copy(first, first.with_stem(f"{number:06d}"))
    other = training / "calib" / "000001.txt"
    other.write_text(other.read_text().replace("Tr_velo_to_cam: ", "Tr_velo_to_cam: -"))
    read = read_calibrated_frames(open_drive(root), 10, lambda frames: frames)
    assert len(read.edges) == 2
    assert read.left_out == 1


def test_a_drive_without_camera_is_refused(drives, tmp_path):
    root = tmp_path / "object"
    shutil.copytree(drives["object"], root)
    shutil.rmtree(root / "training" / "image_2")
    with pytest.raises(CalibrationError, match="expected an image and its calibration"):
        read_calibrated_frames(open_drive(root), 10, lambda frames: frames)
