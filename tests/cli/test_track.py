"""Following one object from the command line: files, table, and what is refused."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
import yaml

from data.derived.object_truth import DriveObjects
from data.derived.track_start import TrackStart, TrackStartConfig, find_start, parse_box
from data.kitti.tracking_rows import read_result_rows
from data.open_drive import open_drive
from data.results.command_config import CommandConfig
from data.results.documents import to_serializable
from data.results.folder import ResultsFolder
from data.results.objects import TrajectoryRecord
from data.results.records import read_records
from data.results.track_object import TrackConfig, track_object
from data.synthetic.collection import SynthConfig, write_drives
from perception.cli.main import main
from perception.cli.progress import progress_bar
from perception.errors import DriveError, PerceptionError, UsageError
from perception.evaluation.single_object.trajectory_summary import TrajectorySummary, path_length_m
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.types import Boxes3D
from tests.faults import command, fault

FRAMES = 4  # of `street`


@pytest.fixture(scope="module")
def labelled_id(street) -> int:
    """Return the nearest object that is labelled, and whole in the image, in every frame."""
    labels = [open_drive(street).labels(index) for index in range(FRAMES)]
    whole = [one[one.truncation == 0] for one in labels]
    always = set.intersection(*(set(one.track_ids.tolist()) for one in whole))
    far_m = np.hypot(*labels[0].boxes_velo.bottom_m[:, :2].T)
    return min(always, key=lambda track: far_m[labels[0].track_ids == track][0])


@pytest.fixture(scope="module")
def results(street, labelled_id, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("followed")
    words = ["track", str(street), "--track-id", str(labelled_id), "--tracker", "h-fus"]
    assert main([*words, "--plots", "--out", str(out)]) == 0
    return out


@dataclass
class Scripted:
    """A tracker that answers as it is told, with its first box."""

    states: list[TrackStatus]
    in_space: bool = True

    def init(self, tracker_input, box_velo):
        self._box = box_velo
        return self._tracked()

    def update(self, tracker_input):
        return self._tracked()

    def _tracked(self):
        box = self._box if self.in_space else None
        box_px = None if self.in_space else np.array([10.0, 20, 30, 40])
        return TrackedObject(self.states.pop(0), box, np.array([3.0, 4.0]), box_px)


def track_scripted(street, out, states, *, in_space=True, start=None) -> TrajectorySummary:
    drive = open_drive(street)
    start = start or TrackStart(
        0, Boxes3D(np.array([[9.0, 0, -1.7]]), np.full((1, 3), 2.0), np.zeros(1))
    )
    config = TrackConfig(frames=len(states), video=False)
    with pytest.MonkeyPatch.context() as patch:
        scripted = Scripted(list(states), in_space)
        patch.setattr("data.results.track_object.single_object_tracker", lambda *_: scripted)
        return track_object(drive, start, folder_of(out), config, progress_bar)


def folder_of(out: Path) -> ResultsFolder:
    return ResultsFolder(out, CommandConfig("track", {}))


def lines_of(path: Path) -> list[dict]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_every_file_is_there(results):
    names = {path.name for path in results.iterdir()}
    assert names == {
        "color-model.png", "config.yaml", "ground.png", "mean-shift.png", "preview.jpg",
        "summary.json", "trajectory.jsonl", "trajectory.txt", "video.mp4",
    }  # fmt: skip
    with av.open(str(results / "video.mp4")) as container:
        assert sum(1 for _ in container.decode(video=0)) == FRAMES
    for name in ("color-model.png", "ground.png", "mean-shift.png", "preview.jpg"):
        assert cv2.imread(str(results / name)).std() > 5


def test_the_trajectory_tells_the_object_in_both_frames(results, street, labelled_id):
    lines = lines_of(results / "trajectory.jsonl")
    assert [line["frame"] for line in lines] == list(range(FRAMES))
    assert lines[0]["status"] == "seen"
    labels = open_drive(street).labels(0)
    box = labels.boxes_velo[labels.track_ids == labelled_id]
    np.testing.assert_allclose(lines[0]["velo"]["position_m"], box.bottom_m[0], atol=1.0)
    np.testing.assert_allclose(lines[0]["size_m"], box.size_m[0], atol=0.01)
    read = read_records(results / "trajectory.jsonl", TrajectoryRecord)
    assert [to_serializable(record) for record in read] == lines
    assert all(len(line["hull_px"]) == len(line["ring_px"]) > 2 for line in lines)
    for line in lines:
        world_m_s = np.linalg.norm(line["world"]["velocity_m_s"])
        assert world_m_s == pytest.approx(line["speed_m_s"], abs=1e-3)


def test_the_rows_are_those_of_the_benchmark(results, labelled_id):
    rows = read_result_rows(results / "trajectory.txt", FRAMES)
    assert set(rows.ids.tolist()) == {labelled_id}
    assert rows.frames.tolist() == list(range(FRAMES))


def test_configuration_and_summary_say_what_was_followed(results, labelled_id):
    config = yaml.safe_load((results / "config.yaml").read_text())
    assert config["tracker"] == "h-fus"
    assert (config["track_id"], config["start_frame"]) == (labelled_id, None)
    summary = json.loads((results / "summary.json").read_text())
    assert summary["frames"] == sum(summary["states"].values()) == FRAMES
    assert summary["against_labels"]["frames"] == FRAMES
    assert summary["against_labels"]["center_m"] > 0


def test_states_are_counted_and_lost_places_left_out(street, tmp_path):
    states = [TrackStatus.SEEN, TrackStatus.PREDICTED, TrackStatus.LOST]
    summary = track_scripted(street, tmp_path, states)
    assert list(summary.to_json()["states"].values()) == [1, 1, 1]
    assert len(summary.positions_world) == 2
    table = summary.text()
    assert "predicted       1       33.3" in table
    assert "speed 18.0 km/h on average" in table
    assert "mean error" not in table
    assert read_result_rows(tmp_path / "trajectory.txt").frames.tolist() == [0, 1]
    assert [line["status"] for line in lines_of(tmp_path / "trajectory.jsonl")] == states


def test_a_tracker_in_the_image_gives_rectangles_and_no_place(street, tmp_path):
    summary = track_scripted(street, tmp_path, [TrackStatus.SEEN] * 2, in_space=False)
    line = lines_of(tmp_path / "trajectory.jsonl")[1]
    unknown = {"position_m": [None] * 3, "yaw_rad": None, "velocity_m_s": [None] * 3}
    assert line["velo"] == unknown
    assert line["size_m"] == [None] * 3
    assert line["box_px"] == [10, 20, 30, 40]
    rows = read_result_rows(tmp_path / "trajectory.txt")
    np.testing.assert_array_equal(rows.boxes_px, [[10, 20, 30, 40]] * 2)
    assert (rows.sizes_hwl_m == -1).all()
    assert "in the image alone" in summary.text()


def test_a_box_without_points_is_said(street, tmp_path, caplog):
    high = Boxes3D(np.array([[9.0, 0, 60]]), np.full((1, 3), 2.0), np.zeros(1))
    summary = track_scripted(street, tmp_path, [TrackStatus.PREDICTED], start=TrackStart(0, high))
    assert summary.points_at_start == 0
    assert "no point of the scan lies in the first box" in caplog.text
    assert "first box: 0 points" in summary.text()


def test_a_later_start_begins_there(street, tmp_path):
    box = Boxes3D(np.array([[9.0, 0, -1.7]]), np.full((1, 3), 2.0), np.zeros(1))
    states = [TrackStatus.SEEN] * 2
    track_scripted(street, tmp_path, states, start=TrackStart(2, box))
    assert [line["frame"] for line in lines_of(tmp_path / "trajectory.jsonl")] == [2, 3]


def test_a_box_begins_in_the_frame_named(street):
    start = find_start(open_drive(street), TrackStartConfig(box="9,0,-1.7,4,1.8,1.5,0.1", frame=3))
    assert start.frame == 3
    assert start.truth is None
    assert start.name == "the object"
    np.testing.assert_array_equal(start.box_velo.size_m, [[4, 1.8, 1.5]])


@pytest.mark.parametrize("text", ["1,2,3,4,5,6,7", "1 2 3 4 5 6 7", "[1, 2, 3, 4, 5, 6, 7]"])
def test_a_box_is_seven_numbers(text):
    box = parse_box(text)
    assert (box.bottom_m.tolist(), box.size_m.tolist(), box.yaw_rad.tolist()) == (
        [[1, 2, 3]],
        [[4, 5, 6]],
        [7],
    )


@pytest.mark.parametrize("text", ["", "1,2,3", "1,2,3,4,5,6,x", "1,2,3,4,5,6,nan"])
def test_what_is_no_box_is_refused(text):
    with pytest.raises(UsageError) as caught:
        parse_box(text)
    assert (caught.value.where, caught.value.found) == ("--box", repr(text))


def test_a_flat_box_is_refused():
    with pytest.raises(UsageError) as caught:
        parse_box("1,2,3,4,0,6,7")
    assert caught.value.expected == "length, width and height above 0"


@pytest.mark.parametrize(
    ("flags", "expected", "found"),
    [
        ([], "either --track-id or --box", "neither"),
        (["--track-id", "1", "--box", "1,2,3,4,5,6,7"], "either --track-id or --box", "both"),
        (["--track-id", "9999"], "a labelled object of", "9999"),
        (["--box", "1,2,3,4,5,6,7", "--start-frame", "5"], "0 to 3", "5"),
        (["--box", "1,2,3,4,5,6,7", "--start-frame", "-1"], "0 or more", "-1"),
        (["--box", "1,2,3,4,5,6,7", "--frames", "0"], "at least 1", "0"),
        (["--box", "1,2,3,4,5,6,7", "--tracker", "goat"], "default", "goat"),
    ],
)
def test_an_impossible_start_is_an_error(street, tmp_path, flags, expected, found):
    with fault(UsageError, expected=expected, found=found):
        command("track", street, "--out", tmp_path, *flags)


def test_an_object_behind_the_camera_cannot_be_tracked_in_images(street, tmp_path):
    behind = ("--box=-80,0,-1.7,4,2,2,0", "--tracker", "ms-i")
    with fault(PerceptionError, expected="in view of the camera", found="outside the image"):
        command("track", street, "--out", tmp_path, *behind)


def test_an_unlabelled_frame_is_an_error_that_names_the_labelled_ones(kitti_root):
    drive = open_drive(kitti_root / "tracking", sequence="0000", images=False)
    late = next(one for one in DriveObjects.of(drive).sequences(1) if one.first_frame > 0)
    with pytest.raises(UsageError) as caught:
        find_start(drive, TrackStartConfig(track_id=late.track_id, frame=0))
    assert (caught.value.where, caught.value.found) == ("--start-frame", "0")
    assert caught.value.expected.endswith(f"of {late.first_frame} to {late.last_frame}")


def test_a_tracker_of_images_needs_a_camera(street, tmp_path):
    drive = open_drive(street, images=False)
    box = Boxes3D(np.array([[9.0, 0, -1.7]]), np.full((1, 3), 2.0), np.zeros(1))
    with pytest.raises(PerceptionError) as caught:
        track_object(
            drive,
            TrackStart(0, box),
            folder_of(tmp_path / "out"),
            TrackConfig("ms-i", 1, video=False),
            progress_bar,
        )
    assert caught.value.expected == "an image and a camera calibration in the first frame"
    # A tracker that cannot start leaves nothing, and would have replaced nothing.
    assert not (tmp_path / "out").exists()


def test_without_a_camera_the_object_is_tracked_in_scans_alone(street, tmp_path, labelled_id):
    start = find_start(open_drive(street), TrackStartConfig(track_id=labelled_id))
    bare = replace(open_drive(street, images=False), calibration=None)
    config = TrackConfig("h-fus", 2, plots=True)
    summary = track_object(bare, start, folder_of(tmp_path), config, progress_bar)
    assert len(summary.positions_world) == 2
    names = {path.name for path in tmp_path.iterdir()}
    assert {"video.mp4", "ground.png", "mean-shift.png"} <= names
    assert not {"trajectory.txt", "color-model.png"} & names


def test_object_frames_are_no_drive_to_track_in(tmp_path):
    write_drives(tmp_path, SynthConfig(layout="object", frames=1, images=False))
    with fault(DriveError, expected="a sequence of frames", found="object frames"):
        command("track", tmp_path, "--box", "1,2,3,4,5,6,7")


def test_a_static_object_travels_nowhere():
    trembling = np.random.default_rng(0).normal(0, 0.05, (200, 3))
    assert path_length_m(trembling) == 0
    steps = np.column_stack([np.arange(0, 10, 0.25), np.zeros(40), np.zeros(40)])
    assert path_length_m(steps) == pytest.approx(9.5)
    assert path_length_m(np.zeros((0, 3))) == 0


def test_real_cyclist_from_its_label(kitti_root, tmp_path, capsys):
    words = ["track", str(kitti_root / "tracking"), "--sequence", "0000", "--track-id", "1"]
    flags = ["--tracker", "h-fus", "--frames", "6", "--video", "false", "--out", str(tmp_path)]
    assert main([*words, *flags]) == 0
    printed = capsys.readouterr().out
    assert "0000, track 1 (Cyclist), tracker h-fus: frames 0 to 5" in printed
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["against_labels"]["center_m"] < 0.6
    assert summary["states"]["seen"] == 6
