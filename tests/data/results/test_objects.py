"""Objects of a frame as lines of JSON, with numbers to check by hand."""

from dataclasses import replace

import numpy as np
import pytest

from data.results.documents import to_serializable
from data.results.objects import FrameTracks, FrameVehicles, TrajectoryRecord
from data.results.records import append_record, read_records
from perception.tracking.single_object.image_region import ImageRegion
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.types import Tracks
from tests.known_result import TRACKS, VAN_COVARIANCE, known_result


@pytest.fixture
def result():
    return known_result()


def test_a_line_holds_every_track_in_the_world_and_in_the_lidar_frame(result):
    line = to_serializable(FrameTracks.of(result))
    assert (line["frame"], line["stamp_s"]) == (7, 0.7)
    van, walker = line["tracks"]
    assert van == {
        "id": 4,
        "type": "Van",
        "score": 0.8125,
        "is_observed": True,
        "size_m": [4.2, 1.8, 1.5],
        "speed_m_s": 5.0,
        "covariance": VAN_COVARIANCE.tolist(),
        "size_std_m": [0.4, 0.1, 0.1],
        "yaw_std_rad": 0.05,
        "reversal": 0.1,
        "velo": {
            "position_m": [10.0, 2.0, -1.7],
            "yaw_rad": 0.0,
            "velocity_m_s": [3.0, 4.0, 0.0],
        },
        "world": {
            "position_m": [98.0, 60.0, 1.3],
            "yaw_rad": pytest.approx(np.pi / 2, abs=1e-6),
            "velocity_m_s": [-4.0, 3.0, 0.0],
        },
    }
    assert (walker["id"], walker["is_observed"], walker["speed_m_s"]) == (9, False, 1.0)
    assert (walker["type"], walker["score"], walker["covariance"]) == (None, None, None)
    # 3 rad and a quarter turn are more than half a turn.
    assert walker["world"]["yaw_rad"] == pytest.approx(3 + np.pi / 2 - 2 * np.pi, abs=1e-6)


def test_a_line_of_vehicles_holds_what_is_known_of_them(result):
    line = to_serializable(FrameVehicles.of(result))
    car, faint = line["vehicles"]
    track = to_serializable(FrameTracks.of(result))["tracks"][0]
    shared = ("id", "size_m", "speed_m_s", "covariance", "velo", "world")
    assert {name: car[name] for name in shared} == {name: track[name] for name in shared}
    assert (car["type"], car["score"], car["dominant_modality"]) == ("Car", 0.875, "rgb")
    assert car["scores"] == {"rgb": 0.75, "dm": 0.5, "rm": None, "bev": None}
    assert (car["points"], car["distance_m"]) == (2, 8.5)
    unknown = {"position_m": [None] * 3, "yaw_rad": None, "velocity_m_s": [None] * 3}
    assert (faint["id"], faint["type"], faint["points"]) == (None, "Van", 0)
    assert (faint["distance_m"], faint["speed_m_s"], faint["covariance"]) == (None, None, None)
    assert faint["velo"] == unknown
    assert faint["box_px"] == [10, 160, 60, 200]


def test_without_a_camera_there_are_no_rectangles(result):
    bare = replace(result, frame=replace(result.frame, calibration=None))
    assert [one.box_px for one in FrameVehicles.of(bare).vehicles] == [None, None]


def test_faint_vehicles_are_listed_on_demand(result):
    assert [one.score for one in FrameVehicles.of(result, 0.05).vehicles] == [0.875]
    assert [one.score for one in FrameVehicles.of(result, 0.03125).vehicles] == [0.875, 0.0312]
    assert FrameVehicles.of(result, 0.9).vehicles == []
    assert FrameVehicles.of(replace(result, vehicles=None)) is None


@pytest.mark.parametrize("kind", [None, "Cyclist"])
def test_one_tracked_object_has_the_fields_of_a_track(result, kind):
    tracked = TrackedObject(TrackStatus.PREDICTED, TRACKS.boxes[:1], np.array([3.0, 4.0]), None)
    record = TrajectoryRecord.of(result, tracked, 4, kind)
    track = FrameTracks.of(result).tracks[0]
    assert (record.frame, record.stamp_s, record.status) == (7, 0.7, "predicted")
    assert (record.id, record.type, record.score, record.box_px) == (4, kind, None, None)
    assert (record.velo, record.world, record.size_m) == (track.velo, track.world, track.size_m)
    assert (record.next_position_velo_m, record.hull_px, record.ring_px) == (None, None, None)


def test_one_tracked_object_has_its_next_position_its_hull_and_the_ring_around_it(result):
    square = np.array([[300.0, 100], [340, 100], [340, 140], [300, 140]])
    tracked = TrackedObject(
        TrackStatus.SEEN,
        TRACKS.boxes[:1],
        np.array([3.0, 4.0]),
        None,
        next_bottom_velo=np.array([10.3, 2.4, -1.7]),
        region=ImageRegion(square, (1242, 375), ring_scale=1.5),
    )
    record = TrajectoryRecord.of(result, tracked, 4, "Van")
    assert record.next_position_velo_m == [10.3, 2.4, -1.7]
    assert record.next_position_world_m == [97.6, 60.3, 1.3]
    assert record.hull_px == square.tolist()
    assert record.ring_px == [[290, 90], [350, 90], [350, 150], [290, 150]]


def test_what_is_written_is_read_back(result, tmp_path):
    in_image = TrackedObject(
        TrackStatus.SEEN,
        None,
        np.zeros(2),
        np.array([1.0, 2, 3, 4]),
        np.ones(3),
        ImageRegion(np.array([[1.0, 1], [3, 1], [1, 3]]), (8, 8)),
    )
    for line in (
        FrameTracks.of(result),
        FrameTracks.of(replace(result, tracks=Tracks.empty())),
        FrameVehicles.of(result),
        TrajectoryRecord.of(result, in_image, 4, None),
    ):
        path = tmp_path / f"{type(line).__name__}.jsonl"
        append_record(path, line)
        assert read_records(path, type(line))[-1] == line
