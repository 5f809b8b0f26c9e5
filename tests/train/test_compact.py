import pytest
import torch
from torch import nn

from train.networks.compact import CompactDetector
from train.networks.yolov2 import YOLOv2


def test_no_more_than_three_million_parameters():
    assert sum(part.numel() for part in CompactDetector().parameters()) == 2_540_590


def test_the_head_is_that_of_yolov2():
    with torch.device("meta"):
        assert type(CompactDetector().head) is type(YOLOv2().head)


@pytest.mark.parametrize(
    ("height", "width", "rows", "columns"),
    [(192, 640, 24, 80), (416, 416, 52, 52), (352, 1216, 44, 152)],
)
@pytest.mark.parametrize("channels", [1, 3])
def test_one_cell_is_eight_pixels(height, width, rows, columns, channels):
    with torch.device("meta"):
        network = CompactDetector(("Car", "Van"), channels=channels)
        raw = network(torch.empty(1, channels, height, width))
    assert raw.shape == (1, 5, 7, rows, columns)


def test_images_of_bytes_and_of_floats_are_the_same():
    network = CompactDetector(widths=(4, 4, 4, 4, 4)).eval()
    image = torch.randint(0, 256, (1, 3, 32, 64), dtype=torch.uint8)
    assert torch.equal(network(image), network(image.float()))


def test_a_batch_equals_its_images_one_by_one():
    network = CompactDetector(widths=(4, 4, 4, 4, 4)).eval()
    images = torch.randint(0, 256, (2, 3, 32, 64), dtype=torch.uint8)
    together = network.decode(network(images))
    alone = network.decode(network(images[1:]))
    assert torch.allclose(together.boxes_px[1], alone.boxes_px[0], atol=1e-3)
    assert torch.allclose(together.scores[1], alone.scores[0], atol=1e-6)


def test_only_what_integers_do_well():
    plain = nn.Conv2d | nn.BatchNorm2d | nn.ReLU | nn.Upsample
    leaves = [part for part in CompactDetector().modules() if not list(part.children())]
    assert all(isinstance(part, plain) for part in leaves)


def test_training_starts_from_seeing_little():
    bias = CompactDetector(("Car", "Van")).head.convolution.bias.detach().reshape(5, 7)
    assert bias[:, 4].sigmoid().tolist() == pytest.approx([0.02] * 5)
