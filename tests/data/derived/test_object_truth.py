"""Objects of drives as tracks, by labels or by the exact truth of a synthetic drive."""

from pathlib import Path

import numpy as np
import pytest

from data.derived.object_truth import DriveObjects
from data.open_drive import open_drive
from data.synthetic.drive import SyntheticDrive
from data.synthetic.writer import write_tracking
from perception.evaluation.single_object.track import ObjectSequence
from perception.sensor import VLP_16

FRAMES = 6


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    drive = SyntheticDrive(FRAMES, sensor=VLP_16, images=False)
    return write_tracking(drive, tmp_path_factory.mktemp("drive"), 0, lambda: None)


@pytest.fixture(scope="module")
def exact() -> SyntheticDrive:
    return SyntheticDrive(FRAMES, sensor=VLP_16, images=False)


def test_a_synthetic_object_is_where_it_is_and_moves_as_it_does(
    folder: Path, exact: SyntheticDrive
):
    labelled = DriveObjects.of(open_drive(folder))
    moving = 0
    for one in labelled.sequences(FRAMES):
        track = labelled.track(one)
        assert track.frames.tolist() == list(range(FRAMES))
        np.testing.assert_allclose(track.stamps_s, 0.1 * np.arange(FRAMES))
        around = exact.labels_around(3)
        row = int(np.argmax(around.track_ids == one.track_id))
        if around.track_ids[row] != one.track_id:
            continue  # too far away
        assert one.kind == around.types[row]
        np.testing.assert_allclose(
            track.boxes_velo.bottom_m[3], around.boxes_velo.bottom_m[row], atol=1e-4
        )
        way_m = exact.true_world_SE3_velo(3)[:3, :3] @ np.append(track.velocities_m_s[3], 0)
        if np.linalg.norm(way_m) > 2:
            moving += 1
            bottoms = [
                (exact.true_world_SE3_velo(k) @ np.append(track.boxes_velo.bottom_m[k], 1))[:2]
                for k in (2, 4)
            ]
            np.testing.assert_allclose((bottoms[1] - bottoms[0]) / 0.2, way_m[:2], atol=0.15)
    assert moving >= 1


def test_a_drive_in_memory_has_the_same_objects(folder: Path, exact: SyntheticDrive):
    written, drawn = DriveObjects.of(open_drive(folder)), DriveObjects.of(exact)
    assert [one.track_id for one in drawn.sequences(2)] == [
        one.track_id for one in written.sequences(2)
    ]
    one = drawn.sequences(FRAMES)[0]
    mine, theirs = drawn.track(one), written.track(one)
    np.testing.assert_allclose(mine.boxes_velo.bottom_m, theirs.boxes_velo.bottom_m, atol=1e-4)
    np.testing.assert_allclose(mine.stamps_s, theirs.stamps_s)


def test_what_the_camera_does_not_see_is_still_there(folder: Path):
    drive = open_drive(folder)
    whole = DriveObjects.of(drive)
    one = whole.sequences(FRAMES)[0]
    hidden = [labels[labels.track_ids != one.track_id] for labels in whole.camera_labels[2:4]]
    seen = [*whole.camera_labels[:2], *hidden, *whole.camera_labels[4:]]
    track = DriveObjects(whole.sequence, whole.stamps_s, seen, whole.truth).track(one)
    assert track.frames.tolist() == list(range(FRAMES))
    assert track.occlusion[2:4].tolist() == [2, 2]
    assert np.isnan(track.boxes_px).all(axis=1).tolist() == [False, False, True, True, False, False]
    # Without exact truth nobody knows where it was.
    track = DriveObjects(whole.sequence, whole.stamps_s, seen, None).track(one)
    assert track.frames.tolist() == [0, 1, 4, 5]
    assert np.isnan(track.velocities_m_s).all()


def test_only_objects_seen_often_enough_are_offered(folder: Path):
    labelled = DriveObjects.of(open_drive(folder))
    often = labelled.sequences(FRAMES)
    assert 0 < len(often) <= len(labelled.sequences(1))
    assert labelled.sequences(FRAMES + 1) == []
    assert [one.track_id for one in often] == sorted(one.track_id for one in often)


def test_an_object_that_is_not_there_has_no_frames(folder: Path):
    track = DriveObjects.of(open_drive(folder)).track(
        ObjectSequence("nobody", "0000", 4321, "Car", 0, 90)
    )
    assert len(track) == 0


def test_labels_of_sequence_0000(kitti_root: Path):
    drive = open_drive(kitti_root / "tracking", sequence="0000", images=False)
    labelled = DriveObjects.of(drive)
    sequences = {one.track_id: one for one in labelled.sequences(15)}
    assert (sequences[0].first_frame, sequences[0].last_frame) == (0, 153)
    track = labelled.track(sequences[1])
    assert len(track) == 154
    speeds = np.linalg.norm(track.velocities_m_s, axis=1)
    assert 3 < np.median(speeds) < 7  # a cyclist
    rows = drive.labels(77)
    np.testing.assert_array_equal(track.boxes_px[77], rows.boxes_px[rows.track_ids == 1][0])
