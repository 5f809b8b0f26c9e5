"""KITTI-360 as it is downloaded: numbers, poses, projection, labels, and what a part of the download allows."""

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from data.derived.moving_truth import MovingTruth, moving_truth
from data.inspection import inspect_drive
from data.kitti360.drive import Kitti360Drive
from data.layouts import OpenConfig
from data.open_drive import open_drive, sequences_in
from data.synthetic.ins import InsNoise
from perception.errors import CalibrationError, DriveError, PoseError, UsageError
from perception.geometry.boxes import transform_boxes
from perception.sensor import VLP_16
from tests.faults import fault
from tests.kitti360_writer import BASELINE_M, FIRST, NAME, points_px, true_pose, write_kitti360
from tests.other_layouts import GridDrive
from tests.tiny_drive import TinyDrive

# Of ten frames, numbered from 5: one has no scan; the first, the last and two others have no pose.
SCANS, POSED = (0, 1, 2, 4, 5, 6, 7, 8, 9), (1, 2, 4, 6, 7, 8)


@pytest.fixture(scope="module")
def exact() -> GridDrive:
    return GridDrive(10, seed=3, sensor=VLP_16, noise=InsNoise(0.0, 0.0))


@pytest.fixture(scope="module")
def root(make_once: Callable[[str, Callable[[Path], object]], Path], exact: GridDrive) -> Path:
    return make_once(
        "kitti360", lambda folder: write_kitti360(folder, exact, scans=SCANS, posed=POSED)
    )


@pytest.fixture(scope="module")
def drive(root: Path) -> Kitti360Drive:
    opened = open_drive(root, sensor="VLP-16")
    assert isinstance(opened, Kitti360Drive)
    return opened


@pytest.fixture
def tiny(tmp_path: Path) -> Path:
    return write_kitti360(tmp_path / "set", TinyDrive())


def test_frames_keep_their_numbers_names_and_times(drive, exact):
    assert (drive.name, len(drive), drive.is_sequence) == (NAME, 9, True)
    assert drive.frame_numbers == (5, 6, 7, 9, 10, 11, 12, 13, 14)
    assert drive.frame_names[0] == "000005"
    assert [drive.stamp_s(i) for i in range(9)] == pytest.approx(
        [0.5, 0.6, 0.7, 0.9, 1.0, 1.1, 1.2, 1.3, 1.4], abs=1e-9
    )
    # Row 0 of the times is that of frame 0, which has no scan.
    assert drive.origin_ns == np.datetime64("2013-05-28T08:46:29.623456789").astype(int)
    np.testing.assert_array_equal(drive.points_velo(3), exact.scan(4).points_velo)


def test_a_drive_is_named_by_each_of_its_folders(root):
    assert sequences_in(root) == sequences_in(root / "data_3d_raw") == [NAME]
    assert sequences_in(root / "data_3d_raw" / NAME) == [None]
    assert open_drive(root, sequence="0", sensor="VLP-16", images=False).name == NAME
    for path in (root / "data_3d_raw", root / "data_3d_raw" / NAME):
        found = open_drive(path, sensor="VLP-16", images=False)
        assert (found.name, found.has_poses, found.has_labels) == (NAME, True, True)


def test_poses_are_the_truth_and_interpolated_where_they_are_missing(drive, exact):
    assert drive.has_poses
    for index, number in enumerate(drive.frame_numbers):
        pose, true = drive.world_SE3_velo(index), true_pose(exact, number - FIRST)
        if number - FIRST in POSED:
            np.testing.assert_allclose(drive.poses.in_file(pose), true, atol=1e-9)
        elif number == 10:  # between 9 and 11, at 11 m/s
            np.testing.assert_allclose(drive.poses.in_file(pose), true, atol=5e-3)
        else:  # before the first pose and after the last
            assert pose is None
    first = drive.world_SE3_velo(1)
    np.testing.assert_array_equal(first[:3, 3], np.zeros(3))


def test_what_is_left_out_or_interpolated_is_stated(drive, root):
    assert drive.notes == (
        f"{root}/data_2d_raw/{NAME}: image_02 and image_03 are left out, as detectors and maps take images of a "
        "pinhole camera, not of a fisheye lens",
        f"{root}/data_poses/{NAME}/poses.txt: 3 of 9 scans have no pose: 1 interpolated between neighbours, "
        "2 left to registration",
    )


