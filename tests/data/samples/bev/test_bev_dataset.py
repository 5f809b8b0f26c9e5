"""Labelled scans from above: labels all around or in view, and samples that are turned, mirrored, scaled and cut."""

from collections import Counter

import numpy as np
import pytest

from data.array_store import ArrayStore
from data.label_proposals.proposals import Proposal, ProposalFile
from data.label_proposals.proposed_labels import ProposedLabels
from data.open_drive import open_drive
from data.samples.bev.config import BevAugmentationConfig
from data.samples.bev.dataset import BevConfig, BevDataset, augment, collate, crop, jitter, stretch
from data.samples.bev.labelled_scans import LabelledScans
from data.samples.epoch_samplers import SampleIndex
from data.synthetic.collection import SynthConfig, write_drives
from perception.detection.bev.bev_map import (
    BLOCK,
    CHANNELS,
    GROUND,
    REFLECTANCE,
    BevGrid,
    planes_of,
)
from perception.geometry.boxes import points_inside
from perception.sensor import VLP_16
from perception.types import Boxes3D

GRID = BevGrid(reach_m=25.6, cell_m=0.4)


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    """Return the same kind of street as object frames, and as a sequence."""
    folders = []
    for layout in ("object", "tracking"):
        out = tmp_path_factory.mktemp(layout)
        synth_config = SynthConfig(layout=layout, frames=1, sensor=VLP_16, seed=4, images=False, street="jam")  # fmt: skip
        folders += write_drives(out, synth_config)
    return [open_drive(folder) for folder in folders]


STILL = dict.fromkeys(
    ("turn_rad", "mirror", "scale", "stretch", "thinning", "dropout", "reflectance", "gain", "ground_m", "tilt_rad"),
    0.0,
)  # fmt: skip


@pytest.fixture(scope="module")
def scans(drives, tmp_path_factory):
    return LabelledScans(drives, GRID, ArrayStore(tmp_path_factory.mktemp("cache")))


@pytest.fixture
def dataset(scans):
    def make(**magnitudes) -> BevDataset:
        augmentation = BevAugmentationConfig(**magnitudes) if magnitudes else None
        return BevDataset(scans, np.array([0]), BevConfig(GRID), augmentation)

    return make


def test_synthetic_drives_are_labelled_all_around(scans):
    finer, by_kitti = scans.labels(0), scans.labels(1)
    assert finer.view_rad == pytest.approx([0, np.pi])
    assert "Bus" in finer.types
    assert "Bus" not in by_kitti.types
    assert by_kitti.view_rad == pytest.approx([0, np.pi])
    # KITTI does not label two-wheelers without riders, whose boxes come last.
    assert set(finer.types[len(by_kitti) :].tolist()) <= {"Bicycle", "Motorcycle"}
    assert np.array_equal(finer.boxes[: len(by_kitti)], by_kitti.boxes)
    assert (finer.boxes[:, 0] < 0).any()


def test_labels_stand_on_the_ground_and_know_their_returns(scans):
    labels = scans.labels(0)
    near = np.hypot(labels.boxes[:, 0], labels.boxes[:, 1]) < 20
    assert np.median(np.abs(labels.boxes[near, 2])) < 0.1
    assert labels.returns.sum() > 100
    again = LabelledScans(scans.drives, GRID, scans.store)
    assert again.missing() == []
    assert np.array_equal(again.scan(0).heights_m, scans.scan(0).heights_m)


def test_labels_of_a_camera_are_those_of_its_directions(drives, scans, tmp_path, monkeypatch):
    monkeypatch.setattr("data.samples.bev.labelled_scans.truth_files", lambda drive: None)
    in_view = LabelledScans(drives[1:], GRID, ArrayStore(tmp_path)).labels(0)
    # 1242 pixels at a focal length of 721.5 pixels.
    assert in_view.view_rad == pytest.approx([0, np.arctan(621 / 721.5)], abs=0.02)
    assert 0 < len(in_view) < len(scans.labels(1))


