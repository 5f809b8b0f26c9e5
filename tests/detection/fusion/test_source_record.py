"""Which sources see what others hold for an object."""

from dataclasses import replace

import numpy as np
import pytest

from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.source_record import SourceRecord, unseen_odds
from perception.snapshot import read_snapshot, write_snapshot
from perception.types import BoxDeviations, Boxes3D, Detections, FusedDetections, Vehicles

BOXES_PX = np.array([[100.0, 100, 200, 160], [300.0, 100, 400, 160]])


def detections(boxes_px, score=0.9):
    return Detections(boxes_px, np.full(len(boxes_px), score), np.full(len(boxes_px), "Car"))


def held(sources: tuple[int, int, int], bev_score: float = np.nan) -> Vehicles:
    """Return two surely existing vehicles in the image, found by some of rgb, dm, rm, and perhaps from above."""
    rows = np.where(np.array(sources) > 0, np.arange(2)[:, None], -1)
    fused = FusedDetections(detections(BOXES_PX), rows, np.zeros(2, np.int64), np.full(2, 0.95))
    unknown = np.full((2, 3), np.nan)
    return Vehicles(
        fused, np.full(2, -1), Boxes3D(unknown, unknown, unknown[:, 0]), unknown[:, 0], unknown[:, :2],
        np.full((2, 4, 4), np.nan), BoxDeviations.unknown(2), np.zeros(0, np.int64),
        bev_scores=np.full(2, bev_score),
    )  # fmt: skip


def seen(record: SourceRecord, vehicles: Vehicles, rate_hz: float, seconds: float, **found) -> None:
    scene = DetectedScene(found, (1000, 300))
    for frame in range(round(seconds * rate_hz)):
        record.update(frame / rate_hz, vehicles, [scene])


@pytest.mark.parametrize("rate_hz", [2.0, 10.0, 20.0])
def test_a_source_that_misses_what_others_hold_is_blind_within_seconds_at_any_rate(rate_hz):
    record = SourceRecord()
    assert record.works(0, "rgb") == pytest.approx(0.982, abs=1e-3)
    found = {"rgb": Detections.empty(), "dm": detections(BOXES_PX), "rm": detections(BOXES_PX)}
    seen(record, held((0, 1, 1)), rate_hz, 3.0, **found)
    assert record.blind(0) == ["rgb"]
    assert record.works(0, "rgb") < 0.01
    assert record.works(0, "dm") > 0.999
    assert record.blind(1) == []


def test_a_source_that_finds_them_again_works_again():
    record, vehicles = SourceRecord(), held((0, 0, 0), bev_score=0.9)
    seen(record, vehicles, 10.0, 4.0, rgb=Detections.empty())
    assert record.blind(0) == ["rgb"]
    scene = DetectedScene({"rgb": detections(BOXES_PX + 5)}, (1000, 300))
    for frame in range(40):
        record.update(4.0 + frame / 10, vehicles, [scene])
    assert record.blind(0) == []


def test_a_source_does_not_confirm_itself_and_nothing_in_view_says_nothing():
    record = SourceRecord()
    seen(record, held((1, 0, 0)), 10.0, 4.0, rgb=Detections.empty())
    assert record.works(0, "rgb") == pytest.approx(0.982, abs=1e-3)
    elsewhere = replace(held((0, 1, 1)), cameras=np.ones(2, np.int64))
    seen(record, elsewhere, 10.0, 4.0, rgb=Detections.empty())
    assert record.works(0, "rgb") == pytest.approx(0.982, abs=1e-3)


def test_the_silence_of_a_source_counts_as_far_as_it_works():
    np.testing.assert_allclose(
        unseen_odds(np.array([1.0, 0.5, 0.0])), [-1.715, -0.528, 0], atol=1e-3
    )


def test_a_record_goes_on_from_a_snapshot():
    record = SourceRecord()
    seen(record, held((0, 1, 1)), 10.0, 1.0, rgb=Detections.empty(), dm=detections(BOXES_PX))
    again = read_snapshot(write_snapshot(record), "record")
    assert again.works(0, "rgb") == record.works(0, "rgb") < 0.9
