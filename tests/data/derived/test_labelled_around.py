"""Labels of everything around in the place of those of the camera's view."""

from pathlib import Path

import numpy as np
import pytest

from data.derived.motion_labels import evaluation_labels, label_drive_motion
from data.layouts import OpenConfig
from data.open_drive import open_drive
from perception.evaluation.objects import MotionState
from tests.other_layouts import (
    leave_out_instances,
    stamp_ns,
    write_argoverse2,
    write_semantic_kitti,
)
from tests.tiny_drive import TinyDrive


class EightFrames(TinyDrive):
    """0.7 s, long enough to tell that something moves."""

    def __len__(self) -> int:
        return 8


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return write_argoverse2(tmp_path, EightFrames(), images=False, flow=False)


def test_labels_of_an_evaluation(log, tmp_path):
    drive = open_drive(log)
    labels = evaluation_labels(drive, 0)
    np.testing.assert_array_equal(labels.boxes_px, [[-1.0] * 4])
    written = write_semantic_kitti(tmp_path, TinyDrive())
    assert evaluation_labels(open_drive(written), 0).types.tolist() == ["Car"]
    assert evaluation_labels(open_drive(leave_out_instances(written)), 0) is None


def test_boxes_of_instances_are_fitted_once_with_a_progress_bar(tmp_path):
    fitted = []
    config = OpenConfig(progress=lambda frames: fitted.extend(frames) or fitted)
    drive = open_drive(write_semantic_kitti(tmp_path, TinyDrive()), config=config)
    assert fitted == []
    assert len(drive.labels_around(1)) == len(drive.labels_around(0)) == 1
    assert fitted == list(range(len(drive)))


def test_motion_of_a_short_drive_by_the_labels_around_it_in_time(log):
    whole = label_drive_motion(open_drive(log))
    assert set(whole.motions.tolist()) == {MotionState.MOVING}
    assert whole.speeds_m_s == pytest.approx(10.0)  # 5 m/s ahead of a vehicle at 5 m/s
    for index in range(2, 8):
        (log / f"sensors/lidar/{stamp_ns(index)}.feather").unlink()
    short = label_drive_motion(open_drive(log))
    assert short.of(0, np.array([0])).tolist() == [MotionState.MOVING]
    assert short.of(1, np.array([0])).tolist() == [MotionState.MOVING]
    assert sorted(short.frames.tolist()) == [-6, -5, -4, -3, -2, -1, 0, 1]