def test_proposals_are_learned_in_place_of_the_labels_of_a_drive(drives, scans, tmp_path):
    drive = drives[0]
    box = Boxes3D(np.array([[5.0, 1, -1.6]] * 2), np.array([[4.0, 2, 1.5]] * 2), np.zeros(2))
    sure, unsure = (
        Proposal(number, "Car", confidence, True, np.zeros(1, int), box[:1], np.ones(1), 0)
        for number, confidence in ((1, 0.9), (2, 0.2))
    )
    names = {0: drive.frame_names[0]}
    ProposalFile([sure, unsure], {0: np.eye(4)}, names).write(tmp_path)
    proposed = LabelledScans(drives, GRID, scans.store, {drive.name: ProposedLabels(tmp_path)})
    labels = proposed.labels(0)
    assert labels.types.tolist() == ["Car", "DontCare"]
    assert labels.view_rad == pytest.approx([0, np.pi])
    targets = BevDataset(proposed, np.array([0]), BevConfig(GRID)).targets(0)
    assert targets["is_ignored"].tolist()[1]
    assert proposed.keys(0) != scans.keys(0)
    assert np.array_equal(proposed.labels(1).boxes, scans.labels(1).boxes)
    # Of a frame without proposals nothing is learned.
    ProposalFile([], {0: np.eye(4)}, {0: "another"}).write(tmp_path)
    other = LabelledScans(drives, GRID, scans.store, {drive.name: ProposedLabels(tmp_path)})
    assert other.labels(0).view_rad[1] < 0


def test_a_sample_is_the_map_with_its_targets(dataset):
    sample = dataset()[0]
    assert sample["maps"].shape == (32, 32, 16, CHANNELS)
    assert len(sample["boxes"]) == len(sample["classes"]) == len(sample["is_ignored"])
    assert (sample["boxes"][:, :2].abs() < GRID.reach_m).all()
    assert dataset().target_types()["Truck"] > 0
    batch = collate([sample, {**sample, "boxes": sample["boxes"][:1]}])
    assert batch["boxes"].shape == (2, len(sample["boxes"]), 7)
    assert batch["boxes"][1, 1:].abs().sum() == 0


def test_points_stay_in_their_boxes(scans):
    scan = scans.scan(0)
    magnitudes = BevAugmentationConfig(turn_rad=3.0, mirror=1.0, scale=0.2)
    moved = augment(scan, magnitudes, np.random.default_rng(5))
    before, after = counts_inside(scan), counts_inside(moved)
    assert before.max() > 50
    assert np.abs(before - after).max() <= 0.05 * before.max()
    assert not np.allclose(scan.labels.boxes, moved.labels.boxes, atol=0.5)


def counts_inside(scan):
    rows = scan.labels.boxes.astype(np.float64)
    bottoms_m = rows[:, :3] + [0, 0, -VLP_16.height_m]
    points = np.column_stack([scan.points_velo[:, :2], scan.heights_m - VLP_16.height_m])
    return points_inside(Boxes3D(bottoms_m, rows[:, 3:6], rows[:, 6]), points, 0.02).sum(axis=1)


def test_cars_are_stretched_about_their_middles_with_their_returns(scans):
    scan = scans.scan(0)
    long = stretch(scan, BevAugmentationConfig(stretch=0.5), np.random.default_rng(3))
    is_car = scan.labels.types == "Car"
    factors = long.labels.boxes[:, 3:5] / scan.labels.boxes[:, 3:5]
    assert np.all(factors[~is_car] == 1)
    assert 1.2 < factors[is_car, 0].max() <= 1.5
    assert 1.1 < factors[is_car, 1].max() <= 1.25
    kept = [0, 1, 2, 5, 6]
    assert np.array_equal(long.labels.boxes[:, kept], scan.labels.boxes[:, kept])
    before, after = counts_inside(scan), counts_inside(long)
    assert before[is_car].max() > 20
    assert np.abs(before - after).max() <= 0.05 * before.max()
    moved_m = np.linalg.norm(long.points_velo[:, :3] - scan.points_velo[:, :3], axis=1)
    assert 0.3 < moved_m.max() < 0.25 * 6.0
    assert np.mean(moved_m > 0) < 0.3
    assert np.array_equal(long.points_velo[:, 2:], scan.points_velo[:, 2:])
    none = stretch(scan, BevAugmentationConfig(stretch=0.0), np.random.default_rng(3))
    assert np.array_equal(none.points_velo, scan.points_velo)


