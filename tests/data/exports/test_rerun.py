"""Results as a Rerun recording, read back entity by entity."""

import sys
from collections import defaultdict
from dataclasses import replace
from itertools import chain
from operator import itemgetter

import numpy as np
import pyarrow as pa
import pytest
import rerun
from rerun.chunk import RrdReader

from data.exports import rerun_writer
from data.exports.rerun_entities import pinhole_of
from data.exports.rerun_writer import RerunWriter, blueprint_of
from data.exports.run_exports import RunExports
from data.results.result_writer import open_writers
from perception.errors import UsageError, WriteError
from perception.geometry.camera import project
from perception.types import Tracks
from tests.faults import command, fault
from tests.full_disk import file_size_limit
from tests.known_result import CAMERA, POINTS_VELO, TRACKS, known_result

LIDAR = "/world/ego/lidar"
CAMERA_PATH = "/world/ego/camera"


def write(path, results, display_score=0.5):
    writer = RerunWriter("street", path, view=False, display_score=display_score)
    with open_writers([writer]):
        for result in results:
            writer.add(result, None)


def read(path):
    """Return the values of each entity by path and component, one entry a frame."""
    found = defaultdict(lambda: defaultdict(list))
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        # The time of writing, in nanoseconds, which is no Python object without pandas.
        names = [field.name for field in batch.schema if not pa.types.is_timestamp(field.type)]
        columns = batch.select(names).to_pydict()
        frames = columns.get("frame", [-1] * chunk.num_rows)
        for name, values in columns.items():
            found[chunk.entity_path][name] += zip(frames, values, strict=True)
    # Frames of one entity lie in several chunks, and not in their order.
    return {
        entity: {
            name: [value for _, value in sorted(rows, key=itemgetter(0))]
            for name, rows in columns.items()
        }
        for entity, columns in found.items()
    }


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Return a recording of three frames, without tracks in the second."""
    results = [known_result(index) for index in range(3)]
    results[1] = replace(results[1], tracks=Tracks.empty())
    path = tmp_path_factory.mktemp("rerun") / "new" / "street.rrd"
    write(path, results)
    assert [one.name for one in path.parent.iterdir()] == ["street.rrd"]
    return read(path)


def test_the_entities_are_those_of_the_product(recording):
    data = {path for path in recording if not path.startswith("/__properties")}
    assert data == {
        "/world", "/world/ego", "/world/path", "/world/tracks", "/world/vehicles", "/world/velocities",
        f"{LIDAR}/outside", f"{LIDAR}/ground", f"{LIDAR}/static", f"{LIDAR}/moving",
        CAMERA_PATH, f"{CAMERA_PATH}/image", f"{CAMERA_PATH}/dm",
        f"{CAMERA_PATH}/detections/rgb", f"{CAMERA_PATH}/detections/dm",
        f"{CAMERA_PATH}/detections/fused",
        "/timings/ground", "/timings/fusion", "/timings/end\\ to\\ end",
        "/counts/points/outside", "/counts/points/ground", "/counts/points/static",
        "/counts/points/moving", "/counts/tracks", "/counts/detections",
        "/health/skipped\\ stages", "/health/invalid\\ points",
        "/health/lidar", "/health/camera", "/health/ins", "/health/calibration",
    }  # fmt: skip


def test_points_are_those_of_the_scan_by_their_states(recording):
    for row, state in enumerate(("ground", "static", "moving")):
        frames = recording[f"{LIDAR}/{state}"]["Points3D:positions"]
        assert len(frames) == 3
        np.testing.assert_array_equal(frames[0], POINTS_VELO[[row], :3])
    assert recording[f"{LIDAR}/outside"]["Points3D:positions"] == [[], [], []]


def test_boxes_stand_where_the_tracks_are_around_the_first_position(recording):
    boxes = recording["/world/tracks"]
    assert [len(frame) for frame in boxes["Boxes3D:centers"]] == [2, 0, 2]
    # 10 m ahead and 2 m to the left of a vehicle that heads along the world's y; half as high as the van.
    np.testing.assert_allclose(boxes["Boxes3D:centers"][0][0], [-2, 10, -1.7 + 0.75], atol=1e-5)
    np.testing.assert_allclose(boxes["Boxes3D:half_sizes"][0], TRACKS.boxes.size_m / 2, atol=1e-6)
    half = np.sqrt(0.5)
    np.testing.assert_allclose(boxes["Boxes3D:quaternions"][0][0], [0, 0, half, half], atol=1e-6)
    assert boxes["Boxes3D:labels"][0] == ["#4 Van 5.0 m/s", "#9 1.0 m/s"]
    assert boxes["track_id"][0] == [4, 9]
    velocities = recording["/world/velocities"]["Arrows3D:vectors"]
    np.testing.assert_allclose(velocities[0][0], [-4, 3, 0], atol=1e-6)
    assert recording["/world"]["origin_m"][-1] == [100, 50, 3]


def test_a_vehicle_is_a_box_of_its_own_where_no_track_stands_for_it(recording):
    # The car has the id of the van's track; the other vehicle has no place.
    assert [len(one) for one in recording["/world/vehicles"]["Boxes3D:centers"]] == [0, 1, 0]


def test_times_are_frames_and_seconds(recording):
    ground = recording[f"{LIDAR}/ground"]
    assert ground["frame"] == [0, 1, 2]
    assert [one.total_seconds() for one in ground["time"]] == pytest.approx([0, 0.1, 0.2])


def test_detections_are_shown_from_a_score_on(recording):
    detections = f"{CAMERA_PATH}/detections"
    assert recording[f"{detections}/dm"]["Boxes2D:labels"][0] == ["Car 0.50"]
    (rgb,) = recording[f"{detections}/rgb"]["Boxes2D:half_sizes"][0]
    assert rgb == [60, 45]
    assert recording[f"{detections}/fused"]["Boxes2D:centers"][0] == [[560.125, 195]]


def test_numbers_are_series(recording):
    numbers = {
        path: recording[path]["Scalars:scalars"]
        for path in ("/timings/ground", "/timings/end\\ to\\ end", "/counts/tracks", "/health/skipped\\ stages")
    }  # fmt: skip
    assert numbers["/timings/ground"] == [[5.0]] * 3
    assert numbers["/timings/end\\ to\\ end"] == [[pytest.approx(7.0)]] * 3
    assert numbers["/counts/tracks"] == [[2.0], [0.0], [2.0]]
    assert numbers["/health/skipped\\ stages"] == [[1.0]] * 3


def test_the_pinhole_projects_as_the_calibration():
    image_P_cam = CAMERA.image_P_cam.copy()
    image_P_cam[:, 3] = [30, 0.5, 0.01]
    shifted = replace(CAMERA, image_P_cam=image_P_cam)
    velo_SE3_image, matrix = pinhole_of(shifted)
    image_SE3_velo = np.linalg.inv(velo_SE3_image)
    pixels, _ = project(matrix @ image_SE3_velo[:3], POINTS_VELO)
    np.testing.assert_allclose(pixels, project(shifted.image_P_velo, POINTS_VELO)[0])


def test_the_layout_has_views_of_what_the_drive_has():
    def views(part):
        return (
            [part] if hasattr(part, "origin") else [*chain.from_iterable(map(views, part.contents))]
        )

    counts = [
        len(views(blueprint_of(one).root_container))
        for one in (known_result(has_camera=False), known_result())
    ]
    assert counts == [4, 6]


def test_a_run_that_fails_keeps_the_frames_that_were_done(tmp_path):
    writer = RerunWriter("street", tmp_path / "x.rrd", view=False, display_score=0.5)
    with pytest.raises(RuntimeError), open_writers([writer]):
        writer.add(known_result(), None)
        raise RuntimeError
    assert read(tmp_path / "x.rrd")[f"{LIDAR}/ground"]["frame"] == [7]


def test_a_full_disk_leaves_no_recording(tmp_path):
    path = tmp_path / "x.rrd"
    with file_size_limit(8_000), fault(WriteError, where=str(path), found="full disk"):
        write(path, [known_result(index) for index in range(3)])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux runs without a display")
def test_a_viewer_needs_a_display(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with fault(UsageError, where="--view", expected="display", advice="--rerun FILE.rrd"):
        command("run", "nowhere", "--view")


class StartedViewer:
    """Notes the words that start a viewer; listens from the second look on."""

    returncode = 1

    def __init__(self, monkeypatch, *, listens: bool) -> None:
        self.words, self._looks, self._listens = [], 0, listens
        monkeypatch.setattr(rerun_writer, "which", lambda *_, **__: "rerun")
        monkeypatch.setattr(rerun_writer.subprocess, "Popen", self._popen)
        monkeypatch.setattr(rerun_writer, "_is_listening", self._is_listening)
        monkeypatch.setattr(rerun.RecordingStream, "set_sinks", lambda *_: None)

    def _popen(self, words, **_):
        self.words = words
        return self

    def _is_listening(self) -> bool:
        self._looks += 1
        return self._listens and self._looks > 1

    def poll(self) -> int:
        return self.returncode


def test_a_viewer_listens_to_this_computer_alone_and_has_limits_of_memory(monkeypatch):
    viewer = StartedViewer(monkeypatch, listens=True)
    RerunWriter("street", None, view=True, display_score=0.5)
    assert {"--bind=127.0.0.1", "--memory-limit=2GiB", "--server-memory-limit=2GiB"} <= {
        *viewer.words
    }


def test_a_missing_viewer_is_named(monkeypatch):
    monkeypatch.setattr(rerun_writer, "which", lambda *_, **__: None)
    monkeypatch.setattr(rerun_writer, "_is_listening", lambda: False)
    with fault(UsageError, where="--view", found="no program rerun", advice="--rerun"):
        RerunWriter("street", None, view=True, display_score=0.5)


def test_a_viewer_that_does_not_start_is_named(monkeypatch):
    StartedViewer(monkeypatch, listens=False)
    with fault(
        UsageError, where="--view", found="ended at once, with exit code 1", advice="--rerun"
    ):
        RerunWriter("street", None, view=True, display_score=0.5)


def test_a_recording_has_the_suffix_that_rerun_opens(tmp_path):
    with fault(UsageError, where="--rerun", expected=".rrd", found="x.bag"):
        RunExports(rerun=tmp_path / "x.bag")


def test_without_a_camera_there_are_scan_and_objects(tmp_path):
    write(tmp_path / "x.rrd", [known_result(has_camera=False)])
    found = read(tmp_path / "x.rrd")
    assert [path for path in found if path.startswith(CAMERA_PATH)] == []
    assert len(found["/world/tracks"]["Boxes3D:centers"][0]) == 2