def test_points_are_projected_to_the_pixels_that_show_them(drive, exact):
    for index in (0, 4):
        frame = drive[index]
        columns, rows = points_px(frame.calibration.image_P_velo, frame.points_velo)
        shown = frame.image[rows, columns, 0]
        assert len(shown) > 500
        # A point on the edge of a pixel may round to the next one.
        assert (shown == 255).mean() > 0.999
        assert (frame.image == 255).mean() < 0.05
    np.testing.assert_allclose(
        drive.calibration.image_P_velo, exact.calibration.image_P_velo, atol=1e-8
    )
    assert drive.calibration.image_size_px == (1242, 375)


def test_the_right_camera_is_a_baseline_away(root, drive):
    right = open_drive(root, images=False, config=OpenConfig(camera="image_01")).calibration
    shift_px = drive.calibration.image_P_cam - right.image_P_cam
    assert shift_px[0, 3] / right.image_P_cam[0, 0] == pytest.approx(BASELINE_M)
    np.testing.assert_array_equal(right.cam_SE3_velo, drive.calibration.cam_SE3_velo)
    with fault(UsageError, "--camera image_02", "image_00 or image_01", "a fisheye camera"):
        open_drive(root, config=OpenConfig(camera="image_02"))


@pytest.mark.parametrize("index", [1, 2, 3, 4])  # the last has an interpolated pose
def test_labels_are_the_boxes_of_the_world(drive, exact, index):
    labels = drive.labels_around(index)
    known = exact.labels_around(drive.frame_numbers[index] - FIRST)
    offsets_m = np.linalg.norm(
        labels.boxes_velo.bottom_m[None] - known.boxes_velo.bottom_m[:, None], axis=2
    )
    rows = offsets_m.argmin(axis=1)
    assert len(set(rows.tolist())) == len(known) > 60
    tolerance_m = 0.03 if index == 4 else 1e-6
    assert offsets_m.min(axis=1).max() < tolerance_m
    np.testing.assert_allclose(labels.boxes_velo.size_m[rows], known.boxes_velo.size_m, atol=1e-9)
    turns = np.angle(np.exp(1j * (labels.boxes_velo.yaw_rad[rows] - known.boxes_velo.yaw_rad)))
    # Boxes of the labels are upright along the axes of the LiDAR, which is tilted by fractions of a degree.
    np.testing.assert_allclose(turns, 0, atol=2e-3)
    kinds = {"Van": "Car", "Person_sitting": "Pedestrian"}
    assert labels.types[rows].tolist() == [kinds.get(str(one), str(one)) for one in known.types]
    assert labels.dont_care_px.shape == (0, 4)
    # A track keeps its id.
    others = drive.labels_around(2).track_ids
    assert len(np.intersect1d(labels.track_ids, others)) > 60


def test_a_frame_without_a_pose_has_no_labels_and_is_dont_care(drive):
    assert drive.labels_around(0) is None
    labels = drive.labels(0)
    assert len(labels) == 0
    assert labels.dont_care_px.tolist() == [[0.0, 0.0, 1242.0, 375.0]]


def test_labels_in_the_view_have_boxes_in_the_image(drive):
    labels, around = drive.labels(1), drive.labels_around(1)
    assert 10 < len(labels) < len(around)
    low, high = labels.boxes_px[:, :2], labels.boxes_px[:, 2:]
    assert (low >= 0).all() and (high > low).all() and (high <= (1242, 375)).all()


def test_motion_of_labels_is_that_of_the_world(drive, exact):
    truth = moving_truth(drive, "all")
    assert [posed is None for posed in truth.posed] == [True, *[False] * 7, True]
    known = moving_truth(exact, "all")
    found_m, known_m = _places_of_movers(truth, 2), _places_of_movers(known, 2)
    assert len(found_m) > 3
    offsets_m = np.linalg.norm(found_m[:, None] - known_m[None], axis=2)
    assert offsets_m.min(axis=1).max() < 1e-6


def _places_of_movers(truth: MovingTruth, index: int) -> np.ndarray:
    """Return where the moving objects of a frame are."""
    posed = truth.posed[index]
    moves = np.isin(posed.labels.track_ids, truth.motion.moving_tracks())
    return posed.labels.boxes_velo.bottom_m[moves]