def test_a_jittered_scan_keeps_shares_of_returns_and_heights_of_boxes(scans):
    scan = scans.scan(0)
    magnitudes = BevAugmentationConfig(dropout=0.9, ground_m=0.5, tilt_rad=0.05)
    jittered = jitter(scan, magnitudes, np.random.default_rng(1))
    share = len(jittered.points_velo) / len(scan.points_velo)
    assert 0.1 < share < 0.9
    expected = scan.labels.returns * share
    assert np.allclose(jittered.labels.returns, expected, atol=1)
    rises_m = jittered.labels.boxes[:, 2] - scan.labels.boxes[:, 2]
    ground = np.column_stack([scan.labels.boxes[:, :2], np.ones(len(rises_m))])
    plane, *_ = np.linalg.lstsq(ground, rises_m, rcond=None)
    assert np.abs(ground @ plane - rises_m).max() < 1e-4
    assert np.abs(plane[:2]).min() > 1e-3
    rows = {tuple(point) for point in scan.points_velo[:, :3]}
    assert all(tuple(point) in rows for point in jittered.points_velo[:, :3])


def test_a_scan_without_jitter_keeps_its_returns(scans):
    scan = scans.scan(0)
    none = BevAugmentationConfig(dropout=0.0, gain=0.0, ground_m=0.0, tilt_rad=0.0)
    same = jitter(scan, none, np.random.default_rng(1))
    assert np.array_equal(same.points_velo, scan.points_velo)
    assert np.array_equal(same.heights_m, scan.heights_m)
    assert np.array_equal(same.labels.boxes, scan.labels.boxes)


def test_the_same_index_is_the_same_view(dataset):
    samples = dataset(thinning=0.0, reflectance=1.0)
    first, again, other = (samples[SampleIndex(0, (0, n))]["maps"].numpy() for n in (0, 0, 1))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    assert not first[..., REFLECTANCE].any()
    assert first[..., GROUND].any()


def test_a_sample_holds_objects_of_another_scan_of_its_drive(dataset):
    plain, *pasted = (
        dataset(paste=number, **STILL)[SampleIndex(0, (0, number))]["boxes"]
        for number in (0, 8, 9, 10)
    )
    assert max(len(boxes) for boxes in pasted) > len(plain)
    assert all(boxes[: len(plain)].equal(plain) for boxes in pasted)


def test_a_crop_is_a_part_of_the_map_around_an_object(dataset):
    whole, sample = dataset()[0], dataset(crop=0.5, **STILL)[SampleIndex(0, (0, 0))]
    assert sample["maps"].shape == (16, 16, 16, CHANNELS)
    first = (sample["middle_m"] / (BLOCK * GRID.cell_m)).round().long() + 16 - 8
    row, column = first.tolist()
    assert sample["maps"].equal(whole["maps"][row : row + 16, column : column + 16])


@pytest.mark.parametrize("place_m", [(0, 0), (25, -25), (-10, 20)])
def test_a_crop_holds_its_place(place_m):
    maps, rng = np.zeros((32, 32, 16, 1), np.uint8), np.random.default_rng(0)
    row, column = ((np.array(place_m) + GRID.reach_m) / (BLOCK * GRID.cell_m)).astype(int)
    maps[row, column] = 1
    for _ in range(20):
        cut, first = crop(maps, np.array(place_m, np.float32), GRID, 0.5, rng)
        assert cut.shape == (16, 16, 16, 1)
        assert planes_of(cut).sum() == 16
        assert ((first >= 0) & (first <= 16)).all()


def test_crops_lie_around_rare_classes_more_often(dataset, monkeypatch):
    samples, rng = dataset(crop=0.5), np.random.default_rng(0)
    names, labels = samples.config.class_names, samples.scans.labels(0)
    monkeypatch.setattr(
        BevDataset, "target_types", lambda _: Counter({**dict.fromkeys(names, 10**8), "Bus": 1})
    )
    assert samples._rarities[names.index("Bus")] == 1
    buses = labels.boxes[labels.types == "Bus"][:, :2]
    for _ in range(20):
        assert (np.abs(buses - samples._draw_center_m(labels, rng)).sum(axis=1) < 1e-6).any()
