import math

import pytest
import torch

from perception.detection.detectors.input_size import InputSize
from perception.errors import UsageError
from tests.faults import fault
from tests.train.image_labels import ImageLabels, pad_labels
from train.detector.multi_scale import (
    resize_images,
    resize_labels,
    scaled_sizes,
    size_of_batch,
)
from train.detector.targets import PredictionGrid, assign_targets, shape_iou

ANCHORS_PX = torch.tensor([[16.0, 16], [64, 32]])
GRID = PredictionGrid(rows=2, columns=3, stride_px=32)  # 96 x 64 pixels


def labels_of(*boxes, classes=None, ignored=()):
    boxes_px = torch.tensor(boxes, dtype=torch.float32).reshape(-1, 4)
    count = len(boxes_px)
    is_ignored = torch.tensor([row in ignored for row in range(count)], dtype=torch.bool)
    return ImageLabels(boxes_px, torch.tensor(classes or [0] * count, dtype=torch.long), is_ignored)


def assign(*images):
    return assign_targets(pad_labels(images), ANCHORS_PX, GRID)


def test_one_label_by_hand():
    # Centre (40, 52), 32 x 16: cell (1, 1), a quarter and five eighths into it; half of anchor 1.
    targets = assign(labels_of([24, 44, 56, 60], classes=[3]))
    assert targets.image.tolist() == [0]
    assert (targets.anchor.item(), targets.row.item(), targets.column.item()) == (0, 1, 1)
    # Overlap with 16 x 16 is a half, with 64 x 32 a quarter.
    expected = torch.tensor([[0.25, 0.625, math.log(2), 0]])
    assert torch.allclose(targets.offsets, expected)
    assert targets.classes.tolist() == [3]
    assert targets.area_shares.item() == pytest.approx(32 * 16 / (96 * 64))
    assert targets.unassigned == 0


def test_shapes_overlap_on_one_corner():
    overlap = shape_iou(torch.tensor([[32.0, 16]]), ANCHORS_PX)
    assert overlap.tolist() == [[0.5, 0.25]]


def test_two_shapes_in_one_cell_keep_their_anchors():
    targets = assign(labels_of([0, 0, 62, 30], [10, 10, 25, 25]))
    assert targets.anchor.tolist() == [1, 0]
    assert targets.column.tolist() == [0, 0]


def test_the_better_of_two_like_shapes_has_the_anchor_and_the_other_the_next():
    targets = assign(labels_of([10, 10, 24, 24], [8, 8, 24, 24]))
    assert targets.anchor.tolist() == [1, 0]
    assert targets.unassigned == 0


def test_of_equal_labels_the_first_comes_first():
    targets = assign(labels_of([8, 8, 24, 24], [8, 8, 24, 24], classes=[5, 6]))
    assert targets.classes[targets.anchor == 0].tolist() == [5]


def test_a_full_cell_leaves_labels_out():
    targets = assign(labels_of([8, 8, 24, 24], [8, 8, 25, 25], [8, 8, 26, 26]))
    assert sorted(targets.anchor.tolist()) == [0, 1]
    assert targets.unassigned == 1


def test_no_two_labels_share_a_prediction():
    generator = torch.Generator().manual_seed(0)
    corners = torch.rand(4, 30, 2, generator=generator) * torch.tensor([80.0, 50])
    sizes = torch.rand(4, 30, 2, generator=generator) * 14 + 1
    boxes = torch.cat([corners, corners + sizes], dim=2)
    targets = assign(*(labels_of(*image.tolist()) for image in boxes))
    places = list(
        zip(
            targets.image.tolist(),
            targets.anchor.tolist(),
            targets.row.tolist(),
            targets.column.tolist(),
            strict=True,
        )
    )
    assert len(set(places)) == len(places)
    assert len(places) + targets.unassigned == 4 * 30


@pytest.mark.parametrize(
    "box",
    [
        [-40, 10, -10, 20],
        [90, 10, 110, 20],  # centre at x = 100 of 96
        [10, 60, 20, 70],  # centre at y = 65 of 64
        [10, 10, 10, 20],
        [10, 20, 20, 10],
        [10, 10, math.nan, 20],
        [10, 10, math.inf, 20],
    ],
    ids=["left", "right", "below", "no width", "upside down", "NaN", "endless"],
)
def test_labels_that_cannot_be_found_are_left_out(box):
    targets = assign(labels_of(box, [8, 8, 24, 24]))
    assert targets.boxes_px.tolist() == [[8, 8, 24, 24]]
    assert targets.unassigned == 1
    assert targets.offsets.isfinite().all()


def test_ignored_areas_have_no_target():
    targets = assign(labels_of([8, 8, 24, 24], [40, 8, 60, 24], ignored=[0]))
    assert targets.column.tolist() == [1]
    assert targets.unassigned == 0


def test_images_with_and_without_labels_in_one_batch():
    targets = assign(
        labels_of(), labels_of([8, 8, 24, 24], [70, 8, 90, 24]), labels_of([0, 0, 9, 9])
    )
    assert targets.image.tolist() == [1, 1, 2]
    assert targets.unassigned == 0


def test_no_labels_at_all():
    targets = assign(labels_of(), labels_of())
    assert len(targets.image) == 0
    assert targets.offsets.shape == (0, 4)


def test_sizes_keep_the_shape_of_the_input():
    sizes = scaled_sizes(InputSize(352, 1216), 0.7, 1.3)
    assert sizes[0] == (256, 896)
    assert sizes[-1] == (448, 1536)
    assert all(h % 32 == 0 and w % 32 == 0 for h, w in sizes)
    assert max(abs(w / h - 1216 / 352) / (1216 / 352) for h, w in sizes) < 0.05


def test_published_sizes_are_square():
    sizes = scaled_sizes(InputSize(416, 416), 0.769, 1.462)  # as in the thesis' configuration
    assert sizes == tuple((side, side) for side in range(320, 609, 32))


def test_ten_batches_share_a_size_and_a_resumed_run_draws_the_same():
    sizes = scaled_sizes(InputSize(192, 640), 0.6, 1.4)
    drawn = [size_of_batch(sizes, batch, seed=1) for batch in range(200)]
    assert all(len(set(drawn[first : first + 10])) == 1 for first in range(0, 200, 10))
    assert set(drawn) == set(sizes)
    assert drawn[137] == size_of_batch(sizes, 137, seed=1)


def test_labels_stay_with_their_image():
    before, after = InputSize(64, 96), InputSize(32, 192)
    labels = resize_labels(pad_labels([labels_of([10, 20, 30, 40])]), before, after)
    assert labels.boxes_px.tolist() == [[[20, 10, 60, 20]]]


def test_nearest_invents_no_depth():
    picture = torch.tensor([[[[0, 200], [0, 200]]]], dtype=torch.uint8)
    larger = resize_images(picture, InputSize(4, 6), "nearest")
    assert larger.unique().tolist() == [0, 200]
    smooth = resize_images(picture, InputSize(4, 6), "bilinear")
    assert len(smooth.unique()) > 2


@pytest.mark.parametrize("scales", [(1.05, 1.1), (0.0, 0.1), (1.2, 0.8)])
def test_scales_that_hold_no_size_are_refused(scales):
    with fault(UsageError, expected="scales of 192 rows that hold a multiple of 32"):
        scaled_sizes(InputSize(192, 640), *scales)
