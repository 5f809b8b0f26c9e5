"""The reference tracker in the image, and the benchmark in which it stands beside ours."""

import json

import numpy as np

from benchmarks.reference.image_tracker import ReferenceImageTracker
from perception.cli.main import main
from perception.types import Detections

_BOX_PX = np.array([100.0, 100, 180, 150])
_RIGHT = np.array([1.0, 0, 1, 0])


def detections(*boxes_px: np.ndarray, scores: tuple[float, ...]) -> Detections:
    count = len(boxes_px)
    return Detections(np.reshape(boxes_px, (count, 4)), np.array(scores), np.full(count, "Car"))


def test_a_low_score_continues_a_track_but_begins_none():
    tracker, other_px = ReferenceImageTracker(), _BOX_PX + 300 * _RIGHT
    ids = [
        tracker.update(detections(_BOX_PX + 2 * step, other_px, scores=(score, 0.5))).tolist()
        for step, score in enumerate((0.9, 0.8, 0.3, 0.3, 0.9))
    ]
    assert ids == [[-1, -1]] + [[0, -1]] * 4


def test_two_that_pass_each_other_keep_their_ids():
    tracker = ReferenceImageTracker()
    for step in range(30):
        shift = 10.0 * step * _RIGHT
        first, second = _BOX_PX + shift, _BOX_PX + 300 * _RIGHT + 12 - shift
        ids = tracker.update(detections(first, second, scores=(0.9, 0.9))).tolist()
    assert ids == [0, 1]


def test_a_track_is_forgotten():
    tracker = ReferenceImageTracker()
    for _ in range(2):
        tracker.update(detections(_BOX_PX, scores=(0.9,)))
    for _ in range(31):
        tracker.update(detections(scores=()))
    assert tracker.update(detections(_BOX_PX, scores=(0.9,))).tolist() == [-1]
    assert tracker.update(detections(_BOX_PX, scores=(0.9,))).tolist() == [1]


def test_the_benchmark_measures_both_on_the_same_detections(street, tmp_path, monkeypatch):
    monkeypatch.delenv("PUBLIC_NETWORKS", raising=False)
    out = tmp_path / "bench.json"
    words = ["--drive", str(street), "--part", "vehicle-tracking", "--frames", "3"]
    assert main(["bench", *words, "--json", str(out)]) == 0
    rows = json.loads(out.read_text())["vehicle-tracking"]
    assert list(rows) == ["Trifuse: camera view", "two thresholds in the image: camera view"]
    assert all(0 <= row["HOTA [%]"] <= 100 for row in rows.values())
