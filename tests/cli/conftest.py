"""A detector whose detections are known: it reads them from the labels."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from data.detections import detected_drive, measured_detectors
from data.open_drive import open_drive
from perception.evaluation.detection.detector_measure import FrameDetections
from perception.maps.densify import DenseMaps, densify
from perception.maps.projection import camera_of, project_scan
from perception.types import Detections, Frame

METADATA = {"method": "labels", "training_data": "nothing at all"}


@pytest.fixture
def label_reader(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Return a function that puts a reader of a drive's labels in the place of DepthCN.

    It proposes every labelled box and detects each as a car, the first with the highest score, and one box that is
    no object in each frame.
    """

    def install(path: Path, sequence: str | None = None, stop_at: int | None = None) -> None:
        drive = open_drive(path, sequence=sequence, images=False)

        def run(detector: object, frame: Frame) -> tuple[FrameDetections, DenseMaps]:
            del detector
            if frame.index == stop_at:
                raise KeyboardInterrupt
            calibration, size_px = camera_of(frame)
            dense = densify(project_scan(frame.points_velo, calibration, size_px))
            labels_px = drive.labels(frame.index).boxes_px
            boxes_px = np.concatenate([labels_px, [[500.0, 10, 600, 80]]])
            scores = np.append(0.9 - 0.1 * np.arange(len(labels_px)), 0.05)
            found = Detections(boxes_px, scores, np.full(len(scores), "Car"))
            return FrameDetections(found, {"reading": 0.002, "guessing": 0.001}, labels_px), dense

        model = SimpleNamespace(metadata=METADATA)
        network = SimpleNamespace(verifier=SimpleNamespace(model=model, class_names=("Car",)))
        for module in (measured_detectors, detected_drive):
            monkeypatch.setattr(module, "open_depthcn", lambda config, sensor: network)
            monkeypatch.setattr(module, "run_depthcn", run)

    return install
