"""Flip, zoom, shift and occlusion: images and boxes stay together, in all views."""

from dataclasses import replace

import numpy as np
import pytest

from data.samples.images.config import GeometricConfig
from data.samples.images.geometric import (
    GeometricTransform,
    crop_size_px,
    draw_crop_column,
    draw_geometric_transform,
    transform_targets,
    warp_image,
)
from data.samples.images.targets import DetectionTargets
from perception.errors import UsageError
from perception.types import Modality
from tests.faults import fault

SIZE_PX = (160, 96)
BOX = (40, 30, 60, 50)


def modality_image(box: tuple[int, ...], channels: int = 1) -> np.ndarray:
    """Return a picture that is 200 within a box and 100 around it."""
    x1, y1, x2, y2 = box
    image = np.full((SIZE_PX[1], SIZE_PX[0], channels), 100, np.uint8)
    image[y1:y2, x1:x2] = 200
    return image


def labels_of(*boxes: tuple[float, ...], min_height_px: float = 4.0) -> DetectionTargets:
    count = len(boxes)
    return DetectionTargets(
        np.array(boxes, np.float32).reshape(-1, 4),
        np.arange(count),
        np.zeros(count, bool),
        min_height_px,
    )


def extent(mask: np.ndarray) -> list[int]:
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return [columns[0], rows[0], columns[-1] + 1, rows[-1] + 1]


PLACEMENTS = {
    "flip": (GeometricTransform((-1.0, 1.0), (160.0, 0.0)), [100, 30, 120, 50]),
    "zoom": (GeometricTransform((2.0, 2.0), (-50.0, -40.0), zoom=2), [30, 20, 70, 60]),
    "smaller": (GeometricTransform((0.5, 0.5), (16.0, 8.0), zoom=0.5), [36, 23, 46, 33]),
    "shift": (GeometricTransform(offset_px=(7.0, -9.0)), [47, 21, 67, 41]),
    "flipped zoom": (GeometricTransform((-2.0, 2.0), (210.0, -40.0)), [90, 20, 130, 60]),
}


@pytest.mark.parametrize("modality", ["dm", "rm", "rgb"])
@pytest.mark.parametrize("name", PLACEMENTS)
def test_a_box_stays_around_what_it_holds(modality: Modality, name: str):
    geometric_transform, expected = PLACEMENTS[name]
    channels = 3 if modality == "rgb" else 1
    warped_image = warp_image(
        modality_image(BOX, channels), geometric_transform, modality, np.random.default_rng(0)
    )
    assert warped_image.shape == (96, 160, channels)
    labels = transform_targets(labels_of(BOX), geometric_transform, SIZE_PX)
    np.testing.assert_allclose(labels.boxes_px, [expected])
    x1, y1, x2, y2 = expected
    inside = warped_image[y1:y2, x1:x2].astype(int)
    if modality == "rgb":  # edges are mixed
        assert inside[1:-1, 1:-1].min() == 200
    else:
        assert extent(warped_image[..., 0] == 200) == expected
        assert inside.min() == 200


def test_around_a_smaller_map_cells_are_unknown():
    geometric_transform = PLACEMENTS["smaller"][0]
    warped_image = warp_image(
        modality_image(BOX), geometric_transform, "dm", np.random.default_rng(0)
    )
    assert extent(warped_image[..., 0] > 0) == [16, 8, 96, 56]
    assert set(np.unique(warped_image)) == {0, 100, 200}  # no depth in between


def test_boxes_that_leave_the_image_are_cut_ignored_or_removed():
    boxes = (0, 30, 20, 50), (40, 30, 60, 50), (70, 30, 90, 50), (4, 0, 24, 20)
    warped_image = transform_targets(
        labels_of(*boxes), GeometricTransform(offset_px=(-12.0, 0.0)), SIZE_PX
    )
    np.testing.assert_allclose(
        warped_image.boxes_px, [[0, 30, 8, 50], [28, 30, 48, 50], [58, 30, 78, 50], [0, 0, 12, 20]]
    )
    assert warped_image.classes.tolist() == [0, 1, 2, 3]
    assert warped_image.is_ignored.tolist() == [
        True,
        False,
        False,
        False,
    ]  # 40 % of the first is left
    gone = transform_targets(labels_of(*boxes), GeometricTransform(offset_px=(-20.0, 0.0)), SIZE_PX)
    assert gone.classes.tolist() == [1, 2, 3]


def test_what_has_become_too_small_is_ignored():
    boxes = (10, 10, 40, 18), (10, 10, 40, 19)
    labels = labels_of(*boxes, min_height_px=9)
    assert transform_targets(labels, GeometricTransform(), SIZE_PX).is_ignored.tolist() == [
        True,
        False,
    ]
    larger = GeometricTransform((1.5, 1.5), zoom=1.5)
    assert transform_targets(labels, larger, SIZE_PX).is_ignored.tolist() == [False, False]


@pytest.mark.parametrize(("right", "is_ignored"), [(50, False), (51, True)])
def test_what_is_hidden_by_more_than_half_is_ignored(right: int, is_ignored: bool):
    geometric_transform = GeometricTransform(occluders_px=np.array([[30.0, 20.0, right, 60.0]]))
    labels = transform_targets(labels_of(BOX), geometric_transform, SIZE_PX)
    np.testing.assert_allclose(labels.boxes_px, [BOX])
    assert labels.is_ignored.tolist() == [is_ignored]