def test_check_finds_no_fault_and_states_every_note(root):
    report = inspect_drive(open_drive(root, sensor=_sensor(root)))
    assert [one.first_example for one in report.findings if one.is_fault] == []
    notes = [one.first_example for one in report.findings if one.what.startswith("data not used")]
    assert ["fisheye" in note or "registration" in note for note in notes] == [True, True]
    assert "gaps in the numbering" in report.text()


def _sensor(root: Path) -> str:
    """Return a file of the sensor of the drive."""
    from perception.sensor import sensor_to_json

    path = root.parent / "vlp16.json"
    path.write_text(sensor_to_json(VLP_16))
    return str(path)


def test_a_part_of_a_drive_keeps_its_poses_and_labels(drive):
    part = drive.select([1, 3])
    assert part.frame_numbers == (6, 9)
    np.testing.assert_array_equal(part.world_SE3_velo(1), drive.world_SE3_velo(3))
    assert part.labels_around(1).track_ids.tolist() == drive.labels_around(3).track_ids.tolist()
    assert part[0].image is not None


def test_poses_of_the_camera_stand_in_for_those_of_the_imu(tiny):
    expected = open_drive(tiny, sensor="VLP-16").world_SE3_velo(1)
    (tiny / f"data_poses/{NAME}/poses.txt").unlink()
    found = open_drive(tiny, sensor="VLP-16").world_SE3_velo(1)
    np.testing.assert_allclose(found, expected, atol=1e-9)
    (tiny / "calibration/calib_cam_to_pose.txt").unlink()
    assert open_drive(tiny, sensor="VLP-16").has_poses


@pytest.mark.parametrize(
    ("part", "left", "note"),
    [
        ("data_2d_raw", (False, True, True), None),
        ("data_poses", (True, False, False), "boxes are not used without poses"),
        ("data_3d_bboxes", (True, True, False), None),
        ("calibration", (True, False, False), "poses are not used without calib_cam_to_velo.txt and"),
        ("calibration/perspective.txt", (True, True, True), "images cannot be joined to points without perspective.txt"),
        ("calibration/calib_cam_to_pose.txt", (True, True, True), None),
    ],
)  # fmt: skip
def test_a_part_of_the_download(tiny, part, left, note):
    path = tiny / part
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()
    drive = open_drive(tiny, sensor="VLP-16")
    assert (drive.has_images, drive.has_poses, drive.has_labels) == left
    assert (drive.calibration is None) == (part in ("calibration", "calibration/perspective.txt"))
    assert len(list(drive)) == 2
    assert note is None or any(note in one for one in drive.notes)
    if drive.has_labels:
        assert len(drive.labels(0)) == 1
    else:
        with fault(DriveError, NAME, "a drive with labelled boxes"):
            drive.labels(0)


def test_ins_packets_alone_are_not_used(tiny):
    folder = tiny / "data_poses" / NAME
    for name in ("poses.txt", "cam0_to_world.txt"):
        (folder / name).unlink()
    (folder / "oxts/data").mkdir(parents=True)
    notes = [one for one in open_drive(tiny, sensor="VLP-16").notes if "INS packets" in one]
    assert len(notes) == 1


def test_frames_outside_of_all_windows_are_not_labelled(tiny):
    path = tiny / f"data_3d_bboxes/train/{NAME}.xml"
    text = path.read_text().replace("<end_frame>6<", "<end_frame>5<")
    path.write_text(text)
    drive = open_drive(tiny, sensor="VLP-16")
    assert [labels is None for labels in map(drive.labels_around, range(2))] == [False, True]
    # The release with all boxes comes first.
    whole = tiny / f"data_3d_bboxes/train_full/{NAME}.xml"
    whole.parent.mkdir()
    whole.write_text(text.replace("<end_frame>5<", "<end_frame>6<"))
    assert len(open_drive(tiny, sensor="VLP-16").labels_around(1)) == 1


def test_scans_alone(tiny):
    for part in ("data_2d_raw", "data_poses", "data_3d_bboxes", "calibration"):
        shutil.rmtree(tiny / part)
    (tiny / f"data_3d_raw/{NAME}/velodyne_points/timestamps.txt").unlink()
    drive = open_drive(tiny, sensor="VLP-16")
    assert (drive.notes, drive.calibration, drive.stamp_s(1)) == ((), None, pytest.approx(0.1))


def test_a_download_without_scans(tiny):
    shutil.rmtree(tiny / "data_3d_raw")
    with fault(DriveError, "set", "scans of KITTI-360", "only data_2d_raw, data_poses", "download"):
        open_drive(tiny)


