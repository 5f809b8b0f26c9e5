"""A detector whose answers are known: it reads them from the labels."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from data.open_drive import open_drive
from perception.cli.vehicle_detector import DepthCnConfig, VehicleDetectorOutput
from perception.maps.densify import densify
from perception.maps.projection import camera_of, project_scan
from perception.types import Detections, Drive, Frame


@dataclass
class LabelReader:
    """Proposes every labelled box and calls each a car, the first the surest; one ghost in each frame."""

    drive: Drive
    stop_at: int | None = None
    metadata: Mapping[str, str] = field(
        default_factory=lambda: {"method": "labels", "training_data": "nothing at all"}
    )

    def detect(self, frame: Frame) -> VehicleDetectorOutput:
        """Read the labels of a frame, or be interrupted."""
        if frame.index == self.stop_at:
            raise KeyboardInterrupt
        calibration, size_px = camera_of(frame)
        dense = densify(project_scan(frame.points_velo, calibration, size_px))
        labels_px = self.drive.labels(frame.index).boxes_px
        boxes_px = np.concatenate([labels_px, [[500.0, 10, 600, 80]]])
        scores = np.append(0.9 - 0.1 * np.arange(len(labels_px)), 0.05)
        found = Detections(boxes_px, scores, np.full(len(scores), "Car"))
        return VehicleDetectorOutput(
            frame, dense, labels_px, found, {"reading": 0.002, "guessing": 0.001}
        )


@pytest.fixture
def label_reader(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Return a function that puts a `LabelReader` of a drive in the place of the network."""

    def install(path: Path, sequence: str | None = None, stop_at: int | None = None) -> None:
        reader = LabelReader(open_drive(path, sequence=sequence, images=False), stop_at)
        monkeypatch.setattr(DepthCnConfig, "open", lambda self, sensor: reader)

    return install
