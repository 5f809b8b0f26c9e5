"""A run that hands one of its tracks to a tracker of one object."""

import json
from dataclasses import replace

import numpy as np
import pytest

from data.open_drive import open_drive
from data.results.objects import TrajectoryRecord
from data.results.run_config import RunConfig
from data.results.run_drive import TRACKING_STAGE, track_selected
from perception.cli.main import main
from perception.errors import UsageError
from perception.geometry.grids import EgoVehicle
from perception.pipeline import Pipeline, PipelineConfig
from perception.render import palette
from perception.render.composition import Composition
from perception.render.scene import Scene, SceneObjects
from perception.tracking.single_object.handover import TrackHandover
from perception.tracking.single_object.image_region import ImageRegion
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.types import BoxDeviations, Boxes3D, Result, Tracks, Vehicles
from tests.faults import command, fault
from tests.vehicle_scenes import cars, detected

FRAMES = 4  # of the street


@pytest.fixture(scope="module")
def result(street) -> Result:
    drive = open_drive(street)
    boxes = Boxes3D(np.array([[9.0, 2, -1.7], [12, -2, -1.7]]), np.full((2, 3), 2.0), np.zeros(2))
    tracks = Tracks.unclassified(np.array([3, 8]), boxes, np.ones((2, 2)), np.ones(2, bool))
    return replace(
        Pipeline(drive.sensor, PipelineConfig.for_motion()).step(drive[0]), tracks=tracks
    )


class StaticTracker:
    """Answers with the first box, always."""

    def init(self, tracker_input, box_velo):
        self._answer = TrackedObject(TrackStatus.SEEN, box_velo, np.array([3.0, 4.0]), None)
        return self._answer

    def update(self, tracker_input):
        return self._answer


def hand_over_of(track_id: int) -> TrackHandover:
    return TrackHandover(track_id, StaticTracker(), EgoVehicle())


def positions_m(steps) -> list[list[float]]:
    """Return where the trajectory has the object."""
    records = [
        TrajectoryRecord.of(result, one.tracked, one.track_id, None)
        for result, one in steps
        if one is not None
    ]
    return [record.velo.position_m for record in records]


def test_from_its_first_frame_on_the_track_is_written_timed_and_drawn_instead(result):
    without = replace(result, tracks=Tracks.empty())
    # In the last frame its own track is gone; it is followed on.
    steps = list(track_selected([without, result, without], hand_over_of(8)))
    assert all(TRACKING_STAGE in one.timings_s for one, _ in steps)
    assert steps[0][1] is None
    objects = SceneObjects.of(steps[1][0], selected=steps[1][1])
    assert objects.ids.tolist() == [3, 8]
    assert objects.is_selected.tolist() == [False, True]
    np.testing.assert_allclose(objects.speeds_m_s[1], 5.0)
    assert positions_m(steps) == [[12, -2, -1.7]] * 2


def test_a_track_that_never_comes_is_said(result, caplog):
    list(track_selected([result], hand_over_of(99)))
    assert "--track 99: no frame has a track or a located vehicle of this id" in caplog.text


def test_a_vehicle_without_a_track_is_tracked_from_its_first_box_on(result):
    fused = detected(cars((9.0, 2.0, 0.0), (12.0, -2.0, 0.0)))
    boxes = replace(result.tracks.boxes, bottom_m=np.array([[9.0, 2, -1.7], [np.nan] * 3]))
    unlocated = Vehicles(
        fused=fused,
        ids=np.array([4, 5]),
        boxes=boxes,
        distances_m=np.array([7.0, np.nan]),
        velocities_m_s=np.full((2, 2), np.nan),
        covariances=np.full((2, 4, 4), np.nan),
        box_deviations=BoxDeviations.unknown(2),
        owners=np.full(len(result.frame.points_velo), -1),
    )
    located = replace(unlocated, boxes=result.tracks.boxes)
    frames = [replace(result, tracks=Tracks.empty(), vehicles=one) for one in (unlocated, located)]
    # Where the LiDAR says too little of it, there is nothing to begin with.
    first, second = track_selected(frames, hand_over_of(5))
    assert first[1] is None
    assert positions_m([second]) == [[12, -2, -1.7]]
    # It is drawn once, as what is followed.
    objects = SceneObjects.of(second[0], selected=second[1])
    assert objects.ids.tolist() == [4, 5]
    assert objects.is_selected.tolist() == [False, True]


