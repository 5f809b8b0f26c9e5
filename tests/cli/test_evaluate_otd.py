"""The command on a small synthetic drive, with trackers that know the truth, stay, or refuse."""

import json
from pathlib import Path

import numpy as np
import pytest

from data.derived.object_truth import DriveObjects
from data.derived.otd_objects import ObjectSetConfig, find_objects
from data.open_drive import open_drive
from data.synthetic.drive import SyntheticDrive
from data.synthetic.writer import write_tracking
from perception.cli.main import main
from perception.errors import DriveError, PerceptionError, UsageError
from perception.geometry.boxes import transform_boxes
from perception.geometry.se3 import inverse
from perception.sensor import VLP_16
from perception.tracking.single_object import trackers
from perception.tracking.single_object.tracker import TrackedObject, TrackerInput, TrackStatus
from perception.types import Boxes3D
from tests.faults import command, fault

FRAMES = 16


class Knowing:
    """A tracker that was told all labels, of every object and frame."""

    def __init__(self, labelled: DriveObjects) -> None:
        self._labelled = labelled

    def init(self, tracker_input: TrackerInput, box_velo: Boxes3D) -> TrackedObject:
        frame = round(tracker_input.stamp_s * 10)
        tracks = {one.track_id: self._labelled.track(one) for one in self._labelled.sequences(2)}
        self._track = next(
            track
            for track in tracks.values()
            if frame in track.frames
            and np.allclose(track.boxes_velo.bottom_m[track.frames == frame], box_velo.bottom_m)
        )
        return self.update(tracker_input)

    def update(self, tracker_input: TrackerInput) -> TrackedObject:
        rows = self._track.frames == round(tracker_input.stamp_s * 10)
        box = self._track.boxes_velo[rows]
        return TrackedObject(TrackStatus.SEEN, box, self._track.velocities_m_s[rows][0], None)


class Staying:
    """A tracker for which nothing ever moves."""

    def init(self, tracker_input: TrackerInput, box_velo: Boxes3D) -> TrackedObject:
        self._box_world = transform_boxes(tracker_input.world_SE3_velo, box_velo)
        return TrackedObject(TrackStatus.SEEN, box_velo, np.zeros(2), None)

    def update(self, tracker_input: TrackerInput) -> TrackedObject:
        box = transform_boxes(inverse(tracker_input.world_SE3_velo), self._box_world)
        return TrackedObject(TrackStatus.PREDICTED, box, np.zeros(2), None)


class NeedsImage:
    def init(self, tracker_input: TrackerInput, box_velo: Boxes3D) -> TrackedObject:
        raise PerceptionError("image tracker", expected="an image", found="none")

    def update(self, tracker_input: TrackerInput) -> TrackedObject:
        raise AssertionError("a tracker that refused is asked no more")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    drive = SyntheticDrive(FRAMES, sensor=VLP_16, images=False)
    return write_tracking(drive, tmp_path_factory.mktemp("drive"), 0, lambda: None)


@pytest.fixture
def fakes(folder: Path, monkeypatch) -> None:
    labelled = DriveObjects.of(open_drive(folder))
    makers = {
        "knows": lambda sensor: Knowing(labelled),
        "stays": lambda sensor: Staying(),
        "needs-image": lambda sensor: NeedsImage(),
    }
    monkeypatch.setattr(
        trackers, "single_object_tracker", lambda name, sensor, config: makers[name](sensor)
    )
    monkeypatch.setattr(trackers, "TRACKERS", tuple(makers))


