import math
from dataclasses import replace

import pytest
import torch
from torchvision import ops

from tests.train.image_labels import ImageLabels, pad_labels
from train.box_overlap import paired_iou, pairwise_iou
from train.detector.config import DetectionLossConfig
from train.detector.losses import detection_loss, objectness_error
from train.detector.targets import BatchLabels
from train.networks.compact import CompactDetector
from train.networks.yolo_head import YoloHead

PUBLISHED_LOSS = DetectionLossConfig("squared", "squared", box_weight=1.0)
LATER = 12_800
HEAD = YoloHead(4, 32, [(16, 16), (64, 32)], ["Car", "Van"])
COUNT = 2 * 2 * 3  # predictions of 2 anchors at 2 x 3 cells


def labels_of(*boxes, classes=None, ignored=()) -> BatchLabels:
    boxes_px = torch.tensor(boxes, dtype=torch.float32).reshape(-1, 4)
    count = len(boxes_px)
    is_ignored = torch.tensor([row in ignored for row in range(count)], dtype=torch.bool)
    indices = torch.tensor(classes or [0] * count, dtype=torch.long)
    return pad_labels([ImageLabels(boxes_px, indices, is_ignored)])


def zeros(batch=1):
    return torch.zeros(batch, 2, 7, 2, 3)


def loss_of(raw, labels, images_seen=LATER, **config):
    return detection_loss(raw, labels, HEAD, replace(PUBLISHED_LOSS, **config), images_seen)


def test_terms_of_a_box_already_right():
    # Zero raw numbers are anchors in the middle of their cells with an objectness of a half.
    loss = loss_of(zeros(), labels_of([8, 8, 24, 24]))
    assert loss.box.item() == 0
    assert loss.objects.item() == pytest.approx(5 * 0.5**2 / 2)
    assert loss.no_objects.item() == pytest.approx((COUNT - 1) * 0.5**2 / 2)
    assert loss.classes.item() == pytest.approx(math.log(2))
    assert loss.prior.item() == 0
    assert loss.total.item() == pytest.approx(sum(term.item() for term in loss[1:]))


def test_terms_of_a_box_that_is_off():
    # Centre (40, 52), 32 x 16: answers 16 x 16 around (48, 48) with a weight of 2 - 512 / 6144.
    loss = loss_of(zeros(), labels_of([24, 44, 56, 60]))
    squares = (0.25 - 0.5) ** 2 + (0.625 - 0.5) ** 2 + math.log(2) ** 2
    assert loss.box.item() == pytest.approx((2 - 512 / 6144) * squares / 2)
    # [40, 40, 56, 56] with [24, 44, 56, 60]: 16 x 12 in common.
    overlap = 192 / (256 + 512 - 192)
    assert loss.objects.item() == pytest.approx(5 * (overlap - 0.5) ** 2 / 2)


def test_a_prediction_on_a_label_is_free_to_say_so():
    # The label's centre lies in the next cell, yet anchor 1 of cell (0, 0) overlaps it by more than 0.6.
    label = labels_of([1, 0, 64, 32])
    loss = loss_of(zeros(), label)
    without = loss_of(zeros(), label, ignore_iou=1.0)
    shares = ops.box_iou(
        torch.tensor([[-16.0, 0, 48, 32], [16.0, 0, 80, 32]]), torch.tensor([[1.0, 0, 64, 32]])
    )
    assert shares[:, 0].tolist() == pytest.approx([47 / 80, 48 / 79])
    assert loss.no_objects == without.no_objects  # the one over 0.6 answers for the label
    freer = loss_of(zeros(), label, ignore_iou=0.5)
    assert (without.no_objects - freer.no_objects).item() == pytest.approx(0.5**2 / 2)


def test_ignored_areas_free_what_lies_in_them():
    # The right third: 2 cells of 2 anchors; the wide anchors lie half in it at most.
    loss = loss_of(zeros(), labels_of([64, 0, 96, 64], ignored=[0]))
    assert loss.objects.item() == 0
    assert loss.box.item() == 0
    assert loss.no_objects.item() == pytest.approx((COUNT - 2) * 0.5**2 / 2)


