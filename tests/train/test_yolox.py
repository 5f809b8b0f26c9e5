import math

import pytest
import torch

from perception.errors import UsageError
from tests.faults import fault
from train.networks.yolox import STRIDES_PX, YoloxHead, YoloxNano, cells


def test_as_many_numbers_as_the_public_network():
    # 80 classes; 0.91 M of them are published (arXiv 2107.08430, table 5).
    with torch.device("meta"):
        network = YoloxNano([str(number) for number in range(80)])
    assert sum(part.numel() for part in network.parameters()) == 904_463


@pytest.mark.parametrize(("height", "width"), [(64, 96), (288, 960)])
@pytest.mark.parametrize("channels", [1, 3])
def test_a_cell_at_each_stride(height, width, channels):
    with torch.device("meta"):
        raw = YoloxNano(("Car", "Van"), channels)(torch.empty(2, channels, height, width))
    shapes = [(2, 7, height // stride_px, width // stride_px) for stride_px in STRIDES_PX]
    assert [tuple(maps.shape) for maps in raw] == shapes


def test_a_batch_equals_its_images_one_by_one():
    network = YoloxNano(("Car", "Van")).eval()
    images = torch.randint(0, 256, (2, 3, 64, 96), dtype=torch.uint8)
    together = network.decode(network(images))
    alone = network.decode(network(images[1:]))
    assert torch.allclose(together.boxes_px[1], alone.boxes_px[0], atol=1e-3)
    assert torch.allclose(together.scores[1], alone.scores[0], atol=1e-6)


def test_training_starts_from_seeing_little():
    decoded = YoloxNano(("Car",)).eval()
    scores = decoded.decode(decoded(torch.zeros(1, 3, 64, 64))).scores
    assert 0 < scores.max().item() < 0.001


def raw_maps(rows=2, columns=3):
    """Return raw predictions of an input of 64 x 96 pixels for two classes, all 0."""
    sizes = [(rows * 32 // stride_px, columns * 32 // stride_px) for stride_px in STRIDES_PX]
    return tuple(torch.zeros(1, 7, *size) for size in sizes)


def test_boxes_and_scores_by_hand():
    raw = raw_maps()
    raw[1][0, :, 1, 2] = torch.tensor([0.25, 0.5, math.log(3), math.log(2), 1.0, -1.0, 2.0])
    decoded = YoloxHead(("Car", "Van")).decode(raw)
    cell = 8 * 12 + 6 + 2  # behind the 8 x 12 of the first stride, row 1 of 6, column 2
    # Centre (2.25, 1.5) x 16 px, 48 x 32 px.
    assert decoded.boxes_px[0, cell].tolist() == pytest.approx([12, 8, 60, 40])
    sigmoid = [1 / (1 + math.exp(-value)) for value in (1.0, -1.0, 2.0)]
    expected = [sigmoid[0] * sigmoid[1], sigmoid[0] * sigmoid[2]]
    assert decoded.scores[0, cell].tolist() == pytest.approx(expected)


def test_cells_lie_row_by_row_stride_by_stride():
    corners, strides_px = cells(raw_maps())
    assert corners[[0, 1, 12, 96, 96 + 24]].tolist() == [[0, 0], [1, 0], [0, 1], [0, 0], [0, 0]]
    assert strides_px[[0, 95, 96, 119, 120, 125], 0].tolist() == [8, 8, 16, 16, 32, 32]


@pytest.mark.parametrize("names", [(), ("Car", "Car")])
def test_classes_are_named_once(names):
    with fault(UsageError, "classes", "one or more different names"):
        YoloxNano(names)
