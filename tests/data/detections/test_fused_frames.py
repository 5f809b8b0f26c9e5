"""Which detections show that any road user is there, by hand."""

import numpy as np

from data.detections.detected_frames import DetectedFrames
from data.detections.fused_frames import existence_correctness
from perception.detection.fusion.detected_scene import DetectedScene
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.types import Detections

LABELS = {
    "Car": [0, 0, 20, 10],
    "Tram": [100, 0, 120, 10],
    "Pedestrian": [200, 0, 210, 30],
    "DontCare": [300, 0, 400, 50],
}


def test_every_box_at_a_road_user_shows_it_whatever_its_class():
    zeros = np.zeros(len(LABELS))
    boxes_px = np.array(list(LABELS.values()), float)
    truth = TrueBoxes(zeros.astype(int), np.array(list(LABELS)), zeros - 10, boxes_px, zeros, zeros)
    found = Detections(
        np.array(
            [
                [0, 0, 20, 10],
                [0, 0, 20, 9],  # of the same object
                [0, 0, 20, 4],  # overlaps too little
                [100, 0, 120, 10],
                [200, 0, 210, 30],
                [310, 0, 330, 10],
                [500, 0, 520, 10],
            ],
            float,
        ),
        np.array([0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3]),
        np.array(["Car", "Van", "Car", "Truck", "Cyclist", "Car", "Car"]),
    )
    frames = DetectedFrames((DetectedScene({"rgb": found}, (600, 100)),), truth)
    shown = existence_correctness(frames, DetectedBoxes.of_frames([found]))
    np.testing.assert_array_equal(shown.scores, [0.9, 0.8, 0.7, 0.5, 0.3])
    assert shown.is_correct.tolist() == [True, True, False, True, False]
