"""Research sets in the layout of KITTI are read as they are: View-of-Delft's, and recordings of other cars."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from data.inspection import inspect_drive
from data.kitti.calibration import read_benchmark_calibration
from data.layouts import OpenConfig
from data.open_drive import open_drive
from perception.cli.main import main
from perception.errors import CalibrationError, ScanError, UsageError
from tests.data.conftest import CALIBRATION, packet_rows, scan
from tests.faults import fault

SIZE_PX = (1936, 1216)  # View-of-Delft's camera
CALIB = """P0: 1495.468642 0.0 961.272442 0.0 0.0 1495.468642 624.89592 0.0 0.0 0.0 1.0 0.0
P1: 1495.468642 0.0 961.272442 0.0 0.0 1495.468642 624.89592 0.0 0.0 0.0 1.0 0.0
P2: 1495.468642 0.0 961.272442 0.0 0.0 1495.468642 624.89592 0.0 0.0 0.0 1.0 0.0
P3: 1495.468642 0.0 961.272442 0.0 0.0 1495.468642 624.89592 0.0 0.0 0.0 1.0 0.0
R0_rect: 1.0 0.0 0.0 0.0 1.0 0.0 0.0 0.0 1.0
Tr_velo_to_cam: 0.0 -1.0 0.0 0.05 0.0 0.0 -1.0 -0.45 1.0 0.0 0.0 -0.7
Tr_imu_to_velo:
"""
LABEL = "Cyclist 0 0 -1.6 905.1 560.2 1010.3 830.7 1.75 0.7 1.9 0.1 1.3 9.2 -1.57 1\n"


def bright_scan(scale: float) -> np.ndarray:
    points = scan()
    points[:, 3] = np.linspace(0, scale, len(points), dtype=np.float32).round()
    return points


@pytest.fixture
def delft_root(tmp_path: Path) -> Path:
    """Return three frames as View-of-Delft stores them."""
    training = tmp_path / "lidar" / "training"
    for folder in ("velodyne", "image_2", "calib", "label_2"):
        (training / folder).mkdir(parents=True)
    image = np.full((SIZE_PX[1], SIZE_PX[0], 3), 90, np.uint8)
    for number in range(3):
        bright_scan(255).tofile(training / f"velodyne/{number:05d}.bin")
        cv2.imwrite(str(training / f"image_2/{number:05d}.jpg"), image)
        (training / f"calib/{number:05d}.txt").write_text(CALIB)
        (training / f"label_2/{number:05d}.txt").write_text(LABEL)
    return tmp_path / "lidar"


def test_a_research_set_in_the_layout_of_kitti_is_read_as_it_is(delft_root):
    drive = open_drive(delft_root)
    frame = drive[1]
    assert frame.points_velo[:, 3].max() == 1
    assert frame.image.shape == (1216, 1936, 3)
    assert frame.calibration.image_size_px == SIZE_PX
    assert drive.labels(1).types.tolist() == ["Cyclist"]
    np.testing.assert_allclose(drive.labels(1).boxes_velo.bottom_m, [[9.9, -0.05, -1.75]])


def test_a_research_set_is_checked_and_run(delft_root, tmp_path, capsys):
    assert main(["check", str(delft_root)]) == 0
    table = capsys.readouterr().out
    assert "reflectance up to 255, divided by 255" in table
    assert "no faults" in table
    out = tmp_path / "results"
    assert main(["run", str(delft_root), "--no-video", "--out", str(out)]) == 0
    assert "training: 3 frames" in capsys.readouterr().out


@pytest.mark.parametrize(("largest", "scale"), [(1, 1), (200, 255), (3000, 65535)])
def test_the_scale_of_reflectance_is_one_for_the_drive(raw_drive, largest, scale):
    for index in range(6):
        points = bright_scan(largest if index == 5 else largest / 2)
        points.tofile(raw_drive / f"velodyne_points/data/{index:010d}.bin")
    drive = open_drive(raw_drive)
    expected = [points[:, 3].max() for points in map(drive.points_velo, (0, 5))]
    assert expected == pytest.approx([np.round(largest / 2) / scale, largest / scale])
    findings = [one.what for one in inspect_drive(drive).findings]
    assert ("data not used as they are" in findings) == (scale != 1)
    assert drive.select([0])[0].points_velo[:, 3].max() == pytest.approx(expected[0])


def test_the_scale_of_reflectance_may_be_given(raw_drive):
    config = OpenConfig(reflectance_scale=0.5)
    drive = open_drive(raw_drive, config=config)
    assert drive[0].points_velo[:, 3].max() == pytest.approx(0.6)
    assert not drive.notes
    with fault(UsageError, "--reflectance-scale", "above 0", "0"):
        OpenConfig(reflectance_scale=0)


def test_a_reflectance_of_no_scale_that_is_known(raw_drive):
    points = scan()
    points[:, 3] = 1.3
    points.tofile(raw_drive / "velodyne_points/data/0000000000.bin")
    with fault(ScanError, expected="reflectance from 0 to 1", advice="--reflectance-scale"):
        open_drive(raw_drive)[0]


def test_ins_packets_need_a_transform_even_where_its_row_is_empty(tracking_root):
    path = tracking_root / "training/calib/0001.txt"
    rows = [row for row in path.read_text().splitlines() if "imu" not in row]
    path.write_text("\n".join([*rows, "Tr_imu_to_velo: "]))
    with fault(CalibrationError, expected="an IMU-to-LiDAR calibration"):
        open_drive(tracking_root, sequence="0001")
    (tracking_root / "training/oxts/0001.txt").unlink()
    drive = open_drive(tracking_root, sequence="0001")
    assert (drive.has_poses, drive.velo_SE3_imu, len(packet_rows())) == (False, None, len(drive))


def test_one_camera_without_rectification(tmp_path):
    path = tmp_path / "0000.txt"
    rows = [row for row in CALIB.splitlines() if row.startswith(("P0", "Tr_velo"))]
    path.write_text("\n".join(rows).replace("Tr_velo_to_cam", "Tr"))
    camera = read_benchmark_calibration(path).camera
    assert camera.image_P_cam[0, 0] == pytest.approx(1495.468642)
    np.testing.assert_allclose(camera.cam_SE3_velo[:3, 3], [0.05, -0.45, -0.7])
    assert CALIBRATION.camera is not None
