import pytest
import torch
from torch import nn

from perception.errors import ModelError, UsageError
from tests.faults import fault
from train.networks.yolo_head import YoloHead
from train.networks.yolov2 import (
    VOC_ANCHORS_CELLS,
    Darknet19,
    YOLOv2,
    anchors_px,
    reorganise,
)

COCO_CLASSES = tuple(f"class {number}" for number in range(80))


def on_paper(*arguments, **config) -> YOLOv2:
    """Build the network without memory for its weights: shapes alone."""
    with torch.device("meta"):
        return YOLOv2(*arguments, **config)


def numbers(network: nn.Module) -> int:
    statistics = [buffer for name, buffer in network.named_buffers() if "running" in name]
    return sum(tensor.numel() for tensor in [*network.parameters(), *statistics])


def shapes_and_products(network: nn.Module, height: int, width: int):
    """Return the output shape of each convolution, and their multiplications in sum."""
    shapes, products = [], []

    def note(layer, _, maps):
        shapes.append(tuple(maps.shape[1:]))
        products.append(layer.weight.numel() * maps.shape[2] * maps.shape[3])

    for layer in network.modules():
        if isinstance(layer, nn.Conv2d):
            layer.register_forward_hook(note)
    network.eval()(torch.empty(1, 3, height, width, device="meta"))
    return shapes, sum(products)


def test_coco_network_has_the_numbers_of_the_published_file():
    # yolov2.weights is 203,934,260 bytes long, 16 of them its header.
    assert numbers(on_paper(COCO_CLASSES)) == (203_934_260 - 16) / 4


def test_backbone_has_the_numbers_of_the_published_file():
    # darknet19_448.conv.23 is 79,327,120 bytes long, 16 of them its header.
    assert numbers(Darknet19()) == (79_327_120 - 16) / 4


def test_coco_network_costs_what_is_published():
    # "62.94 Bn" operations at 608 x 608; a multiplication and an addition are two.
    network = on_paper(COCO_CLASSES)
    _, products = shapes_and_products(network, 608, 608)
    assert 2 * products / 1e9 == pytest.approx(62.94, abs=0.01)


def test_maps_have_the_published_sizes():
    shapes, _ = shapes_and_products(on_paper(COCO_CLASSES), 416, 416)
    assert len(shapes) == 18 + 5
    assert shapes[0] == (32, 416, 416)
    assert shapes[12] == (512, 26, 26)  # the fine map, layer 16 of the cfg
    assert shapes[17] == (1024, 13, 13)
    assert shapes[18] == (64, 26, 26)  # the passed map
    assert shapes[22] == (425, 13, 13)


@pytest.mark.parametrize(
    ("height", "width", "rows", "columns"),
    [(416, 416, 13, 13), (192, 640, 6, 20), (352, 1216, 11, 38)],
)
@pytest.mark.parametrize("channels", [1, 3])
def test_any_size_that_is_a_multiple_of_32(height, width, rows, columns, channels):
    network = on_paper(("Car", "Cyclist"), channels=channels)
    raw = network(torch.empty(2, channels, height, width, device="meta"))
    assert raw.shape == (2, 5, 7, rows, columns)


@pytest.mark.parametrize("shape", [(1, 3, 190, 640), (1, 1, 192, 640), (3, 192, 640)])
def test_images_of_another_shape_are_refused(shape):
    with fault(ModelError, expected="images (B, ", found="shape"):
        on_paper()(torch.empty(shape, device="meta"))


def test_reorganise_keeps_the_order_of_darknet():
    # Observed of Darknet itself: with 32 channels in, row 2, column 0 of channel 0 becomes channel 64.
    maps = torch.arange(32 * 26 * 26).reshape(1, 32, 26, 26)
    assert reorganise(maps)[0, 64, 0, 0] == maps[0, 0, 2, 0]


def test_reorganise_by_hand():
    # 4 maps of 2 x 2 are, in memory, one map of 4 x 4 with the numbers 0 to 15. Its 2 x 2 blocks begin at
    # 0, 2, 8, 10; four numbers of them make one map of 2 x 2 each, read as 16 maps of 1 x 1.
    maps = torch.arange(16.0).reshape(1, 4, 2, 2)
    expected = [0, 2, 8, 10, 1, 3, 9, 11, 4, 6, 12, 14, 5, 7, 13, 15]
    assert reorganise(maps).reshape(-1).tolist() == expected


def test_decoding_by_hand():
    head = YoloHead(4, 32, [(64, 48), (10, 20)], ["Car", "Van"])
    raw = torch.zeros(1, 2, 7, 2, 3)
    # Row 1, column 2, anchor 0: a quarter into the cell, twice as wide, half as high.
    raw[0, 0, :, 1, 2] = torch.tensor([-1.0986, 1.0986, 0.6931, -0.6931, 1.3863, 0.0, 1.0986])
    boxes_px, scores = head.decode(raw)
    assert boxes_px.shape == (1, 12, 4)
    assert scores.shape == (1, 12, 2)
    # σ(±1.0986) is 1/4 and 3/4: the centre is (2.25, 1.75) cells.
    expected = torch.tensor([72 - 64, 56 - 12, 72 + 64, 56 + 12.0])
    assert torch.allclose(boxes_px[0, 2 * (1 * 3 + 2)], expected, atol=1e-2)
    # σ(1.3863) = 0.8, shared 1 : 3.
    assert torch.allclose(scores[0, 10], torch.tensor([0.2, 0.6]), atol=1e-4)
    # All others: the anchor in the middle of its cell.
    assert torch.allclose(boxes_px[0, 1], torch.tensor([11.0, 6, 21, 26]))
    assert torch.allclose(scores[0, 1], torch.tensor([0.25, 0.25]))


def test_decoding_survives_any_number():
    head = YoloHead(4, 32, [(64, 48)], ["Car"])
    boxes_px, scores = head.decode(torch.full((1, 1, 6, 1, 1), 1e4))
    assert boxes_px.isfinite().all()
    assert scores.isfinite().all()


def test_anchors_of_a_cfg_are_cells_of_32_pixels():
    assert anchors_px(VOC_ANCHORS_CELLS)[0] == pytest.approx((42.3072, 55.4064))


@pytest.mark.parametrize(
    ("anchors", "classes", "expected"),
    [
        ([], ["Car"], "widths and heights over zero"),
        ([(8, 0)], ["Car"], "widths and heights over zero"),
        ([(8, 8)], [], "one or more different names"),
        ([(8, 8)], ["Car", "Car"], "one or more different names"),
    ],
)
def test_anchors_and_classes_that_cannot_be(anchors, classes, expected):
    with fault(UsageError, expected=expected):
        YoloHead(4, 32, anchors, classes)