def test_the_command_compares_trackers_on_every_labelled_track(
    folder: Path, fakes: None, tmp_path: Path, capsys
):
    out, plots = tmp_path / "figures.json", tmp_path / "plots"
    words = ["otd", str(folder), "--set", "present", "--json", str(out), "--plots", str(plots)]
    assert main(["evaluate", *words]) == 0
    printed = capsys.readouterr().out
    written = json.loads(out.read_text())
    results = written["results"]
    together = results["together"]
    assert len(results["objects"]) >= 2
    assert together["knows"]["center_m"] == 0.0
    assert together["knows"]["success"] == together["knows"]["overlap_success"] == 1.0
    assert together["knows"]["velocity_m_s"] == pytest.approx(0.0, abs=1e-9)
    assert together["knows"]["seen"] == 1.0
    # Parked cars stay where they were, up to registration by 16 rings; those that drive do not.
    stays = [one["metrics"]["stays"] for one in results["objects"]]
    assert min(score["center_m"] for score in stays) < 0.3
    assert max(score["center_m"] for score in stays) > 1.0
    assert together["stays"]["predicted"] == pytest.approx(1 - together["stays"]["seen"])
    assert together["needs-image"] is None
    assert "needs-image does not track track" in printed
    assert "expected an image, found none" in printed
    assert "E3D (7.3)" in printed
    assert "stays: errors, states" in printed
    assert written["protocol"]["values"]["metrics"]["overlap"] == 0.25
    assert written["protocol"]["challenges"]["POS"].startswith("its heading")
    assert written["data"]["drives"] == [{"drive": "0000", "sensor": "VLP-16", "frames": FRAMES}]
    assert sorted(path.name for path in plots.iterdir()) == [
        "heading.png",
        "location.png",
        "one_pass.png",
        "overlap.png",
    ]


def test_one_object_and_one_tracker(folder: Path, fakes: None, capsys):
    track_id = DriveObjects.of(open_drive(folder)).sequences(15)[-1].track_id
    words = ["otd", str(folder), "--set", "present", "--trackers", "stays", "--frames", "15"]
    assert main(["evaluate", *words, "--track-id", str(track_id)]) == 0
    printed = capsys.readouterr().out
    assert ": 1 of 1 sequences of the set present" in printed
    assert "knows" not in printed
    assert "together" not in printed
    assert "0-14" in printed


def test_a_synthetic_drive_has_no_sequences_of_the_thesis(folder: Path, fakes: None):
    found = "a synthetic drive; no scans of sequence 0001"
    with fault(DriveError, found=found, advice="--set present"):
        command("evaluate", "otd", folder)


@pytest.mark.parametrize(
    ("flags", "expected", "found"),
    [
        (("--trackers", "stays,nobody"), "some of knows, stays, needs-image, each once", "nobody"),
        (("--trackers", "stays,stays"), "each once", "stays,stays"),
        (("--frames", "1"), "at least 2", "1"),
    ],
)
def test_unusable_flags_are_an_error(folder: Path, fakes: None, flags, expected, found):
    with fault(UsageError, where=flags[0], expected=expected, found=found):
        command("evaluate", "otd", folder, "--set", "present", *flags)


def test_an_unknown_track_id_is_an_error(folder: Path, fakes: None):
    with fault(DriveError, found="none with 15 labelled frames"):
        command("evaluate", "otd", folder, "--set", "present", "--track-id", "4321")


def test_published_sequences_at_hand_and_absent(kitti_root: Path):
    root = kitti_root / "tracking"
    found = find_objects(ObjectSetConfig(root, "all", frames=20))
    (drive_targets,) = found.drives
    assert [one.sequence.name for one in drive_targets.objects] == [
        "3.2 (1) = OTD 1",
        "3.2 (2) = OTD 2",
        "OTD 3",
    ]
    assert [len(one.truth) for one in drive_targets.objects] == [
        20,
        20,
        12,
    ]  # the third begins at 8
    assert [one.total_frames for one in drive_targets.objects] == [154, 154, 101]
    assert len(found.absent) == 50
    assert found.absent[0].reason == "no scans of sequence 0001"
    with pytest.raises(DriveError) as caught:
        find_objects(ObjectSetConfig(root, "3d-otd", sequence="0", track_id=3, frames=9))
    assert caught.value.found == "not labelled in the frames here"


def test_object_frames_do_not_follow_each_other(kitti_root: Path):
    with pytest.raises(DriveError) as caught:
        find_objects(ObjectSetConfig(kitti_root / "object", "present"))
    assert caught.value.expected == "a sequence of frames"


def test_an_unknown_tracker_is_reported():
    with pytest.raises(UsageError) as caught:
        trackers.single_object_tracker("nobody", VLP_16)
    assert caught.value.found == "nobody"
    assert "h-fus" in caught.value.expected