def test_the_first_images_pull_every_other_box_to_its_anchor():
    raw = zeros()
    raw[:, :, 2] = 1.0  # all e times too wide
    label = labels_of([8, 8, 24, 24])
    early, late = loss_of(raw, label, images_seen=12_799), loss_of(raw, label)
    assert early.prior.item() == pytest.approx(0.01 * (COUNT - 1) * 1 / 2, rel=1e-4)
    assert late.prior.item() == 0
    assert early.total - late.total == pytest.approx(early.prior.item(), abs=1e-5)


def test_the_gradient_of_a_published_square_is_the_difference():
    raw = zeros().requires_grad_()
    loss = loss_of(raw, labels_of([8, 8, 24, 24]))
    loss.total.backward()
    # 5 (σ - 1) σ' = 5 (-0.5) 0.25 where a label is, (σ - 0) σ' elsewhere; softmax less truth for the class.
    assert raw.grad[0, 0, 4, 0, 0].item() == pytest.approx(-0.625)
    assert raw.grad[0, 1, 4, 1, 2].item() == pytest.approx(0.125)
    assert raw.grad[0, 0, 5:, 0, 0].tolist() == pytest.approx([-0.5, 0.5])


def test_the_loss_of_a_batch_is_the_mean_of_its_images():
    generator = torch.Generator().manual_seed(0)
    raw = torch.randn(2, 2, 7, 2, 3, generator=generator)
    first = labels_of([8, 8, 24, 24], [40, 30, 90, 60], classes=[1, 0])
    second = labels_of([50, 8, 84, 34])
    both = pad_labels([ImageLabels(*(part[0] for part in one)) for one in (first, second)])
    together = loss_of(raw, both, images_seen=0)
    alone = [loss_of(raw[:1], first, images_seen=0), loss_of(raw[1:], second, images_seen=0)]
    for term, one, other in zip(together, *alone, strict=True):
        assert term.item() == pytest.approx((one.item() + other.item()) / 2, rel=1e-5)


def test_no_labels_ask_for_no_objects_alone():
    loss = loss_of(zeros(2), pad_labels([ImageLabels(*(part[0] for part in labels_of()))] * 2))
    assert loss.total.item() == pytest.approx(COUNT * 0.5**2 / 2)


def test_ciou_in_place_of_squares():
    label = labels_of([24, 44, 56, 60])
    # 16 x 16 and 32 x 16: an IoU of 1/3, centres (8, -4) apart within 32 x 20, aspects of 1 and 2.
    aspect = 4 / math.pi**2 * (math.atan(1) - math.atan(2)) ** 2
    distance = (8**2 + 4**2) / (32**2 + 20**2)
    complete = 1 / 3 - distance - aspect**2 / (1 - 1 / 3 + aspect)
    expected = (2 - 512 / 6144) * (1 - complete)
    assert loss_of(zeros(), label, box="ciou").box.item() == pytest.approx(expected, rel=1e-5)


def test_focal_loss_weighs_easy_cells_less():
    raw = zeros()
    raw[:, :, 4] = -4.0
    entropy = math.log1p(math.exp(-4))
    loss = loss_of(raw, labels_of(), objectness="focal")
    score = 1 / (1 + math.exp(4))
    assert loss.no_objects.item() == pytest.approx(COUNT * score**2 * entropy, rel=1e-4)


@pytest.mark.parametrize("is_label", [0.0, 1.0])
def test_focal_loss_of_certain_targets_is_that_of_torchvision(is_label):
    raw = zeros()
    raw[:, :, 4] = torch.linspace(-6, 6, COUNT).reshape(1, 2, 2, 3)
    target = torch.full((1, 2, 2, 3), is_label)
    expected = ops.sigmoid_focal_loss(raw[:, :, 4], target, alpha=-1, gamma=2)
    config = replace(PUBLISHED_LOSS, objectness="focal")
    found = objectness_error(raw[:, :, 4], target, config)
    torch.testing.assert_close(found, expected, rtol=1e-4, atol=1e-6)


