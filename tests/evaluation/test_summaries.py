"""Summaries of a detector and of a tracked object: counts and times that can be checked by hand."""

from pathlib import Path

import numpy as np
import pytest

from perception.evaluation.detection.detector_measure import DetectorSummary, FrameDetections
from perception.evaluation.single_object.trajectory_summary import TrajectorySummary
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.types import Boxes3D, Detections
from tests.known_result import known_result


def detections(*scores: float) -> Detections:
    boxes_px = np.tile([10.0, 20.0, 30.0, 40.0], (len(scores), 1))
    return Detections(boxes_px, np.array(scores), np.array(["Car"] * len(scores)))


def test_a_detector_is_summed_up_by_its_counts_and_times():
    summary = DetectorSummary("drive", 0.5, {"network": "compact"})
    proposals_px = np.zeros((7, 4))
    summary.add(FrameDetections(detections(0.25, 0.5, 0.75), {"maps": 0.002}, proposals_px))
    summary.add(FrameDetections(detections(0.125), {"maps": 0.004}))
    summary.elapsed_s = 0.5
    assert summary.counts == [(7, 3, 2), (0, 1, 0)]
    values = summary.to_json()
    assert (values["proposals"], values["detections"]) == (7, 4)
    assert values["displayed"] == {"display_score": 0.5, "detections": 2}
    last = summary.text().splitlines()[-1]
    assert last == (
        "3.5 proposals/frame, 2.0 detections/frame, 1.0 of these with a score of 0.5 or more; "
        "333 frames/s for the stages, 4.0 with reading, drawing and writing"
    )


def box(x_m: float) -> Boxes3D:
    return Boxes3D(np.array([[x_m, 0.0, -1.7]]), np.array([[4.0, 1.8, 1.5]]), np.zeros(1))


@pytest.mark.parametrize(
    ("states", "x_m", "travelled_m"),
    [
        ((TrackStatus.SEEN,) * 3, (5.0, 6.0, 8.0), 3.0),
        # A box of a lost object is a guess, and a tracker in the image has none.
        ((TrackStatus.SEEN, TrackStatus.LOST, TrackStatus.SEEN), (5.0, 90.0, 6.0), 1.0),
        ((TrackStatus.SEEN,) * 3, (None, None, None), 0.0),
    ],
)
def test_the_path_of_an_object_is_that_of_its_boxes(states, x_m, travelled_m):
    summary = TrajectorySummary("drive", "tracker", "object 1", Path("out"))
    for index, (status, x) in enumerate(zip(states, x_m, strict=True)):
        tracked = TrackedObject(status, None if x is None else box(x), np.zeros(2), None)
        result = known_result(0)
        summary.update(result, tracked, 0.002 * (index + 1))
    assert summary.to_json()["travelled_m"] == pytest.approx(travelled_m)
    assert summary.to_json()["p50_ms"] == pytest.approx(4.0)
    assert ("this tracker works in the image alone" in summary.text()) == (x_m[0] is None)