def _rewrite(path: Path, change: Callable[[list[str]], list[str]]) -> None:
    path.write_text("".join(f"{row}\n" for row in change(path.read_text().splitlines())))


@pytest.mark.parametrize(
    ("change", "where", "expected", "found"),
    [
        (lambda rows: [rows[0], rows[1][:40]], "row 2", "13 numbers", "words"),
        (lambda rows: [rows[0], rows[0]], "row 2", "frame numbers that rise", "5 "),
        (lambda rows: ["0.5" + rows[0][1:]], "row 1", "frame numbers that rise", "0.5 "),
        (lambda rows: ["5 " + " ".join(["1"] * 12)], "row 1", "a rotation", "5 1 1"),
        (lambda rows: ["5 1 0 0 1e30 0 1 0 0 0 0 1 0"], "row 1", "a position within 1e+07 m", "1e+30"),
        (lambda rows: ["5 1 0 0 nan 0 1 0 0 0 0 1 0"], "row 1", "13 finite numbers", "NaN"),
        (lambda rows: [rows[0], "x " * 13], "", "13 numbers a row", "could not convert"),
        (lambda rows: [], "", "a row for each pose", "none"),
    ],
)  # fmt: skip
def test_damaged_poses(tiny, change, where, expected, found):
    _rewrite(tiny / f"data_poses/{NAME}/poses.txt", change)
    with fault(PoseError, f"poses.txt {where}".strip(), expected, found):
        open_drive(tiny)


@pytest.mark.parametrize(
    ("name", "text", "expected", "found"),
    [
        ("calib_cam_to_velo.txt", "1 2 3", "12 numbers", "3 words"),
        ("calib_cam_to_velo.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n" * 2, "one row of 12 numbers", "2 rows"),
        ("calib_cam_to_velo.txt", " ".join(["1"] * 12), "a rotation", "another matrix"),
        ("calib_cam_to_pose.txt", "image_01: 1 2", "the key image_00", "only image_01"),
        ("calib_cam_to_pose.txt", "image_00: 2 0 0 0 0 2 0 0 0 0 2 0", "a rotation", "another matrix"),
        ("perspective.txt", "S_rect_00: 1 2", "the key P_rect_00", "only S_rect_00"),
    ],
)  # fmt: skip
def test_damaged_calibrations(tiny, name, text, expected, found):
    (tiny / "calibration" / name).write_text(text)
    with fault(CalibrationError, name, expected, found):
        open_drive(tiny)


def test_a_vehicle_that_stands_is_interpolated_over_any_time(tmp_path):
    root = write_kitti360(tmp_path, TinyDrive())
    folder = root / f"data_3d_raw/{NAME}/velodyne_points"
    first = (folder / f"data/{FIRST:010d}.bin").read_bytes()
    for number in (15, 25):  # one and two seconds later
        (folder / f"data/{number:010d}.bin").write_bytes(first)
    (folder / "timestamps.txt").unlink()
    row = "1 0 0 {} 0 1 0 0 0 0 1 0".format
    poses = root / f"data_poses/{NAME}/poses.txt"
    for metres, known in ((0.4, True), (3.0, False)):
        poses.write_text(f"5 {row(0)}\n6 {row(0)}\n25 {row(metres)}\n")
        drive = open_drive(root, sensor="VLP-16")
        assert drive.frame_numbers == (5, 6, 15, 25)
        assert (drive.world_SE3_velo(2) is not None) == known
        # Who drives past meanwhile was not annotated.
        assert drive.labels_around(2) is None
        assert len(drive.labels(2).dont_care_px) == 1
        if known:
            moved_m = np.linalg.norm(
                drive.world_SE3_velo(2)[:3, 3] - drive.world_SE3_velo(1)[:3, 3]
            )
            assert moved_m == pytest.approx(0.4 * 9 / 19)


def test_boxes_are_transformed_as_points_are(drive):
    """The labels of two frames are at one place of the world where they stand."""
    places = []
    for index in (1, 6):
        labels = drive.labels_around(index)
        world = transform_boxes(drive.world_SE3_velo(index), labels.boxes_velo)
        places.append(dict(zip(labels.track_ids.tolist(), world.bottom_m, strict=True)))
    both = places[0].keys() & places[1].keys()
    moved_m = [np.linalg.norm(places[0][track] - places[1][track]) for track in both]
    assert np.sum(np.array(moved_m) < 1e-9) > 20
