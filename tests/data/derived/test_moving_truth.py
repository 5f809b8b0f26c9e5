from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from data.derived.moving_truth import MovingTruth, moving_truth
from data.open_drive import open_drive
from data.synthetic.drive import SyntheticDrive
from data.synthetic.ins import InsNoise
from data.synthetic.writer import write_raw, write_tracking
from perception.errors import DriveError, PoseError
from perception.evaluation.multi_object.track_assignment import MovingScene
from perception.evaluation.objects import MotionState
from perception.sensor import VLP_16
from perception.types import Drive
from tests.faults import fault

FRAMES = 8


@pytest.fixture(scope="module")
def drive() -> SyntheticDrive:
    return SyntheticDrive(FRAMES, sensor=VLP_16, images=False, noise=InsNoise(1.0, 2.0))


@pytest.fixture(scope="module")
def truth(drive: SyntheticDrive) -> MovingTruth:
    return moving_truth(drive, "all")


def scene_at(truth: MovingTruth, drive: Drive, index: int) -> MovingScene:
    scene = truth.scene(drive[index], 0.2)
    assert scene is not None
    return scene


def test_velocities_are_those_of_the_boxes_whatever_the_ins_says(drive, truth):
    before, here, after = (scene_at(truth, drive, index) for index in (3, 4, 5))

    def positions(scene: MovingScene, index: int) -> dict[int, np.ndarray]:
        pose = drive.true_world_SE3_velo(index)
        places = scene.objects.boxes_velo.bottom_m @ pose[:3, :3].T + pose[:3, 3]
        return dict(zip(scene.objects.track_ids.tolist(), places[:, :2], strict=True))

    earlier, later = positions(before, 3), positions(after, 5)
    axes_velo = drive.true_world_SE3_velo(4)[:2, :2]
    moves = here.objects.motions == MotionState.MOVING
    assert moves.sum() >= 5
    for row in np.flatnonzero(moves):
        number = int(here.objects.track_ids[row])
        if number in earlier and number in later:
            expected = (later[number] - earlier[number]) / 0.2 @ axes_velo
            assert here.velocities_m_s[row] == pytest.approx(expected, abs=0.05)


def test_who_moves_holds_points_that_move(drive, truth):
    scene, point_truth = scene_at(truth, drive, 4), drive.point_truth(4)
    seen = scene.points >= 20
    assert (seen & (scene.objects.motions == MotionState.MOVING)).sum() >= 2
    for row in np.flatnonzero(seen & (scene.objects.motions == MotionState.MOVING)):
        own = point_truth.instances == scene.objects.track_ids[row] + 1
        assert point_truth.is_moving[own].all()
        assert scene.points[row] <= 1.1 * own.sum()
    assert (scene.moves_in_drive | (scene.objects.motions != MotionState.MOVING)).all()
    assert not scene.moves_in_drive.all()


def test_the_camera_s_view_has_its_image(drive, truth):
    assert scene_at(truth, drive, 0).view is None
    seen = scene_at(moving_truth(drive, "camera"), drive, 0).view
    assert seen is not None
    assert seen.image_size_px == drive.calibration.image_size_px


def test_without_a_camera_the_virtual_one_has_the_view(drive):
    frame = replace(drive[1], calibration=None, image=None)
    view = moving_truth(drive, "camera").scene(frame, 0.2).view
    assert view.contains(np.array([[20.0, 0, 0], [-20, 0, 0]])).tolist() == [True, False]


@pytest.mark.parametrize("write", [write_raw, write_tracking])
def test_a_written_drive_tells_the_same(drive, truth, tmp_path: Path, write: Callable[..., Path]):
    read = open_drive(write(drive, tmp_path, 0, lambda: None))
    theirs = moving_truth(read, "all")
    here, there = scene_at(truth, drive, 5), scene_at(theirs, read, 5)
    assert np.array_equal(here.objects.track_ids, there.objects.track_ids)
    assert np.array_equal(here.objects.motions, there.objects.motions)
    # Files round a box by micrometres, and a point may lie as close to its side.
    assert np.abs(here.points - there.points).max() <= 1
    np.testing.assert_allclose(
        here.objects.boxes_velo.bottom_m, there.objects.boxes_velo.bottom_m, atol=1e-4
    )
    apart = np.linalg.norm(here.velocities_m_s - there.velocities_m_s, axis=1)
    assert (apart < 0.3).mean() > 0.8  # who brakes or turns has not the mean velocity of a second
    assert truth.types() == theirs.types()


def test_poses_that_do_not_fit_the_drive_are_refused(drive, tmp_path: Path):
    folder = write_raw(drive, tmp_path, 0, lambda: None)
    poses = folder / "truth_poses.txt"
    rows = poses.read_text().splitlines()
    poses.write_text("\n".join(rows[:2]))
    with fault(PoseError, expected="8 rows of 12"):
        moving_truth(open_drive(folder))
    poses.write_text("one two\n")
    with fault(PoseError, expected="12 numbers a row"):
        moving_truth(open_drive(folder))


def test_a_thinned_drive_has_the_poses_of_its_frames(drive, tmp_path: Path):
    written = open_drive(write_raw(drive, tmp_path, 0, lambda: None))
    whole, part = moving_truth(written, "all"), moving_truth(written.select(range(1, 8, 3)), "all")
    for index, number in enumerate((1, 4, 7)):
        thinned, one = part.posed[index], whole.posed[number]
        np.testing.assert_array_equal(thinned.world_SE3_velo, one.world_SE3_velo)
        assert thinned.labels.track_ids.tolist() == one.labels.track_ids.tolist()


def test_recorded_labels_know_the_camera_s_view_only(kitti_root: Path):
    drive = open_drive(kitti_root / "tracking", sequence="0000", images=False)
    scene = moving_truth(drive).scene(drive[0], 0.2)
    moving = scene.objects.track_ids[scene.objects.motions == MotionState.MOVING]
    assert moving.tolist() == [0, 1, 2]
    assert (scene.points[np.isin(scene.objects.track_ids, moving)] >= 20).all()
    assert np.linalg.norm(scene.velocities_m_s, axis=1)[:3] == pytest.approx(
        [4.93, 3.51, 1.12], abs=0.01
    )
    with fault(
        DriveError, expected="labels of all objects around", advice="--protocol.view camera"
    ):
        moving_truth(drive, "all")


def test_a_drive_without_labels_cannot_say_what_moves(kitti_root: Path):
    drive = open_drive(kitti_root / "raw" / "2011_09_26" / "2011_09_26_drive_0005_sync")
    with fault(DriveError, expected="INS poses", advice="such as a tracking sequence"):
        moving_truth(drive)
