"""Drives of several cameras: each layout opens those that are named, the first one is the main one."""

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pyarrow
import pytest
from pyarrow import feather

from data.folder.labelled_drive import LabelledPointsDrive
from data.layouts import OpenConfig
from data.open_drive import open_drive
from data.synthetic.collection import SynthConfig, draw_drive, write_drives
from data.synthetic.rig import camera_calibration
from perception.atomic_file import write_atomically
from perception.errors import CalibrationError, DriveError, UsageError
from perception.sensor import VLP_16
from tests.faults import fault
from tests.other_layouts import write_argoverse2, write_nuscenes
from tests.tiny_drive import TinyDrive

SYNTH = SynthConfig(layout="folder", frames=2, sensor=VLP_16, seed=7, cameras=("front", "left"))


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Path:
    (folder,) = write_drives(tmp_path_factory.mktemp("synth"), SYNTH)
    return folder


@pytest.fixture
def folder(written: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(written, tmp_path / "drive"))


def opened(path: Path, camera: str | None):
    return open_drive(path, config=OpenConfig(camera=camera))


def test_a_synthetic_drive_of_two_cameras_is_read_back_as_it_was_drawn(written):
    drawn, drive = draw_drive(SYNTH, 0, 2), opened(written, "front,left")
    frame = drive[1]
    assert frame.camera == "front"
    (left,) = frame.further_cameras
    assert left.name == "left"
    np.testing.assert_array_equal(frame.points_velo, drawn.scan(1).points_velo)
    np.testing.assert_array_equal(left.image, drawn.image(1, "left"))
    assert not np.array_equal(left.image, frame.image)
    point = np.array([4.0, 20.0, -1.0, 1.0])
    for one, name in ((left.calibration, "left"), (frame.calibration, "front")):
        pixel, drawn_pixel = (c.image_P_velo @ point for c in (one, camera_calibration(name)))
        np.testing.assert_allclose(pixel / pixel[2], drawn_pixel / drawn_pixel[2], atol=1e-6)
    expected_SE3 = drawn.world_SE3_velo(1)
    np.testing.assert_allclose(frame.world_SE3_velo, expected_SE3, atol=1e-6)
    labels, truth = drive.labels(1), drawn.labels(1)
    assert labels.types.tolist() == truth.types.tolist()
    np.testing.assert_allclose(labels.boxes_velo.bottom_m, truth.boxes_velo.bottom_m, atol=0.011)


def test_without_a_name_the_first_camera_is_the_only_one(written):
    frame = opened(written, None)[0]
    assert frame.further_cameras == ()
    np.testing.assert_array_equal(frame.image, opened(written, "front")[0].image)


def test_with_another_main_camera_the_labels_are_those_of_the_points(written):
    drive = opened(written, "left,front")
    assert isinstance(drive, LabelledPointsDrive)
    assert [view.camera for view in drive[0].views] == ["left", "front"]


def test_a_camera_without_an_image_is_dark_in_that_frame(folder):
    (folder / "left" / "000001.png").unlink()
    drive = opened(folder, "front,left")
    assert [frame.further_cameras[0].image is None for frame in drive] == [False, True]
    part = drive.select([1])
    assert part[0].further_cameras[0].image is None
    assert part[0].image is not None


def test_scans_alone_read_no_image(written):
    frame = opened(written, "front,left").scan(0)
    assert frame.image is None
    assert frame.further_cameras[0].image is None


def test_names_that_are_not_there(written):
    with fault(UsageError, "--camera rear", "one of front, left", "rear"):
        opened(written, "front,rear")
    with fault(UsageError, "cameras", "each camera once", "front, front"):
        opened(written, "front,front")[0]


def test_camera_and_cameras(folder):
    text = (folder / "drive.yaml").read_text()
    (folder / "drive.yaml").write_text(text.replace("cameras:\n  front:", "camera:", 1))
    with pytest.raises(DriveError, match=r"drive.yaml"):
        opened(folder, None)


def test_kitti_layouts_hold_one_camera():
    with fault(UsageError, "--cameras front,left", "the raw layout", "2", "--layout folder"):
        SynthConfig(cameras=("front", "left"))


def test_both_colour_cameras_of_kitti_raw(tmp_path):
    (drive,) = write_drives(tmp_path, SynthConfig(frames=1, sensor=VLP_16, images=False))
    grey = cv2.imencode(".png", np.full((375, 1242, 3), 90, np.uint8))[1]
    write_atomically(drive / "image_02/data/0000000000.png", grey.tobytes())
    shutil.copytree(drive / "image_02", drive / "image_03")
    cameras = drive.parent / "calib_cam_to_cam.txt"
    with fault(CalibrationError, "calib_cam_to_cam.txt", "P_rect_03"):
        opened(drive, "image_02,image_03")
    rows = cameras.read_text().splitlines()
    right = [row.replace("_02:", "_03:") for row in rows if "_02:" in row]
    cameras.write_text("\n".join([*rows, *right]) + "\n")
    frame = opened(drive, "image_02,image_03")[0]
    assert [view.camera for view in frame.views] == ["image_02", "image_03"]
    np.testing.assert_array_equal(frame.image, frame.further_cameras[0].image)
    assert not opened(drive, "image_03,image_02").has_labels


def test_two_ring_cameras_of_argoverse_2(tmp_path):
    log = write_argoverse2(tmp_path, TinyDrive())
    for name in ("egovehicle_SE3_sensor.feather", "intrinsics.feather"):
        path = log / "calibration" / name
        table = feather.read_table(path)
        rows = table.to_pylist()
        front = next(row for row in rows if row["sensor_name"] == "ring_front_center")
        rows.append({**front, "sensor_name": "ring_side_left"})
        path.unlink()
        feather.write_feather(pyarrow.Table.from_pylist(rows, table.schema), str(path))
    shutil.copytree(
        log / "sensors/cameras/ring_front_center", log / "sensors/cameras/ring_side_left"
    )
    frame = opened(log, "ring_front_center,ring_side_left")[0]
    np.testing.assert_array_equal(frame.image, frame.further_cameras[0].image)


def test_two_cameras_of_nuscenes(tmp_path):
    root = write_nuscenes(tmp_path, TinyDrive())
    folder = next(path.parent for path in root.rglob("sample_data.json"))
    for name, renamed in (
        ("sensor", ("token", "channel")),
        ("calibrated_sensor", ("token", "sensor_token")),
        ("sample_data", ("token", "calibrated_sensor_token", "prev", "next")),
    ):
        rows = json.loads((folder / f"{name}.json").read_text())
        of_camera = [row for row in rows if "cam" in json.dumps(row).lower()]
        back = [
            row | {key: f"{row[key]}_BACK" for key in renamed if row.get(key)}
            for row in of_camera
            if "lidar" not in row["token"]
        ]
        (folder / f"{name}.json").write_text(json.dumps(rows + back))
    drive = open_drive(
        root, sequence="scene-0061", config=OpenConfig(camera="CAM_FRONT,CAM_FRONT_BACK")
    )
    frame = drive[0]
    np.testing.assert_array_equal(frame.image, frame.further_cameras[0].image)
