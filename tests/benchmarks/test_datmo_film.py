"""The film of the thesis' motion grids: its frames, its figure, and what it measures."""

import json

import av
import cv2
import pytest

from benchmarks.studies.datmo_film import DatmoFilmConfig, datmo_film
from data.synthetic import traffic_scenes
from data.synthetic.drive import CachedDrive
from perception.cli.main import main
from perception.errors import UsageError
from perception.sensor import VLP_16
from tests.faults import fault

FRAMES = 6


@pytest.fixture(scope="module")
def drive():
    return CachedDrive(FRAMES, sensor=VLP_16)


def test_three_scenes_follow_each_other_in_one_film(drive, tmp_path, monkeypatch, capsys):
    asked = []

    def make(name, frames, *, sensor):
        asked.append((name, frames, sensor.name))
        return drive

    monkeypatch.setattr(traffic_scenes, "TrafficSceneDrive", make)
    out = tmp_path / "film.jpg"
    datmo_film("synthetic", config=DatmoFilmConfig(sensor="VLP-16", frames=4), out=out)
    assert asked == [(name, 4, "VLP-16") for name in ("highway", "junction", "crossing")]
    with av.open(str(out.with_suffix(".mp4"))) as film:
        images = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    assert len(images) == 3 * 4
    height, width = images[0].shape[:2]
    # A row for each scene, three moments in each.
    assert cv2.imread(str(out)).shape == (3 * (height // 2), 3 * (width // 2), 3)
    assert str(out.with_suffix(".mp4")) in capsys.readouterr().out
    document = json.loads(out.with_suffix(".json").read_text())
    (row,) = document["results"]["tracks"].values()
    assert row["frames"] == 4
    assert row["never tracked"] <= row["moving objects"]


def test_a_recorded_drive_is_measured_in_the_camera_s_view(kitti_root, tmp_path):
    out = tmp_path / "film.jpg"
    words = [str(kitti_root / "tracking"), "--sequence", "0000", "--frames", "4"]
    assert main(["study", "datmo-film", *words, "--out", str(out)]) == 0
    document = json.loads(out.with_suffix(".json").read_text())
    assert document["conditions"]["protocols"]["0000"]["view"] == "camera"
    assert document["results"]["tracks"]["0000"]["frames"] == 4


def test_a_film_without_frames_is_refused():
    with fault(UsageError, where="--frames", found="0"):
        DatmoFilmConfig(frames=0)
