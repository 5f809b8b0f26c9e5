"""Long vehicles in jams: points, ids and poses of a drive, and the table of several."""

import json

import cv2
import numpy as np
import pytest

from benchmarks.studies.jams import JamCounts, JamsConfig, _Poses, _Vehicles, measure_drive
from data.synthetic.drive import CachedDrive
from perception.errors import UsageError
from perception.evaluation.confusion import Confusion
from perception.evaluation.multi_object.track_assignment import MovingScene
from perception.evaluation.objects import LabelledObjects, MotionState
from perception.geometry.se3 import from_euler, from_rotation_translation
from perception.sensor import VLP_16
from perception.types import Boxes3D, Tracks
from tests.faults import command, fault


@pytest.fixture(scope="module")
def drive():
    return CachedDrive(5, sensor=VLP_16)


def test_counts_of_drives_are_added():
    one = JamCounts(Confusion(8, 1, 1), Confusion(3, 1, 0), 4, 2, 3, 3, (0.01, 0.02), 1)
    both = one + JamCounts(Confusion(2, 0, 0), Confusion(3, 0, 1), 1, 0, 3, 0, (0.03,), 0)
    assert (both.points.iou, both.long_points.iou) == pytest.approx((10 / 12, 6 / 8))
    assert (both.vehicles, both.untracked, both.ids_per_vehicle) == (5, 2, 2.0)
    assert both.values[5:] == pytest.approx([3, 0.02, 0.028, 1])
    assert np.isnan(JamCounts(Confusion(), Confusion(), 1, 1, 0, 1, (0.0,), 0).ids_per_vehicle)


def moving_lorry(x_m: float) -> MovingScene:
    """A lorry of 12 m along x, with its middle at x."""
    boxes = Boxes3D(np.array([[x_m, 0.0, 0.0]]), np.array([[12.0, 2.5, 3.0]]), np.zeros(1))
    objects = LabelledObjects(boxes, np.array([MotionState.MOVING]), np.array([7]))
    return MovingScene(objects, np.array([[1.0, 0.0]]), np.array([True]), np.array([500]))


def tracks_of(*boxes: tuple[int, float, float]) -> Tracks:
    """Tracks of an id, a middle on the x axis and a length each."""
    count = len(boxes)
    bottom_m = np.array([[x_m, 0.0, 0.0] for _, x_m, _ in boxes])
    sizes_m = np.array([[length_m, 2.0, 2.0] for *_, length_m in boxes])
    return Tracks.unclassified(
        np.array([number for number, *_ in boxes]),
        Boxes3D(bottom_m, sizes_m, np.zeros(count)),
        np.zeros((count, 2)),
        np.ones(count, bool),
        np.zeros((count, 4, 4)),
        np.zeros((count, 4)),
    )


def test_a_rear_is_an_id_on_its_vehicle_but_not_the_whole_of_it():
    vehicles = _Vehicles()
    vehicles.update(moving_lorry(16.0), tracks_of((3, 11.0, 2.0), (4, 2.0, 4.0)))
    assert (vehicles.ids_of, vehicles.whole) == ({7: {3}}, set())
    vehicles.update(moving_lorry(16.0), tracks_of((3, 11.0, 2.0), (5, 15.5, 11.0)))
    assert (vehicles.ids_of, vehicles.whole) == ({7: {3, 5}}, {7})


def test_the_error_is_that_of_the_motion_over_a_second_or_since_a_reset(drive):
    poses = _Poses(drive)
    for index in range(5):
        true = drive.true_world_SE3_velo(index)
        start = from_euler(0, 0, 0.3, np.array([5.0, -2.0, 0.0]))  # a world of its own
        along = from_rotation_translation(np.eye(3), np.array([0.1 * index, 0.0, 0.0]))
        poses.update(index, start @ true @ along, is_reset=index in (0, 3))
    assert poses.errors_m == pytest.approx([0, 0.1, 0.2, 0, 0.1], abs=1e-4)
    assert poses.resets == 1


@pytest.mark.parametrize("has_ins", [True, False])
def test_the_vehicles_of_a_street_are_measured(drive, has_ins):
    counts = measure_drive(drive, JamsConfig(first_frame=3, min_length_m=3.5), has_ins=has_ins)
    assert len(counts.errors_m) == 2
    assert max(counts.errors_m) < 0.05
    assert counts.resets == 0
    assert 0 < counts.long_points.true_points < counts.points.true_points
    assert counts.vehicles > 0
    assert counts.untracked + counts.ids >= counts.vehicles


@pytest.mark.slow
def test_the_study_has_a_row_for_each_drive(tmp_path, capsys):
    out = tmp_path / "jams.png"
    words = ["--sensor", "VLP-16", "--frames", "3", "--first-frame", "2", "--workers", "1"]
    command("study", "jams", *words, "--seed", "101", "--out", str(out))
    rows = json.loads(out.with_suffix(".json").read_text())["results"]["drives"]
    assert list(rows) == ["INS, 101", "no INS, 101", "INS, all", "no INS, all"]
    assert rows["INS, 101"]["long vehicles"] == rows["INS, all"]["long vehicles"]
    assert cv2.imread(str(out)).std() > 5
    assert "ids/vehicle" in capsys.readouterr().out


def test_a_drive_without_a_frame_that_counts_is_refused():
    with fault(UsageError, "--frames 15", expected="more than the 15"):
        command("study", "jams", "--frames", "15")
    with fault(UsageError, "--min-length-m", expected="a length above 0"):
        command("study", "jams", "--min-length-m", "0")
