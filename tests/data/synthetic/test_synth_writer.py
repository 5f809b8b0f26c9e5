"""What is written is read back the same, in all three layouts."""

from dataclasses import replace

import numpy as np
import pytest

from data.kitti.labels import read_object_labels
from data.open_drive import open_drive
from data.synthetic import writer
from data.synthetic.collection import SynthConfig, draw_drive, write_drives
from data.synthetic.drive import SyntheticDrive
from data.synthetic.materials import SemanticClass
from data.synthetic.writer import DATE, semantic_kitti_labels
from perception.errors import UsageError
from perception.sensor import VLP_16
from tests.faults import fault

FRAMES = 2
SEQUENCE = SynthConfig(frames=FRAMES, sensor=VLP_16, seed=7)


@pytest.fixture(scope="module")
def made() -> SyntheticDrive:
    """Return the drive that is written, made again; the layout does not change it."""
    return draw_drive(SEQUENCE, 0, FRAMES)


@pytest.mark.slow
@pytest.mark.parametrize("layout", ["raw", "tracking"])
def test_a_sequence_round_trip(made, tmp_path, layout):
    synth_config = replace(SEQUENCE, layout=layout)
    done = []
    [folder] = write_drives(tmp_path, synth_config, lambda: done.append(1))
    assert len(done) == synth_config.part().frames == FRAMES
    read = open_drive(folder)
    assert (len(read), read.sensor.name) == (FRAMES, "VLP-16")
    for index in range(FRAMES):
        ours, theirs = made[index], read[index]
        assert np.array_equal(ours.points_velo, theirs.points_velo)
        assert np.array_equal(ours.image, theirs.image)
        assert theirs.world_SE3_velo == pytest.approx(ours.world_SE3_velo, abs=1e-4)
        truth, read_truth = made.point_truth(index), read.point_truth(index)
        assert np.array_equal(truth.classes, read_truth.classes)
        assert np.array_equal(truth.instances, read_truth.instances)
        assert np.array_equal(truth.is_moving, read_truth.is_moving)
        labels, read_labels = made.labels(index), read.labels(index)
        assert np.array_equal(labels.track_ids, read_labels.track_ids)
        assert list(labels.types) == list(read_labels.types)
        assert read_labels.boxes_velo.bottom_m == pytest.approx(
            labels.boxes_velo.bottom_m, abs=1e-4
        )
        assert read_labels.boxes_px == pytest.approx(labels.boxes_px, abs=1e-4)
        assert np.array_equal(labels.occlusion, read_labels.occlusion)
        assert np.array_equal(labels.truncation, read_labels.truncation)
    assert not list(tmp_path.rglob("*.part"))


def test_raw_has_truth_poses_and_stamps(made, tmp_path):
    [folder] = write_drives(tmp_path, replace(SEQUENCE, images=False))
    assert folder == tmp_path / DATE / f"{DATE}_drive_0000_sync"
    poses = np.loadtxt(folder / "truth_poses.txt").reshape(-1, 3, 4)
    assert poses[1] == pytest.approx(made.true_world_SE3_velo(1)[:3], abs=1e-6)
    assert open_drive(folder)[1].stamp_s == pytest.approx(0.1)
    assert not (folder / "image_02").exists()


def test_object_frames_come_from_several_worlds(tmp_path):
    synth_config = SynthConfig(layout="object", frames=6, sensor=VLP_16, seed=9, images=False)
    [folder] = write_drives(tmp_path, synth_config)
    read = open_drive(folder)
    assert len(read) == 6
    scans = [read[index].points_velo for index in range(6)]
    assert len({len(scan) for scan in scans}) > 1
    labels = read.labels(0)
    assert (labels.track_ids == -1).all()
    assert ((labels.truncation >= 0) & (labels.truncation <= 1)).all()
    assert read.point_truth(5) is not None
    apart = tmp_path / "apart"
    for number in (1, 2):
        write_drives(apart, synth_config, part=synth_config.part(number, 2))
    files = [path.relative_to(folder) for path in folder.rglob("*") if path.is_file()]
    assert all((apart / "training" / path).is_file() for path in files)
    scan = "velodyne/000005.bin"
    assert (apart / "training" / scan).read_bytes() == (folder / scan).read_bytes()


def test_labels_all_around_object_frames_tell_buses_from_trucks(tmp_path):
    synth_config = SynthConfig(
        layout="object", frames=1, sensor=VLP_16, seed=4, images=False, street="jam"
    )
    [folder] = write_drives(tmp_path, synth_config)
    exact = draw_drive(synth_config, 0, 1)
    by_kitti, finer = exact.labels_around(0), exact.labels_around(0, by_category=True)
    path = folder / "truth_labels" / "000000.txt"
    read = read_object_labels(path, open_drive(folder).frame_calibration(0))
    assert read.types.tolist() == finer.types.tolist()
    assert read.boxes_velo.bottom_m == pytest.approx(finer.boxes_velo.bottom_m, abs=1e-4)
    # Boxes of two-wheelers without riders, which KITTI does not label, come last.
    is_bus = finer.types[: len(by_kitti)] == "Bus"
    assert is_bus.any()
    assert set(by_kitti.types[is_bus].tolist()) == {"Truck"}
    assert "Bus" not in by_kitti.types


@pytest.mark.parametrize(
    ("drives", "frames", "layout", "sizes"),
    [(5, 7, "raw", [14, 21]), (1, 52, "object", [25, 27]), (1, 3, "object", [3])],
)
def test_parts_share_all_frames(drives, frames, layout, sizes):
    synth_config = SynthConfig(layout=layout, drives=drives, frames=frames)
    parts = [synth_config.part(n + 1, len(sizes)) for n in range(len(sizes))]
    assert [one.frames for one in parts] == sizes
    numbers = [number for one in parts for number in one.numbers]
    assert numbers == list(range(synth_config.units))


def test_words_tell_class_motion_and_instance(street_drive):
    truth = street_drive.point_truth(0)
    words = semantic_kitti_labels(truth)
    assert np.array_equal(words >> 16, truth.instances)
    cars = truth.classes == SemanticClass.CAR
    assert (words[cars & truth.is_moving] & 0xFFFF == 252).all()
    assert (words[cars & ~truth.is_moving] & 0xFFFF == 10).all()


def test_zero_frames_and_unknown_layouts_are_refused():
    with fault(UsageError, expected="at least one frame"):
        SynthConfig(frames=0)
    with fault(UsageError, expected="raw, tracking, object or folder"):
        SynthConfig(layout="odometry")


@pytest.mark.slow
def test_a_second_process_writes_the_same_bytes(made, tmp_path, monkeypatch):
    monkeypatch.setattr(writer, "MIN_FRAMES_OF_A_PROCESS", FRAMES)
    [folder] = write_drives(tmp_path, SEQUENCE)
    for index, frame in enumerate(open_drive(folder)):
        assert np.array_equal(frame.points_velo, made[index].points_velo)
        assert np.array_equal(frame.image, made[index].image)