def test_without_a_handover_the_tracks_are_the_same(result):
    assert list(track_selected([result], None)) == [(result, None)]


def test_the_followed_object_is_drawn_over_the_others(result):
    ((_, selected),) = track_selected([result], hand_over_of(8))
    objects = SceneObjects.of(result, selected=selected)
    plain = Composition().draw(Scene.of(result))
    scene = Scene(result, objects, [np.zeros((0, 3))] * len(objects))
    picture = Composition().draw(scene)
    counts = [
        int((np.abs(one.astype(int) - palette.TRACKED_OBJECT) < 30).all(axis=2).sum())
        for one in (plain, picture)
    ]
    assert counts[0] < 50
    assert counts[1] > 500


def test_a_run_tracks_one_of_its_objects(street, tmp_path, capsys):
    # Detected vehicles would share the count of ids.
    words = ["run", str(street), "--out", str(tmp_path), "--pipeline.detection.modalities", ""]
    assert main([*words, "--track", "0", "--tracker", "3d-ms", "--stages"]) == 0
    assert TRACKING_STAGE in capsys.readouterr().out
    given = [json.loads(line) for line in (tmp_path / "tracks.jsonl").read_text().splitlines()]
    ids = [[track["id"] for track in line["tracks"]] for line in given]
    first = next(number for number, there in enumerate(ids) if 0 in there)
    lines = [json.loads(line) for line in (tmp_path / "trajectory.jsonl").read_text().splitlines()]
    assert [line["frame"] for line in lines] == list(range(first, FRAMES))
    track = next(track for track in given[first]["tracks"] if track["id"] == 0)
    np.testing.assert_allclose(
        lines[0]["velo"]["position_m"], track["velo"]["position_m"], atol=1.0
    )
    # Of all trackers, this one predicts that the object stays.
    assert lines[-1]["next_position_velo_m"] == lines[-1]["velo"]["position_m"]


def test_region_and_rectangle_of_the_tracked_object_are_drawn_on_the_image(result):
    def camera(tracked: TrackedObject | None) -> np.ndarray:
        scene = replace(Scene.of(replace(result, tracks=Tracks.empty())), tracked=tracked)
        return Composition().draw(scene).astype(int)[:300, :1000]

    def changed(tracked: TrackedObject, color) -> int:
        is_color = np.abs(camera(tracked) - color).max(axis=2) < 70
        return int((is_color & (np.abs(camera(tracked) - plain).max(axis=2) > 10)).sum())

    plain = camera(None)
    corners_px = np.array([[400.0, 100], [800, 100], [800, 300], [400, 300]])
    region = ImageRegion(corners_px, (1242, 375))
    seen = TrackedObject(TrackStatus.SEEN, None, np.zeros(2), None, region=region)
    assert changed(seen, palette.INSIDE) > 300
    assert changed(seen, palette.RING) > 300
    rectangle = replace(seen, region=None, box_px=np.array([400.0, 100, 800, 300]))
    assert changed(rectangle, palette.TRACKED_OBJECT) > 300


def test_a_tracker_without_a_track_is_an_error():
    with fault(UsageError, where="--tracker h-fus", found="none", advice="--track"):
        RunConfig(tracker="h-fus")


def test_an_id_below_zero_is_an_error(street, tmp_path):
    with fault(UsageError, where="track id", expected="an id of 0 or more", found="-1"):
        command("run", street, "--out", tmp_path, "--track", "-1")
