"""What detectors see is kept by all that makes it, and frames keep their labels."""

from dataclasses import dataclass

import numpy as np
import pytest

from data.array_store import ArrayStore
from data.detections.cached_detections import (
    FingerprintedDetector,
    detect_drives,
)
from data.detections.detected_frames import DetectedFrames
from data.open_drive import open_drive
from perception.detection.fusion.detected_scene import DetectedScene
from perception.errors import DriveError, PerceptionError, ScanError
from perception.types import Detections
from tests.car_frames import write_car_frames
from tests.faults import fault
from tests.simulated_detectors import simulated_frames


@pytest.fixture
def car_frames(tmp_path):
    return write_car_frames(tmp_path / "cars", frames=2)


@dataclass(frozen=True)
class ToyOutput:
    scene: DetectedScene


class ToyDetector:
    """Sees one box in the depth map, nothing in the image; counts its looks."""

    def __init__(self, fails_at=-1):
        self.looks, self._fails_at = 0, fails_at

    def detect(self, frame):
        self.looks += 1
        if frame.index == self._fails_at:
            raise ScanError("scan", expected="points", found="none")
        box = Detections(np.array([[10.0, 20, 30, 40]]), np.array([0.7]), np.array(["Car"]))
        return ToyOutput(DetectedScene({"rgb": Detections.empty(), "dm": box}, (620, 190)))


def test_detectors_run_once_on_each_frame(car_frames, tmp_path):
    drive, detector, store = open_drive(car_frames), ToyDetector(), ArrayStore(tmp_path / "kept")
    first = detect_drives([drive], FingerprintedDetector(detector, "a"), store)
    again = detect_drives([drive], FingerprintedDetector(detector, "a"), store)
    assert detector.looks == len(drive) == len(first)
    for scene in (*first.scenes, *again.scenes):
        assert list(scene.modality_detections) == ["rgb", "dm"]
        assert scene.modality_detections["dm"].boxes_px.tolist() == [[10, 20, 30, 40]]
        assert scene.modality_detections["dm"].types.tolist() == ["Car"]
        assert scene.size_px == (620, 190)
    labels = drive.labels(0)
    own = first.truth_of(0)
    np.testing.assert_array_equal(own.boxes_px[: len(labels)], labels.boxes_px)


def test_other_models_run_again(car_frames, tmp_path):
    drive, detector, store = open_drive(car_frames), ToyDetector(), ArrayStore(tmp_path / "kept")
    for fingerprint in ("dm 1, rgb 2", "dm 2, rgb 1"):
        detect_drives([drive], FingerprintedDetector(detector, fingerprint), store)
    assert detector.looks == 2 * len(drive)


def test_a_bad_frame_is_left_out_with_its_labels(car_frames, tmp_path):
    drive, store = open_drive(car_frames), ArrayStore(tmp_path / "kept")
    bad = FingerprintedDetector(ToyDetector(fails_at=0), "a")
    with pytest.raises(ScanError):
        detect_drives([drive], bad, store)
    kept = detect_drives([drive], bad, store, "skip")
    assert len(kept) == 1
    np.testing.assert_array_equal(kept.truth_of(0).boxes_px, drive.labels(1).boxes_px)
    with fault(DriveError, expected="labelled frames", found="none"):
        detect_drives([], bad, store)


def test_chosen_frames_are_renumbered():
    frames = simulated_frames(5, 0)
    chosen = frames[np.array([3, 1])]
    assert len(chosen) == 2
    assert chosen.scenes == (frames.scenes[3], frames.scenes[1])
    for new, old in ((0, 3), (1, 1)):
        of_new, of_old = chosen.truth_of(new), frames.truth_of(old)
        np.testing.assert_array_equal(of_new.boxes_px, of_old.boxes_px)
        assert (of_new.frames == new).all()


def test_labels_of_frames_that_are_not_there_are_refused():
    frames = simulated_frames(3, 0)
    with fault(PerceptionError, expected="labels of 2 frames"):
        DetectedFrames(frames.scenes[:2], frames.truth)
