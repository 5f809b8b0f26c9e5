"""Summaries of a detector and of a tracked object: counts and times that can be checked by hand."""

from pathlib import Path

import numpy as np
import pytest

from perception.evaluation.detection.detector_measure import DetectorSummary, FrameDetections
from perception.evaluation.run_summary import RunSummary
from perception.evaluation.single_object.trajectory_summary import TrajectorySummary
from perception.geometry.grids import LocalArea
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.types import Boxes3D, Detections, PointTruth
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


def test_a_run_is_summed_up_by_its_points_tracks_and_vehicles():
    summary = RunSummary("drive", Path("out"), LocalArea(), period_s=0.1, elapsed_s=0.5)
    assert summary.to_json()["tracks"] == {"ids": 0, "per_frame": None}
    assert summary.to_json()["vehicles"] is summary.to_json()["points_against_truth"] is None
    # A road, a wall, and a car that moves: each point is called what it is.
    truth = PointTruth(np.array([40, 50, 10]), np.zeros(3, int), np.array([0, 0, 1], bool))
    summary.update(known_result(7), truth)
    summary.update(
        known_result(8, has_camera=False), PointTruth(*(one[:2] for one in vars(truth).values()))
    )
    values = summary.to_json()
    assert (values["drive"], values["frames"], values["is_complete"]) == ("drive", 2, False)
    assert (values["elapsed_s"], values["period_ms"]) == (0.5, 100.0)
    assert values["tracks"] == {"ids": 2, "per_frame": 2.0}
    assert values["vehicles"] == {"ids": 1, "per_frame": 1.0}
    assert values["points"] == {"outside": 0, "ground": 2, "static": 2, "moving": 2}
    assert values["health"] == {"frames": 2, "healthy": 2, "faults": {}}
    against = values["points_against_truth"]
    assert list(against) == ["ground", "static", "moving"]
    assert [one["true_positives"] for one in against.values()] == [1, 1, 1]
    text = summary.text(stages=True)
    assert text.startswith("drive: 2 frames\n\ntimes of the stages")
    assert "points against the truth of this drive" in text
    assert "points/frame: 1 ground, 1 static, 1 moving\ntracks: 2, 2.0/frame\n" in text
    assert "vehicles: 1 tracked, 1.0/frame with a score of at least 0.5\n" in text
    assert text.endswith("drawing and writing, 4.0 frames/s\nresults: out")


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
