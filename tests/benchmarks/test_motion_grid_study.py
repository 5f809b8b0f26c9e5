import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from benchmarks.studies import motion_grid
from benchmarks.studies.motion_grid import axis_aligned_boxes
from benchmarks.studies.report import DriveOfStudy
from data.results.documents import to_serializable
from data.synthetic.drive import CachedDrive
from perception.cli.main import main
from perception.datmo.config import THESIS
from perception.errors import UsageError
from perception.geometry.footprints import Footprints, footprints_of
from perception.pipeline.lidar_stages import LidarStages
from perception.sensor import VLP_16
from tests.faults import fault


@pytest.fixture(scope="module")
def drive():
    return CachedDrive(7, sensor=VLP_16)


class InMemory(DriveOfStudy):
    """A drive in memory instead of one at a path."""

    drive: CachedDrive

    def open(self, path, *, images=False):
        return InMemory.drive


@pytest.fixture
def source(drive, monkeypatch):
    monkeypatch.setattr(InMemory, "drive", drive, raising=False)
    return InMemory()


def test_the_grids_of_a_drive_without_camera_are_seen_from_above(source, tmp_path):
    plot_path = tmp_path / "grids.png"
    motion_grid.motion_grid("memory", source=source, frame=6, out=plot_path)
    image = cv2.imread(str(plot_path))
    assert image.shape[1] > 2000
    assert image.std() > 20
    document = json.loads(plot_path.with_suffix(".json").read_text())
    cells = {name: row["cells"] for name, row in document["results"]["cells"].items()}
    assert cells["occupied"] > cells["above ground, E"] > cells["(a) subtraction alone"]
    assert cells["(a) subtraction alone"] > cells["(b) after suppression, M"]
    assert cells["after morphology"] >= cells["(c) of objects"]
    assert document["conditions"]["config"] == to_serializable(THESIS)


def test_only_the_scans_of_the_queue_are_read(source, tmp_path, monkeypatch):
    short = replace(THESIS, scans=3)
    monkeypatch.setitem(motion_grid.PRESETS, "thesis", short)
    read = []

    def segment(chain, frame):
        read.append(frame.index)
        return whole(chain, frame)

    whole = LidarStages.segment
    monkeypatch.setattr(LidarStages, "segment", segment)
    motion_grid.motion_grid("memory", source=source, frame=6, out=tmp_path / "grids.png")
    assert read == [3, 4, 5, 6]


def test_boxes_lie_along_the_axes():
    points = np.array([[1, 2, 0.0], [5, 2, 0], [1, 3, 0], [5, 3, 1.5]])
    boxes = axis_aligned_boxes(footprints_of(points, np.zeros(4, int), 1))
    np.testing.assert_allclose(boxes.bottom_m, [[3, 2.5, 0]])
    np.testing.assert_allclose(boxes.size_m, [[4, 1, 1.5]])
    assert len(axis_aligned_boxes(Footprints.empty())) == 0


@pytest.mark.parametrize("frame", [-1, 7])
def test_a_frame_that_is_not_there_is_refused(source, frame, tmp_path):
    with fault(UsageError, where=f"frame {frame}", expected="a frame from 0 to 6"):
        motion_grid.motion_grid("memory", source=source, frame=frame, out=tmp_path / "x.png")


def test_on_the_real_drive_each_step_lies_on_the_image(kitti_root, tmp_path, capsys):
    plot_path = tmp_path / "grids.png"
    arguments = [str(kitti_root / "tracking"), "--sequence", "0000", "--frame", "8"]
    assert main(["study", "motion-grid", *arguments, "--out", str(plot_path)]) == 0
    document = json.loads(plot_path.with_suffix(".json").read_text())
    assert document["repeats"] == "Fig. 5.10"
    assert document["conditions"]["config"]["scans"] == 50
    cells = {name: row["cells"] for name, row in document["results"]["cells"].items()}
    assert cells["(b) after suppression, M"] < 0.4 * cells["(a) subtraction alone"]
    assert "(b) after suppression, M" in capsys.readouterr().out
    # Suppressed cells are red on the image, the others green.
    blue, green, red = cv2.split(cv2.imread(str(plot_path))[:, :1200].astype(int))
    assert ((red - green > 60) & (red - blue > 60)).sum() > 3000
    assert ((green - red > 60) & (green - blue > 60)).sum() > 1000