def test_focal_loss_is_smallest_at_the_overlap_that_is_reached():
    logits = torch.linspace(-4, 4, 801)
    config = replace(PUBLISHED_LOSS, objectness="focal")
    errors = objectness_error(logits, torch.full_like(logits, 0.7), config)
    assert logits[errors.argmin()].sigmoid().item() == pytest.approx(0.7, abs=0.01)
    others = ops.sigmoid_focal_loss(logits, torch.full_like(logits, 0.7), alpha=-1, gamma=2)
    assert abs(logits[others.argmin()].sigmoid().item() - 0.7) > 0.05


def test_overlaps_by_hand():
    a, b = torch.tensor([[[0.0, 0, 4, 2]]]), torch.tensor([[[2.0, 0, 4, 4], [9.0, 9, 9, 9]]])
    assert pairwise_iou(a, b)[0, 0].tolist() == pytest.approx([4 / 12, 0])
    assert paired_iou(b[0], b[0]).tolist() == [1, 0]
    assert paired_iou(a[0, :0], b[0, :0]).tolist() == []


@pytest.mark.parametrize("box", ["squared", "ciou"])
@pytest.mark.parametrize("objectness", ["squared", "focal"])
@pytest.mark.parametrize("size", [0.0, 1.0, 30.0, 1000.0])
def test_gradients_are_finite_for_any_raw_numbers(box, objectness, size):
    generator = torch.Generator().manual_seed(0)
    raw = (size * torch.randn(2, 2, 7, 2, 3, generator=generator)).requires_grad_()
    image = ImageLabels(
        *(part[0] for part in labels_of([8, 8, 24, 24], [3, 3, 3, 9], [0, 0, 1, 1]))
    )
    loss = loss_of(raw, pad_labels([image, image]), images_seen=0, box=box, objectness=objectness)
    loss.total.backward()
    assert loss.total.isfinite()
    assert raw.grad.isfinite().all()


def test_half_precision_is_computed_in_full():
    raw, label = zeros().to(torch.bfloat16), labels_of([24, 44, 56, 60])
    assert loss_of(raw, label).total == loss_of(zeros(), label).total


@pytest.mark.parametrize(
    "config",
    [PUBLISHED_LOSS, replace(PUBLISHED_LOSS, box="ciou", objectness="focal")],
    ids=["published", "ciou, focal"],
)
def test_one_batch_is_learned_by_heart(config):
    torch.manual_seed(0)
    anchors_px = [(16.0, 12.0), (32.0, 20.0)]
    network = CompactDetector(
        ("Car",), anchors_px, channels=1, widths=(8, 16, 16, 16, 16), residuals=(1, 0, 0)
    )
    boxes = torch.tensor(
        [[[8.0, 20, 28, 32], [50, 10, 84, 34]], [[60, 30, 75, 42], [0, 0, 30, 22]]]
    )
    images = torch.zeros(2, 1, 64, 96)
    for picture, of_one in zip(images, boxes, strict=True):
        for x1, y1, x2, y2 in of_one.long().tolist():
            picture[0, y1:y2, x1:x2] = 200
    nothing = torch.zeros(2, dtype=torch.long)
    labels = pad_labels([ImageLabels(one, nothing, nothing.bool()) for one in boxes])
    optimizer = torch.optim.Adam(network.parameters())
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, 2e-2, total_steps=150)
    losses = []
    for _ in range(150):
        loss = detection_loss(network(images), labels, network.head, config, LATER).total
        losses.append(loss.item())
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
    assert losses[-1] < 0.2
    found = network.decode(network(images))
    best = found.scores[..., 0].topk(2).indices
    for image in range(2):
        overlaps = ops.box_iou(found.boxes_px[image, best[image]], boxes[image])
        assert overlaps.max(dim=0).values.min() > 0.85
