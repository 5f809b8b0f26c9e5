import math

import pytest
import torch

from perception.errors import UsageError
from tests.faults import fault
from tests.train.image_labels import ImageLabels, pad_labels
from train.detector.config import DistillationConfig
from train.detector.distillation import Distillation, distance
from train.networks.compact import CompactDetector
from train.networks.yolo_head import DecodedBoxes
from train.networks.yolox import YoloxNano

BOX = [8.0, 8.0, 24.0, 24.0]
IMAGES = torch.full((1, 3, 64, 64), 90.0)


def predictions(*scores, boxes_px=None):
    """Return predictions of one image and class, each the same box or one of these."""
    boxes_px = torch.tensor([boxes_px or [BOX] * len(scores)])
    return DecodedBoxes(boxes_px, torch.tensor(scores)[None, :, None])


def labels_of(*boxes, ignored=False):
    count = len(boxes)
    boxes_px = torch.tensor(boxes, dtype=torch.float32).reshape(-1, 4)
    is_ignored = torch.full((count,), ignored)
    return pad_labels([ImageLabels(boxes_px, torch.zeros(count, dtype=torch.long), is_ignored)])


EVERY = torch.ones(1, 2, dtype=torch.bool)


def test_equal_predictions_have_no_distance():
    same = predictions(0.2, 0.7)
    assert distance(same, same, EVERY).item() == pytest.approx(0, abs=1e-6)


def test_distance_of_scores_by_hand():
    found = distance(predictions(0.5, 0.7), predictions(0.8, 0.7), EVERY)
    relative_entropy = 0.8 * math.log(0.8 / 0.5) + 0.2 * math.log(0.2 / 0.5)
    assert found.item() == pytest.approx(relative_entropy / 1.5)


def test_distance_of_boxes_by_hand():
    half = [8.0, 8.0, 24.0, 16.0]
    found = distance(predictions(0.5, 0.7, boxes_px=[half, BOX]), predictions(0.5, 0.7), EVERY)
    assert found.item() == pytest.approx(0.5**2 * (1 - 0.5) / 1.2)


def test_what_does_not_count_has_no_distance():
    first = torch.tensor([[False, True]])
    assert distance(predictions(0.1, 0.7), predictions(0.9, 0.7), first).item() == pytest.approx(0)


@pytest.mark.parametrize("make", [YoloxNano, lambda: CompactDetector(widths=(4, 4, 4, 4, 4))])
def test_every_network_is_kept_by_its_own_start(make):
    torch.manual_seed(0)
    network = make().eval()
    distillation = Distillation(network, DistillationConfig(weight=2.0))
    nothing = labels_of()

    def loss():
        return distillation.loss(IMAGES, network.decode(network(IMAGES)), nothing)

    assert loss().item() == pytest.approx(0, abs=1e-4)
    with torch.no_grad():
        for weight in network.head.parameters():
            weight.add_(0.1)
    changed = loss()
    assert changed.item() > 0.001
    changed.backward()
    assert all(weight.grad is not None for weight in network.head.parameters())


@pytest.mark.parametrize("ignored", [False, True])
def test_labels_say_more_than_the_start(ignored):
    network = YoloxNano().eval()
    distillation = Distillation(network, DistillationConfig(weight=1.0, max_iou=0))
    learned = network.decode(network(IMAGES))
    worse = learned._replace(scores=learned.scores * 0 + 0.5)
    everywhere = labels_of([-1000, -1000, 1000, 1000], ignored=ignored)
    assert distillation.loss(IMAGES, worse, everywhere).item() == 0
    assert distillation.loss(IMAGES, worse, labels_of()).item() > 0


def test_without_weight_the_loss_is_zero():
    network = YoloxNano()
    found = Distillation(network, DistillationConfig()).loss(
        IMAGES, network.decode(network(IMAGES)), labels_of()
    )
    assert found.item() == 0


@pytest.mark.parametrize("values", [{"weight": -1.0}, {"max_iou": 1.5}])
def test_ranges_are_validated(values):
    with fault(UsageError, "distillation", "a weight of at least 0"):
        DistillationConfig(**values)