def test_a_patch_hides_and_in_a_depth_map_is_unknown_or_nearer():
    geometric_transform = GeometricTransform(occluders_px=np.array([[35.0, 20.0, 55.0, 60.0]]))
    hiding = set()
    for seed in range(12):
        warped_image = warp_image(
            modality_image(BOX), geometric_transform, "dm", np.random.default_rng(seed)
        )[..., 0]
        (value,) = np.unique(warped_image[20:60, 35:55])
        assert value < 100  # all behind it is farther
        hiding.add(value > 0)
        assert (warped_image[:, 55:60] == modality_image(BOX)[:, 55:60, 0]).all()
    assert hiding == {True, False}


def test_ignored_regions_stay_ignored():
    region = DetectionTargets(np.array([BOX], np.float32), np.zeros(1, int), np.ones(1, bool))
    assert transform_targets(region, PLACEMENTS["zoom"][0], SIZE_PX).is_ignored.tolist() == [True]


def test_no_labels_stay_none():
    for geometric_transform, _ in PLACEMENTS.values():
        assert len(transform_targets(labels_of(), geometric_transform, SIZE_PX)) == 0


def test_draws_stay_within_the_magnitudes():
    magnitudes = GeometricConfig(
        flip=0.5, zoom=0.5, focal=0.2, aspect=0.1, shift=0.0, occlusion=0.25
    )
    drawn = [
        draw_geometric_transform(magnitudes, SIZE_PX, np.random.default_rng(seed))
        for seed in range(400)
    ]
    zooms = np.array([one.zoom for one in drawn])
    assert 0.66 < zooms.min() < 0.75
    assert 1.35 < zooms.max() <= 1.5
    scales = np.abs([one.scale for one in drawn])
    larger = np.sqrt(scales.prod(axis=1)) / zooms
    assert 1 / 1.2 <= larger.min() < larger.max() <= 1.2
    ratios = scales[:, 0] / scales[:, 1]
    assert 1 / 1.1 <= ratios.min() < ratios.max() <= 1.1
    assert np.mean([one.scale[0] < 0 for one in drawn]) == pytest.approx(0.5, abs=0.08)
    assert np.mean([one.occluders_px is not None for one in drawn]) == pytest.approx(0.25, abs=0.07)
    for one in drawn:  # a larger picture leaves no margin, a smaller one lies within
        ends = np.sort(np.outer([0, 1], one.scale) * SIZE_PX + one.offset_px, axis=0)
        slack = np.stack([-ends[0], ends[1] - SIZE_PX])
        assert (slack * np.sign(np.abs(one.scale) - 1) > -1e-9).all()
        if one.occluders_px is not None:
            assert (one.occluders_px >= 0).all()
            assert (one.occluders_px <= np.tile(SIZE_PX, 2)).all()


def test_without_a_transform_boxes_stay_in_place():
    drawn = draw_geometric_transform(GeometricConfig.none(), SIZE_PX, np.random.default_rng(1))
    assert drawn == GeometricTransform()
    only = draw_geometric_transform(
        GeometricConfig().only("zoom"), SIZE_PX, np.random.default_rng(1)
    )
    assert only.zoom == only.scale[0] == only.scale[1] != 1


def test_a_magnitude_that_cannot_be_is_refused():
    with fault(UsageError, "augmentation flip", "a magnitude from 0 to 1"):
        GeometricConfig(flip=2)


@pytest.mark.parametrize("name", PLACEMENTS)
def test_a_crop_is_a_part_of_the_whole_image(name):
    whole = replace(PLACEMENTS[name][0], occluders_px=np.array([[50.0, 20, 70, 40]]))
    image, rng = modality_image(BOX, 3), np.random.default_rng
    uncut = warp_image(image, replace(whole, occluders_px=None), "rgb", rng(0))
    cut = warp_image(
        image, replace(whole.from_column(24), occluders_px=None), "rgb", rng(0), (96, 96)
    )
    np.testing.assert_array_equal(cut, uncut[:, 24:120])
    np.testing.assert_array_equal(whole.from_column(24).occluders_px, [[26, 20, 46, 40]])
    np.testing.assert_array_equal(whole.from_column(60).occluders_px, [[0, 20, 10, 40]])
    labels = transform_targets(labels_of(BOX), whole.from_column(24), (96, 96))
    uncut_labels = transform_targets(labels_of(BOX), whole, SIZE_PX)
    moved = uncut_labels.boxes_px - [24, 0, 24, 0]
    np.testing.assert_allclose(labels.boxes_px, np.clip(moved, 0, 96))


def test_crops_keep_the_height_and_take_widths_that_the_network_takes():
    assert crop_size_px((960, 288), 0.0) == (960, 288)
    assert crop_size_px((960, 288), 0.5) == (480, 288)
    assert crop_size_px((960, 288), 0.52) == (448, 288)
    assert crop_size_px((160, 96), 0.9) == (32, 96)


def test_crops_on_objects_outnumber_others_and_lie_within_the_image():
    labels = labels_of((140, 30, 150, 50))
    columns = [draw_crop_column(labels, (160, 64), np.random.default_rng(s)) for s in range(300)]
    assert min(columns) >= 0
    assert max(columns) <= 96
    holds = np.mean([column + 64 > 140 for column in columns])
    assert 0.7 < holds < 0.9
    nothing = [
        draw_crop_column(labels_of(), (160, 64), np.random.default_rng(s)) for s in range(99)
    ]
    assert np.std(nothing) > 20
