"""`trifuse evaluate robustness`: what detectors that look for brightness see less of."""

import json
from dataclasses import dataclass

import cv2
import numpy as np
import pytest

from data.open_drive import open_drive
from perception.cli.evaluations.fusion_steps import FusionFiles
from perception.cli.main import main
from perception.detection.detectors.multimodal import MultimodalDetector
from perception.detection.detectors.nms_fusion import NmsFusion
from perception.types import Detections
from tests.car_frames import SIZE_PX, write_car_frames


@dataclass
class BrightPlaces:
    """Sees a car where a known place of its picture is bright."""

    modality: str
    boxes_px: np.ndarray
    filling: str = "default"
    class_names: tuple[str, ...] = ("Car",)

    def detect(self, picture):
        corners = self.boxes_px.astype(int)
        scores = np.array([picture[y1:y2, x1:x2].mean() / 255 for x1, y1, x2, y2 in corners])
        seen = scores > 0.2
        return Detections(self.boxes_px[seen], scores[seen], np.full(seen.sum(), "Car"))


class BestPlace:
    def fuse_scene(self, scene):
        return NmsFusion().fuse(scene.modality_detections, scene.size_px)


@pytest.fixture
def bright_cars(tmp_path, monkeypatch):
    """Return a frame whose two cars are white in the image, and detectors that know where they are."""
    root = write_car_frames(tmp_path / "cars", frames=1)
    boxes_px = open_drive(root).labels(0).boxes_px
    image = np.zeros((SIZE_PX[1], SIZE_PX[0], 3), np.uint8)
    for x1, y1, x2, y2 in np.rint(boxes_px).astype(int):
        image[y1:y2, x1:x2] = 255
    (root / "training/image_2").mkdir()
    cv2.imwrite(str(root / "training/image_2/000000.png"), image)
    detectors = {name: BrightPlaces(name, boxes_px) for name in ("rgb", "dm", "rm")}
    monkeypatch.setattr(FusionFiles, "open_detectors", lambda self: MultimodalDetector(detectors))
    monkeypatch.setattr(
        FusionFiles, "open_fusions", lambda self, detector: {"default": BestPlace()}
    )
    return root


def evaluate(*words):
    return main(["evaluate", "robustness", *map(str, words)])


LEVELS = (
    *("--levels.darkness", "[1,7]"),
    *("--levels.rays", "[0.1]"),
    *("--levels.degrees", "[40]"),
    *("--levels.pixels", "[1,300]"),
)


def test_only_who_looks_at_what_is_disturbed_sees_less(bright_cars, tmp_path, capsys):
    plot, out = tmp_path / "curves.png", tmp_path / "curves.json"
    assert evaluate(bright_cars, *LEVELS, "--plot", plot, "--json", out) == 0
    results = json.loads(out.read_text())["results"]

    def found(disturbance, level):
        rows = results[disturbance][level]
        of_rows = {name: one["0.7"]["moderate"]["detections"] for name, one in rows.items()}
        return [0 if one is None else one["matches"] for one in of_rows.values()]

    # Color, depth, reflectance, merged, fused; two cars.
    assert found("darkness of the camera [stops]", "0") == [2, 2, 2, 2, 2]
    assert found("darkness of the camera [stops]", "1") == [2, 2, 2, 2, 2]
    assert found("darkness of the camera [stops]", "7") == [0, 2, 2, 2, 2]
    assert found("LiDAR rays lost [share]", "0.1") == [2, 2, 2, 2, 2]
    assert found("calibration shifted [pixels]", "1") == [2, 2, 2, 2, 2]
    assert found("calibration shifted [pixels]", "300")[0] == 2
    assert max(found("calibration shifted [pixels]", "300")[1:3]) < 2
    assert max(found("calibration turned [degrees]", "40")[1:3]) < 2
    printed = capsys.readouterr().out
    assert "darkness of the camera [stops], AP % moderate" in printed
    assert plot.stat().st_size > 10_000


def test_without_a_camera_darkness_is_left_out(bright_cars, capsys):
    (bright_cars / "training/image_2/000000.png").unlink()
    (bright_cars / "training/image_2").rmdir()
    assert evaluate(bright_cars, *LEVELS) == 0
    printed = capsys.readouterr().out
    assert "darkness of" not in printed
    assert "color" not in printed
    assert "LiDAR rays lost" in printed


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--levels.pixels", "[4,2]"), "expected levels that rise from above 0, found 4, 2"),
        (("--levels.rays", "[1.5]"), "share of rays lost: expected from 0 to below 1, found 1.5"),
    ],
)
def test_levels_that_cannot_be(bright_cars, capsys, words, sentence):
    assert evaluate(bright_cars, *words) == 2
    assert sentence in capsys.readouterr().err
