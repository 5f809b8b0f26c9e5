import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from benchmarks.studies import motion_grid
from benchmarks.studies.motion_grid import axis_aligned_boxes, study_motion_grid
from data.synthetic.drive import CachedDrive
from perception.cli.main import main
from perception.datmo.config import THESIS
from perception.errors import UsageError
from perception.geometry.footprints import Footprints, footprints_of
from perception.pipeline.lidar_stages import LidarStages
from perception.sensor import VLP_16


@pytest.fixture(scope="module")
def drive():
    return CachedDrive(7, sensor=VLP_16)


def test_the_grids_of_a_drive_without_camera_are_seen_from_above(drive, tmp_path):
    plot_path = tmp_path / "grids.png"
    study = study_motion_grid(drive, plot_path, frame=6, preset="thesis")
    image = cv2.imread(str(plot_path))
    assert image.shape[1] > 2000
    assert image.std() > 20
    cells = study.numbers["cells"]
    assert cells["occupied"] > cells["above ground, E"] > cells["(a) subtraction alone"]
    assert cells["(a) subtraction alone"] > cells["(b) after suppression, M"]
    assert cells["after morphology"] >= cells["(c) of objects"]
    assert study.conditions["config"] == THESIS


def test_a_longer_drive_is_followed_through_the_queue_only(drive, tmp_path, monkeypatch):
    short = replace(THESIS, background=replace(THESIS.background, scans=3))
    monkeypatch.setitem(motion_grid.PRESETS, "thesis", short)
    read = []

    def segment(chain, frame):
        read.append(frame.index)
        return whole(chain, frame)

    whole = LidarStages.segment
    monkeypatch.setattr(LidarStages, "segment", segment)
    study_motion_grid(drive, tmp_path / "grids.png", frame=6, preset="thesis")
    assert read == [3, 4, 5, 6]


def test_boxes_lie_along_the_axes():
    points = np.array([[1, 2, 0.0], [5, 2, 0], [1, 3, 0], [5, 3, 1.5]])
    boxes = axis_aligned_boxes(footprints_of(points, np.zeros(4, int), 1))
    np.testing.assert_allclose(boxes.bottom_m, [[3, 2.5, 0]])
    np.testing.assert_allclose(boxes.size_m, [[4, 1, 1.5]])
    assert len(axis_aligned_boxes(Footprints.empty())) == 0


@pytest.mark.parametrize("frame", [-1, 7])
def test_a_frame_that_is_not_there_is_refused(drive, frame, tmp_path):
    with pytest.raises(UsageError) as error:
        study_motion_grid(drive, tmp_path / "x.png", frame=frame, preset="author")
    assert error.value.where == f"frame {frame}"
    assert error.value.expected.startswith("a frame from 0 to 6")


def test_on_the_real_drive_each_step_lies_on_the_image(kitti_root, tmp_path, capsys):
    plot_path = tmp_path / "grids.png"
    arguments = [str(kitti_root / "tracking"), "--sequence", "0000", "--frame", "8"]
    assert main(["study", "motion-grid", *arguments, "--out", str(plot_path)]) == 0
    document = json.loads(plot_path.with_suffix(".json").read_text())
    assert document["repeats"] == "Fig. 5.10"
    assert document["conditions"]["config"]["background"]["scans"] == 50
    cells = document["results"]["cells"]
    assert cells["(b) after suppression, M"] < 0.4 * cells["(a) subtraction alone"]
    assert "(b) after suppression, M" in capsys.readouterr().out
    # Suppressed cells are red on the image, the others green.
    blue, green, red = cv2.split(cv2.imread(str(plot_path))[:, :1200].astype(int))
    assert ((red - green > 60) & (red - blue > 60)).sum() > 3000
    assert ((green - red > 60) & (green - blue > 60)).sum() > 1000
