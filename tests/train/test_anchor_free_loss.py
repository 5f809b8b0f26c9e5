import math
import multiprocessing

import pytest
import torch

from tests.train.image_labels import ImageLabels, pad_labels
from train.detector.anchor_free_loss import anchor_free_loss, assign_cells
from train.detector.config import DetectionLossConfig
from train.networks.yolox import STRIDES_PX, YoloxHead, flatten_levels

HEAD = YoloxHead(("Car", "Van"))
CONFIG = DetectionLossConfig(box_weight=1, object_weight=1)
CELLS = 8 * 12 + 4 * 6 + 2 * 3  # of an input of 64 x 96 pixels


def raw_maps(batch=1):
    """Return raw predictions of an input of 64 x 96 pixels whose boxes are the cells, and all others 0."""
    raw = [torch.zeros(batch, 7, 64 // stride_px, 96 // stride_px) for stride_px in STRIDES_PX]
    for maps in raw:
        maps[:, :2] = 0.5
    return tuple(raw)


def labels_of(*images):
    """Return labels of images, each of boxes with class and whether it is ignored."""
    return pad_labels(
        [
            ImageLabels(
                torch.tensor([box for box, *_ in image], dtype=torch.float32).reshape(-1, 4),
                torch.tensor([number for _, number, _ in image], dtype=torch.long),
                torch.tensor([ignored for *_, ignored in image], dtype=torch.bool),
            )
            for image in images
        ]
    )


def assigned(raw, labels):
    return assign_cells(raw, flatten_levels(raw), HEAD.decode_boxes(raw), labels)


def test_the_cell_that_fits_is_assigned():
    # The cell of 8 px at row 2, column 3.
    found = assigned(raw_maps(), labels_of([([24, 16, 32, 24], 1, False)]))
    assert found.image.tolist() == [0]
    assert found.cell.tolist() == [2 * 12 + 3]
    assert found.iou.tolist() == [1]


def test_as_many_cells_are_assigned_as_overlap_in_sum():
    raw = raw_maps()
    for maps, stride_px in zip(raw, STRIDES_PX, strict=True):
        maps[:, 2:4] = math.log(32 / stride_px)  # every box is 32 x 32
    found = assigned(raw, labels_of([([32, 16, 64, 48], 0, False)]))
    assert len(found.cell) == int(
        min(10, sum(sorted(found_ious(raw, [32, 16, 64, 48]), reverse=True)[:10]))
    )
    assert len(found.cell) > 3


def found_ious(raw, box):
    """Return the IoU of the boxes whose cell's centre is within 2.5 cells of the label's, one by one."""
    boxes_px = HEAD.decode_boxes(raw)[0].tolist()
    ious, number = [], 0
    for stride_px in STRIDES_PX:
        for row in range(64 // stride_px):
            for column in range(96 // stride_px):
                x, y = (column + 0.5) * stride_px, (row + 0.5) * stride_px
                is_near = abs(x - 48) < 2.5 * stride_px and abs(y - 32) < 2.5 * stride_px
                if is_near and box[0] < x < box[2] and box[1] < y < box[3]:
                    ious.append(iou(boxes_px[number], box))
                number += 1
    return ious


def iou(a, b):
    across = max(0, min(a[2], b[2]) - max(a[0], b[0]))
    down = max(0, min(a[3], b[3]) - max(a[1], b[1]))
    areas = [(one[2] - one[0]) * (one[3] - one[1]) for one in (a, b)]
    return across * down / (sum(areas) - across * down)


def test_a_cell_has_one_label():
    box = [24, 16, 32, 24]
    found = assigned(raw_maps(), labels_of([(box, 0, False), (box, 1, False)]))
    assert len(set(found.cell.tolist())) == len(found.cell)


def test_each_image_has_its_own_cells():
    labels = labels_of([], [([24, 16, 32, 24], 0, False)], [([8, 8, 16, 16], 0, False)])
    found = assigned(raw_maps(3), labels)
    assert found.image.tolist() == [1, 2]
    assert found.cell.tolist() == [2 * 12 + 3, 1 * 12 + 1]


def test_ignored_and_padded_labels_have_no_cells():
    found = assigned(raw_maps(), labels_of([([24, 16, 32, 24], 0, True), ([0, 0, 0, 0], 0, False)]))
    assert len(found.cell) == 0


def test_terms_by_hand():
    loss = anchor_free_loss(
        raw_maps(), labels_of([([24, 16, 32, 24], 1, False)]), HEAD, CONFIG, images_seen=0
    )
    half = math.log(2)
    assert loss.box.item() == pytest.approx(0, abs=1e-6)
    assert loss.objects.item() == pytest.approx(half)
    assert loss.no_objects.item() == pytest.approx((CELLS - 1) * half, rel=1e-5)
    assert loss.classes.item() == pytest.approx(2 * half)
    assert loss.total.item() == pytest.approx(sum(term.item() for term in loss[1:]))


def test_background_is_not_learned_in_ignored_areas():
    loss = anchor_free_loss(
        raw_maps(), labels_of([([-64, -64, 160, 160], 0, True)]), HEAD, CONFIG, 0
    )
    assert loss.total.item() == 0


def test_an_image_is_learned():
    raw = tuple(maps.requires_grad_() for maps in raw_maps())
    box = [20.0, 30.0, 60.0, 50.0]
    labels, config = labels_of([(box, 1, False)]), DetectionLossConfig(box_weight=5)
    optimizer = torch.optim.Adam(raw, lr=0.1)
    for _ in range(80):
        loss = anchor_free_loss(raw, labels, HEAD, config, 0)
        optimizer.zero_grad()
        loss.total.backward()
        optimizer.step()
    decoded = HEAD.decode(raw)
    is_found = decoded.scores[0, :, 1] > 0.5
    assert 1 <= is_found.sum() <= 10
    ious = [iou(found, box) for found in decoded.boxes_px[0, is_found].tolist()]
    assert min(ious) > 0.9
    assert decoded.scores[0, is_found, 0].max() < 0.1
    assert decoded.scores[0, ~is_found].max() < 0.1


def two_images():
    """Return random predictions for two images, of which one has three labels and the other one."""
    random = torch.Generator().manual_seed(0)
    raw = tuple(maps + 0.1 * torch.randn(maps.shape, generator=random) for maps in raw_maps(2))
    boxes = [([24, 16, 32, 24], 1, False), ([0, 0, 30, 40], 0, False), ([50, 10, 90, 60], 0, False)]
    return raw, [boxes, [([40, 20, 64, 48], 1, False)]]


def gradients(raw, images):
    raw = tuple(maps.clone().requires_grad_() for maps in raw)
    anchor_free_loss(raw, labels_of(*images), HEAD, CONFIG, 0).total.backward()
    return [maps.grad for maps in raw]


def train_one_image(process, store, out):
    torch.distributed.init_process_group(
        "gloo", init_method=f"file://{store}", rank=process, world_size=2
    )
    raw, images = two_images()
    one = tuple(maps[process : process + 1] for maps in raw)
    torch.save(gradients(one, images[process : process + 1]), out / f"{process}.pt")
    torch.distributed.destroy_process_group()


def test_processes_with_other_numbers_of_cells_learn_as_one(tmp_path):
    context = multiprocessing.get_context("spawn")  # threads of torch do not survive a fork
    processes = [
        context.Process(target=train_one_image, args=(process, tmp_path / "store", tmp_path))
        for process in range(2)
    ]
    for one in processes:
        one.start()
    for one in processes:
        one.join(60)
    of_both = [torch.load(tmp_path / f"{process}.pt", weights_only=True) for process in range(2)]
    for level, whole in enumerate(gradients(*two_images())):
        # Each process has the gradient of its own image; both are averaged.
        found = torch.cat([of_one[level] for of_one in of_both]) / 2
        torch.testing.assert_close(found, whole, rtol=1e-5, atol=1e-7)
