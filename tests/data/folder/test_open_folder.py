"""A folder with a drive.yaml is opened as it says, and each fault in it is one sentence."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from data.clouds.pcd import read_viewpoint
from data.derived.motion_labels import LabelledAround
from data.folder import observation
from data.layouts import OpenConfig
from data.open_drive import open_drive, sequences_in
from perception.errors import DriveError, ImageError, PerceptionError, PoseError, UsageError
from tests.data.folder.conftest import road_scan
from tests.faults import fault

LIDAR = "lidar: {scans: lidar, sensor: HDL-32E, height_m: 2.0, rate_hz: 20}\n"
CAMERA = """
camera:
  images: camera
  fx_px: 30
  fy_px: 30
  cx_px: 20
  cy_px: 10
  lidar_to_camera: {matrix: [[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0]]}
"""


@pytest.fixture
def folder(write_folder):
    root = write_folder([road_scan(index, columns=90) for index in range(4)])
    (root / "drive.yaml").write_text(LIDAR)
    return root


def write_images(root, names, size_px=(40, 20)):
    (root / "camera").mkdir()
    for level, name in enumerate(names):
        image = np.full((size_px[1], size_px[0], 3), level * 10, np.uint8)
        cv2.imwrite(str(root / "camera" / name), image)


def test_scans_have_the_sensor_the_height_and_the_rate(folder):
    drive = open_drive(folder)
    assert (drive.name, len(drive), drive.sensor.name) == ("drive", 4, "HDL-32E")
    assert (drive.sensor.height_m, drive.sensor.rate_hz) == (2.0, 20)
    frame = drive[3]
    np.testing.assert_array_equal(frame.points_velo, road_scan(3, columns=90))
    assert (frame.stamp_s, frame.name, frame.world_SE3_velo) == (0.15, "000003", None)
    assert drive.notes == ()


def test_axes_and_tilt_are_turned_to_ours(folder):
    (folder / "drive.yaml").write_text(
        "lidar: {scans: lidar, sensor: HDL-32E, axes: [right, forward, up], pitch_deg: 5, roll_deg: -2}"
    )
    turn = Rotation.from_euler("ZYX", (0, 5, -2), degrees=True).as_matrix()
    scan = road_scan(0, columns=90)
    ours = np.column_stack([scan[:, 1], -scan[:, 0], scan[:, 2]]) @ turn.T
    np.testing.assert_allclose(open_drive(folder)[0].points_velo[:, :3], ours, atol=1e-4)


def test_columns_are_named_without_a_drive_yaml(write_folder):
    scan = road_scan(0, columns=90)
    swapped = np.column_stack([scan[:, 3], scan[:, :3], np.zeros(len(scan), np.float32)])
    root = write_folder([swapped.astype(np.float32)])
    config = OpenConfig(columns=("intensity", "x", "y", "z", "_"))
    drive = open_drive(root, config=config)
    turned = np.linalg.norm(drive[0].points_velo[:, :3], axis=1)
    np.testing.assert_allclose(turned, np.linalg.norm(scan[:, :3], axis=1), rtol=1e-5)
    (root / "drive.yaml").write_text(LIDAR)
    np.testing.assert_array_equal(
        open_drive(root, config=config)[0].points_velo[:, :3], scan[:, :3]
    )


def write_pcd(path, scan, viewpoint="0 0 0 1 0 0 0", fields="x y z intensity"):
    count = len(fields.split())
    rows = np.ascontiguousarray(scan[:, :count], np.float32)
    header = f"FIELDS {fields}\nWIDTH {len(rows)}\nHEIGHT 1\nVIEWPOINT {viewpoint}\nDATA binary\n"
    path.write_bytes(header.encode() + rows.tobytes())


@pytest.mark.parametrize(
    ("stated", "moved"),
    [
        ("", lambda xyz: xyz),
        (", viewpoint: ignored", lambda xyz: xyz),
        (", viewpoint: applied", lambda xyz: np.column_stack([1 - xyz[:, 1], 2 + xyz[:, 0], 3 + xyz[:, 2]])),
        (", viewpoint: undone", lambda xyz: np.column_stack([xyz[:, 1] - 2, 1 - xyz[:, 0], xyz[:, 2] - 3])),
    ],
)  # fmt: skip
def test_a_viewpoint_is_used_as_stated_and_else_said(stated, moved, tmp_path):
    (tmp_path / "lidar").mkdir()
    scan = road_scan(0, columns=90)
    half = np.sqrt(0.5)
    write_pcd(tmp_path / "lidar" / "000000.pcd", scan)
    write_pcd(tmp_path / "lidar" / "000001.pcd", scan, f"1 2 3 {half} 0 0 {half}")
    (tmp_path / "drive.yaml").write_text(LIDAR.replace("}", f"{stated}}}"))
    drive = open_drive(tmp_path)
    np.testing.assert_array_equal(drive[0].points_velo, scan)
    np.testing.assert_allclose(drive[1].points_velo[:, :3], moved(scan[:, :3]), atol=1e-5)
    assert [("3.74 m and 90.0 degrees" in note) for note in drive.notes] == (
        [] if stated else [True]
    )


@pytest.mark.parametrize("viewpoint", ["0 0 0 1 0 0 0", "1 2 3 1 0 0 0"])
def test_the_headers_of_scans_are_read_for_a_viewpoint_once(viewpoint, tmp_path, monkeypatch):
    (tmp_path / "lidar").mkdir()
    for index in range(3):
        write_pcd(tmp_path / "lidar" / f"{index:06d}.pcd", road_scan(index, columns=90), viewpoint)
    read = []

    def read_once(path):
        read.append(path.stem)
        return read_viewpoint(path)

    monkeypatch.setattr(observation, "read_viewpoint", read_once)
    drive = open_drive(tmp_path)
    assert read == ["000000", "000001", "000002"]
    assert sum("VIEWPOINT" in note for note in drive.notes) == (viewpoint[0] == "1")


def test_scans_of_one_folder_may_have_other_fields(tmp_path):
    (tmp_path / "lidar").mkdir()
    scan = road_scan(0, columns=90)
    write_pcd(tmp_path / "lidar" / "000000.pcd", scan, fields="x y z")
    write_pcd(tmp_path / "lidar" / "000001.pcd", scan)
    write_pcd(tmp_path / "lidar" / "000002.pcd", scan[:, [3, 2, 1, 0]], fields="intensity z y x")
    (tmp_path / "drive.yaml").write_text(LIDAR)
    frames = list(open_drive(tmp_path))
    np.testing.assert_array_equal(frames[0].points_velo, scan * [1, 1, 1, 0])
    np.testing.assert_array_equal(frames[1].points_velo, scan)
    np.testing.assert_array_equal(frames[2].points_velo, scan)


def test_columns_are_those_of_a_scan():
    with fault(PerceptionError, where="--columns", expected="x, y, z", found="x, y"):
        OpenConfig(columns=("x", "y"))


def test_reflectance_is_divided_by_its_scale(folder):
    (folder / "drive.yaml").write_text(LIDAR.replace("}", ", reflectance_scale: 0.5}"))
    reflectance = np.minimum(road_scan(0, columns=90)[:, 3] / 0.5, 1)
    np.testing.assert_allclose(open_drive(folder)[0].points_velo[:, 3], reflectance)
    scaled = open_drive(folder, config=OpenConfig(reflectance_scale=2.0))[0].points_velo[:, 3]
    np.testing.assert_allclose(scaled, road_scan(0, columns=90)[:, 3] / 2)


def test_times_of_points_are_from_the_scan(tmp_path):
    epoch_ns = 1_317_036_272_000_000_000
    points = np.column_stack([road_scan(0, columns=90), np.zeros(len(road_scan(0, columns=90)))])
    times = np.linspace(0, 99_000_000, len(points)).astype(np.int64) + epoch_ns
    names = ["x", "y", "z", "intensity", "ring", "t"]
    record = np.rec.fromarrays([*points.T, times], names=names)
    np.save(tmp_path / f"{epoch_ns}.npy", record)
    (tmp_path / "drive.yaml").write_text("lidar: {sensor: VLP-16}")
    times_s = open_drive(tmp_path)[0].point_times_s
    np.testing.assert_allclose(times_s, np.linspace(0, 0.099, len(points)), atol=1e-6)


def test_images_are_joined_by_name_and_undistorted_once(folder):
    write_images(folder, [f"{index:06d}.png" for index in range(4)])
    (folder / "drive.yaml").write_text(LIDAR + CAMERA)
    drive = open_drive(folder)
    assert drive[2].image.max() == 20
    assert drive.calibration.image_size_px == (40, 20)
    np.testing.assert_array_equal(
        drive.calibration.image_P_cam[:, :3], [[30, 0, 20], [0, 30, 10], [0, 0, 1]]
    )
    assert open_drive(folder, images=False)[2].image is None
    for model, numbers in (("pinhole", "[0.1, 0, 0, 0]"), ("fisheye", "[0.1, 0, 0, 0]")):
        lens = f"  model: {model}\n  distortion: {numbers}\n"
        (folder / "drive.yaml").write_text(LIDAR + CAMERA + lens)
        distorted = open_drive(folder)
        assert distorted[2].image.shape == (20, 40, 3)
        assert distorted.calibration.image_P_cam[0, 0] != 30


def test_images_are_joined_by_nearest_time(folder):
    write_images(folder, ["a.bmp", "b.bmp", "c.bmp"])
    (folder / "times.txt").write_text("10.0\n10.1\n10.2\n12.0\n")
    (folder / "camera.txt").write_text("10.11\n10.19\n10.28\n")
    named = LIDAR.replace("}", ", timestamps: times.txt}") + CAMERA + "  timestamps: camera.txt\n"
    (folder / "drive.yaml").write_text(named)
    drive = open_drive(folder)
    assert [drive.image(index).max() for index in (1, 2)] == [0, 10]
    assert drive.image(3) is None
    (note,) = drive.notes
    assert note.endswith(
        "2 of 4 scans have no image near in time; correct the time_offset_s of the camera if this is not so"
    )


def test_images_that_cannot_be_joined_are_an_error(folder):
    write_images(folder, ["a.png", "b.png"])
    (folder / "drive.yaml").write_text(LIDAR + CAMERA)
    with fault(DriveError, expected="named as the scans", found="2 images such as a.png, 4 scans"):
        open_drive(folder)


def test_an_image_of_another_size_is_an_error(folder):
    write_images(folder, [f"{index:06d}.png" for index in range(4)])
    (folder / "drive.yaml").write_text(LIDAR + CAMERA + "  size_px: [50, 20]\n")
    with fault(ImageError, expected="50x20 pixels", found="40x20"):
        open_drive(folder)[0]


POSES = {
    "kitti": "".join(f"1 0 0 {x} 0 1 0 0 0 0 1 0\n" for x in range(4)),
    "tum": "".join(f"{x * 0.05} {x} 0 0 0 0 0 1\n" for x in range(4)),
    "csv": "t,x,y,z,roll,pitch,yaw_deg\n" + "".join(f"{x * 0.1},{2 * x},0,0,0,0,0\n" for x in range(2)),
    "ins": "lat,lon,alt\n" + "".join(f"0,{np.degrees(x / 6378137.0)},100\n" for x in range(4)),
}  # fmt: skip


@pytest.mark.parametrize("kind", POSES)
def test_poses_of_each_format(folder, kind):
    (folder / "poses.txt").write_text(POSES[kind])
    text = LIDAR.replace("rate_hz: 20", "rate_hz: 20, time_offset_s: 0.0")
    (folder / "drive.yaml").write_text(f"{text}poses: {{file: poses.txt, format: {kind}}}\n")
    drive = open_drive(folder)
    assert drive.has_poses
    np.testing.assert_allclose(drive[1].world_SE3_velo[:3, 3], [1, 0, 0], atol=1e-6)
    np.testing.assert_allclose(drive[1].world_SE3_velo[:3, :3], np.eye(3), atol=1e-9)
    np.testing.assert_allclose(drive.select([1])[0].world_SE3_velo[:3, 3], [1, 0, 0], atol=1e-6)


def test_poses_of_a_body_are_moved_to_the_lidar(folder):
    (folder / "poses.txt").write_text(POSES["kitti"])
    body = "{translation_m: [-1, 0, 0], roll_pitch_yaw_deg: [0, 0, 90]}"
    poses = f"poses: {{file: poses.txt, format: kitti, body_to_lidar: {body}}}\n"
    (folder / "drive.yaml").write_text(LIDAR + poses)
    # The body's origin is at x = -1 of the LiDAR, which is turned by -90 degrees against it.
    np.testing.assert_allclose(open_drive(folder)[0].world_SE3_velo[:3, 3], [0, -1, 0], atol=1e-9)


BAD_POSES = {
    "kitti": [("1 2 3\n", "12 numbers", "3"), (POSES["tum"], "12 numbers", "8")],
    "tum": [("0 1 2\n", "8 columns", "3"), ("0 0 0 0 0 0 0 0\n", "quaternions", "zeros"),
            ("1 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n", "times that rise", "others")],
    "csv": [("x,y\n1,2\n", "x, y, z", "no z"), ("x,y,z,yaw\n1,2,3,0\n", "4 rows", "1"), ("1,2\n", "names", "2 columns")],
    "ins": [("lat,lon,alt\n95,0,0\n", "latitudes within 89", "others"), ("lat,alt\n9,0\n", "lon", "no lon"),
            ("lat,lon,alt\nnan,0,0\n", "finite", "NaN"), ("a\nb\n", "rows of numbers", "b")],
}  # fmt: skip


@pytest.mark.parametrize("kind", BAD_POSES)
def test_malformed_poses_are_one_sentence(folder, kind):
    (folder / "drive.yaml").write_text(f"{LIDAR}poses: {{file: poses.txt, format: {kind}}}\n")
    for text, expected, found in BAD_POSES[kind]:
        (folder / "poses.txt").write_text(text)
        with fault(PoseError, where="poses.txt", expected=expected, found=found):
            open_drive(folder)


def test_a_scan_beyond_the_poses_has_none(folder):
    (folder / "poses.txt").write_text("0 0 0 0 0 0 0 1\n0.01 0 0 0 0 0 0 1\n")
    (folder / "drive.yaml").write_text(LIDAR + "poses: {file: poses.txt, format: tum}\n")
    with fault(PoseError, expected="a pose at the time", found="0.000 to 0.010 s", advice="clock"):
        open_drive(folder)[3]


def test_timestamps_in_several_forms(folder):
    rows = ["2011-09-26 13:04:32.25\n2011-09-26 13:04:32.5\n2011-09-26 13:04:33\n2011-09-26 13:04:34\n",
            "name,stamp\n" + "".join(f"{n},{1317042272250000000 + n * 250000000}\n" for n in (0, 1, 3, 7))]  # fmt: skip
    (folder / "drive.yaml").write_text(LIDAR.replace("}", ", timestamps: times.txt}"))
    for text in rows:
        (folder / "times.txt").write_text(text)
        drive = open_drive(folder)
        assert [drive.stamp_s(index) for index in range(4)] == [0, 0.25, 0.75, 1.75]
    for text, expected, found in (("1\n2\n", "4 rows", "2"), ("1\n2\nq\n4\n", "a time", "q")):
        (folder / "times.txt").write_text(text)
        with fault(DriveError, where="times.txt", expected=expected, found=found):
            open_drive(folder)


BAD_YAML = [
    ("lidar: [", DriveError, "drive.yaml", "a YAML file", "expected"),
    ("- 1", DriveError, "drive.yaml", "names and values", "a list"),
    ("lidar: {colums: [x]}", DriveError, "lidar: colums", "columns", "another name"),
    ("lidar: {columns: x}", DriveError, "columns", "a list", "x"),
    ("lidar: {columns: [x, y]}", DriveError, "columns", "x, y, z", "x, y"),
    ("lidar: {height_m: high}", DriveError, "height_m", "a number", "high"),
    ("lidar: {height_m: -1}", DriveError, "height_m", "a positive number", "-1"),
    ("lidar: {axes: [left, left, up]}", DriveError, "axes", "right-handed", "left, left, up"),
    ("lidar: {axes: [left, over, up]}", DriveError, "axes 2", "one of forward", "over"),
    ("lidar: {pitch_deg: 120}", DriveError, "pitch_deg", "at most 90", "120"),
    ("lidar: {scans: nowhere}", DriveError, "scans", "a file or folder", "nowhere"),
    ("lidar: {sensor: VLP-17}", UsageError, "VLP-17", "VLP-16", ""),
    ("lidar: {elevations_deg: [1, 2]}", DriveError, "elevations_deg", "highest first", ""),
    (LIDAR + "labels: nowhere.txt", DriveError, "labels", "a file or folder", "nowhere.txt"),
    (LIDAR + "poses: {file: a.txt}", DriveError, "poses", "format", "no such name"),
    (LIDAR + CAMERA + "  model: round", DriveError, "model", "pinhole, fisheye", "round"),
    (LIDAR + CAMERA + "  distortion: [1]", DriveError, "distortion", "0, 4, 5", "1"),
    (LIDAR + CAMERA.replace("fx_px: 30", "fx_px: 0"), DriveError, "fx_px", "positive", "0"),
    (LIDAR + CAMERA + "  size_px: [1]", DriveError, "size_px", "width and height", "1"),
    (LIDAR + CAMERA.replace("matrix: [[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0]]", "translation_m: [1, 2, 3]"),
     DriveError, "extrinsics", "one of matrix", "none"),
    (LIDAR + CAMERA.replace("[1, 0, 0, 0]", "[2, 0, 0, 0]"), DriveError, "extrinsics", "a rotation", "none"),
    (LIDAR + CAMERA.replace("[1, 0, 0, 0]", "[2, 0, 0]"), DriveError, "extrinsics", "4 numbers", "other"),
    (LIDAR + CAMERA, DriveError, "images", "a file or folder", "camera"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "kind", "where", "expected", "found"), BAD_YAML)
def test_a_fault_of_drive_yaml_is_one_sentence(folder, text, kind, where, expected, found):
    (folder / "drive.yaml").write_text(text)
    with pytest.raises(PerceptionError) as raised:
        open_drive(folder)
    error = raised.value
    assert type(error) is kind
    assert where in error.where
    assert expected in error.expected
    assert found in error.found


def test_a_folder_of_described_folders_is_several_drives(folder):
    assert sequences_in(folder.parent) == ["drive"]
    assert open_drive(folder.parent, sequence="drive").name == "drive"


def test_scans_alone_are_opened_as_they_are_seen(write_folder):
    root = write_folder([road_scan(index) for index in range(3)])
    drive = open_drive(root)
    assert drive.sensor.name == "HDL-32E"
    assert drive.sensor.height_m == pytest.approx(1.73, abs=0.02)
    assert any("trifuse adopt" in note for note in drive.notes)
    assert any("rate 10 Hz is a guess" in note for note in drive.notes)


ROW = "Car 0 0 0 {} 1.5 1.6 4.0 2 1.7 12 -1.57\n"


def test_rows_of_each_scan_are_in_the_view_of_the_camera(folder):
    write_images(folder, [f"{index:06d}.png" for index in range(4)])
    (folder / "label_2").mkdir()
    (folder / "label_2" / "000002.txt").write_text(ROW.format("1 2 9 8"))
    (folder / "drive.yaml").write_text(LIDAR + CAMERA + "labels: label_2\n")
    drive = open_drive(folder)
    assert not isinstance(drive, LabelledAround)
    assert [len(drive.labels(index)) for index in range(4)] == [0, 0, 1, 0]
    labels = drive.labels(2)
    np.testing.assert_allclose(labels.boxes_velo.bottom_m, [[12, -2, -1.7]], atol=1e-6)
    assert labels.boxes_px.tolist() == [[1, 2, 9, 8]]


def test_rows_of_a_camera_that_is_not_described_are_not_used(folder):
    (folder / "label_2").mkdir()
    (folder / "label_2" / "000002.txt").write_text(ROW.format("1 2 9 8"))
    (folder / "drive.yaml").write_text(LIDAR + "labels: label_2\n")
    drive = open_drive(folder)
    assert not drive.has_labels
    assert "labels are not used, as they need the calibration of a camera" in drive.notes[0]


def test_rows_without_boxes_in_the_image_are_labels_all_round(folder):
    write_images(folder, [f"{index:06d}.png" for index in range(4)])
    (folder / "labels.txt").write_text("2 7 " + ROW.format("-1 -1 -1 -1"))
    (folder / "drive.yaml").write_text(LIDAR + CAMERA + "labels: labels.txt\n")
    drive = open_drive(folder)
    assert isinstance(drive, LabelledAround)
    labels = drive.labels_around(2)
    np.testing.assert_allclose(labels.boxes_velo.bottom_m, [[12, -2, -1.7]], atol=1e-6)
    assert labels.track_ids.tolist() == [7]
