"""`trifuse evaluate robustness`: a corruption lowers the metrics of the modalities that it affects."""

import json
from dataclasses import dataclass, field
from types import MappingProxyType

import cv2
import numpy as np
import pytest

from data.detections import measured_detectors
from data.open_drive import open_drive
from perception.cli.main import main
from perception.detection.detectors.multimodal import MultimodalDetector
from perception.detection.fusion.nms_fusion import NmsFusion
from perception.errors import UsageError
from perception.types import MODALITIES, Detections
from tests.car_frames import SIZE_PX, write_car_frames
from tests.faults import command, fault


@dataclass
class BrightPlaces:
    """Detects a car where a known place of its image is bright."""

    modality: str
    boxes_px: np.ndarray
    filling: str = "default"
    class_names: tuple[str, ...] = ("Car",)
    metadata: dict = field(default_factory=dict)

    def detect(self, image, region=None, first_row=0):
        corners = self.boxes_px.astype(int)
        scores = np.array([image[y1:y2, x1:x2].mean() / 255 for x1, y1, x2, y2 in corners])
        found = scores > 0.2
        return Detections(self.boxes_px[found], scores[found], np.full(found.sum(), "Car"))


class BestPlace:
    metadata = MappingProxyType({})

    def fuse(self, scene):
        return NmsFusion().fuse(scene)


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
    opened = MultimodalDetector({name: BrightPlaces(name, boxes_px) for name in MODALITIES})
    monkeypatch.setattr(measured_detectors, "open_modalities", lambda config: opened)
    fusions = {"default": BestPlace()}
    monkeypatch.setattr(
        measured_detectors, "open_fusions", lambda config, further, detector: fusions
    )
    return root


def evaluate(*words):
    return main(["evaluate", "robustness", *map(str, words)])


LEVELS = (
    *("--levels.darkness", "1,7"),
    *("--levels.point-dropout", "0.1"),
    *("--levels.rotation", "40"),
    *("--levels.shift", "1,300"),
)


def test_a_corruption_lowers_the_affected_modalities_alone(bright_cars, tmp_path, capsys):
    plot, out = tmp_path / "curves.png", tmp_path / "curves.json"
    assert evaluate(bright_cars, *LEVELS, "--plot", plot, "--json", out) == 0
    results = json.loads(out.read_text())["results"][str(bright_cars)]

    def found(corruption, level):
        rows = results[corruption][level]
        return [one["0.7"]["moderate"]["found"] or 0 for one in rows.values()]

    # Color, depth, reflectance, merged, fused; two cars.
    assert found("darkness of the camera [stops]", "0") == [2, 2, 2, 2, 2]
    assert found("darkness of the camera [stops]", "1") == [2, 2, 2, 2, 2]
    assert found("darkness of the camera [stops]", "7") == [0, 2, 2, 2, 2]
    assert found("LiDAR point dropout [share]", "0.1") == [2, 2, 2, 2, 2]
    assert found("calibration shifted [pixels]", "1") == [2, 2, 2, 2, 2]
    assert found("calibration shifted [pixels]", "300")[0] == 2
    assert max(found("calibration shifted [pixels]", "300")[1:3]) < 2
    assert max(found("calibration rotated [degrees]", "40")[1:3]) < 2
    printed = capsys.readouterr().out
    assert "darkness of the camera [stops]: AP R40 [%], moderate" in printed
    assert plot.stat().st_size > 10_000


def test_darkness_is_left_out_of_drives_without_images(bright_cars, capsys):
    (bright_cars / "training/image_2/000000.png").unlink()
    (bright_cars / "training/image_2").rmdir()
    assert evaluate(bright_cars, *LEVELS) == 0
    printed = capsys.readouterr().out
    assert "darkness of" not in printed
    assert "color" not in printed
    assert "LiDAR point dropout" in printed


def test_a_dropout_of_all_points_is_an_error(bright_cars):
    with fault(UsageError, expected="from 0 to below 1", found="1.5"):
        command("evaluate", "robustness", bright_cars, "--levels.point-dropout", "1.5")
