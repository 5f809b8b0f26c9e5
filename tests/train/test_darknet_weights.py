import struct

import pytest
import torch
from torch import nn

from perception.errors import ModelError
from tests.faults import fault
from tests.train.darknet_file import HEADER, save_darknet_weights
from train.detector.darknet_weights import (
    DarknetHeader,
    load_darknet_weights,
    weight_slots,
)


def two_layers() -> nn.Sequential:
    """Two channels to one with batch norm, 1 x 2; then one to two with bias."""
    return nn.Sequential(
        nn.Conv2d(2, 1, (1, 2), bias=False), nn.BatchNorm2d(1), nn.LeakyReLU(), nn.Conv2d(1, 2, 1)
    )


OLD_HEADER = struct.pack("<3ii", 0, 1, 0, 70)
# bias, scale, mean, variance, 4 weights; 2 biases, 2 weights
NUMBERS = (0.5, 2.0, 3.0, 4.0, 11.0, 12.0, 13.0, 14.0, 21.0, 22.0, 31.0, 32.0)


def write(path, *parts):
    path.write_bytes(b"".join(parts))
    return path


def packed(numbers):
    return struct.pack(f"<{len(numbers)}f", *numbers)


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        (OLD_HEADER, DarknetHeader(0, 1, 0, 70)),
        (HEADER, DarknetHeader(0, 2, 5, 2**40)),
        (struct.pack("<3iQ", 1, 0, 0, 9), DarknetHeader(1, 0, 0, 9)),
        (struct.pack("<3ii", 0, 1001, 0, 9), DarknetHeader(0, 1001, 0, 9)),
    ],
    ids=["0.1", "0.2", "1.0", "very old"],
)
def test_a_file_built_by_hand(tmp_path, header, expected):
    network = two_layers()
    path = write(tmp_path / "hand.weights", header, packed(NUMBERS))
    assert load_darknet_weights(network, path) == expected
    first, norm, _, second = network
    assert norm.bias.item() == 0.5
    assert norm.weight.item() == 2.0
    assert norm.running_mean.item() == 3.0
    assert norm.running_var.item() == 4.0
    assert first.weight[0, :, 0].tolist() == [[11, 12], [13, 14]]
    assert second.bias.tolist() == [21, 22]
    assert second.weight[:, 0, 0, 0].tolist() == [31, 32]


def test_what_is_written_is_the_file_built_by_hand(tmp_path):
    network = two_layers()
    expected = write(tmp_path / "hand.weights", HEADER, packed(NUMBERS))
    load_darknet_weights(network, expected)
    save_darknet_weights(network, tmp_path / "ours.weights")
    assert (tmp_path / "ours.weights").read_bytes() == expected.read_bytes()


def test_a_filled_network_computes_what_the_file_says(tmp_path):
    network = two_layers().eval()
    load_darknet_weights(network, write(tmp_path / "hand.weights", OLD_HEADER, packed(NUMBERS)))
    image = torch.tensor([[[[1.0, 0]], [[0, 1]]]])
    # 11 + 14 = 25; (25 - 3) / sqrt(4) * 2 + 0.5 = 22.5; 22.5 * (31, 32) + (21, 22)
    assert torch.allclose(network(image).reshape(-1), torch.tensor([718.5, 742.0]), atol=1e-2)


def test_the_first_layers_alone(tmp_path):
    network = two_layers()
    path = write(tmp_path / "first.conv.1", OLD_HEADER, packed(NUMBERS[:8]))
    load_darknet_weights(network[:2], path)
    assert network[0].weight.flatten().tolist() == [11, 12, 13, 14]


def test_the_beginning_of_a_longer_file(tmp_path):
    network = two_layers()[:2]
    path = write(tmp_path / "whole.weights", OLD_HEADER, packed(NUMBERS))
    load_darknet_weights(network, path, is_prefix=True)
    assert network[0].weight.flatten().tolist() == [11, 12, 13, 14]


def test_round_trip_of_a_detector_keeps_every_number(tmp_path):
    from train.networks.compact import CompactDetector

    torch.manual_seed(0)
    source, target = (CompactDetector(widths=(4, 4, 4, 8, 8)) for _ in range(2))
    source(torch.randint(0, 256, (2, 3, 64, 64)))  # moves the running statistics
    save_darknet_weights(source, tmp_path / "compact.weights")
    load_darknet_weights(target, tmp_path / "compact.weights")
    for name, tensor in source.state_dict().items():
        if "num_batches_tracked" not in name:
            assert torch.equal(tensor, target.state_dict()[name]), name


def test_the_order_is_that_of_the_cfg():
    from train.networks.yolov2 import YOLOv2

    with torch.device("meta"):
        weights = [slot.shape for slot in weight_slots(YOLOv2()) if slot.ndim == 4]
    # Layers 24, 26 (behind the route to layer 16), 29 and 30 of yolov2.cfg.
    assert [tuple(shape) for shape in weights[-4:]] == [
        (1024, 1024, 3, 3),
        (64, 512, 1, 1),
        (1024, 1280, 3, 3),
        (30, 1024, 1, 1),
    ]


@pytest.mark.parametrize(
    ("content", "expected", "found"),
    [
        (b"", "a header of 16 bytes or more", "a file of 0"),
        (HEADER[:18], "a header of 16 bytes or more", "a file of 18"),
        (OLD_HEADER + packed(NUMBERS[:-1]), "12 numbers for this network", "11"),
        (OLD_HEADER + packed((*NUMBERS, 1)), "12 numbers for this network", "13"),
        (OLD_HEADER + packed(NUMBERS)[:-1], "12 numbers for this network", "11 and 3 bytes"),
        (OLD_HEADER + packed((*NUMBERS[:-1], float("nan"))), "finite numbers", "NaN"),
    ],
    ids=["empty", "half a header", "short", "long", "cut", "not finite"],
)
def test_other_files_are_refused_and_leave_the_weights(tmp_path, content, expected, found):
    network = two_layers()
    before = {name: tensor.clone() for name, tensor in network.state_dict().items()}
    with fault(ModelError, "other.weights", expected, found):
        load_darknet_weights(network, write(tmp_path / "other.weights", content))
    assert all(torch.equal(before[name], tensor) for name, tensor in network.state_dict().items())


def test_a_beginning_that_is_too_short_is_refused(tmp_path):
    path = write(tmp_path / "short.weights", OLD_HEADER, packed(NUMBERS[:5]))
    with fault(ModelError, expected="at least 8 numbers for this network", found="5"):
        load_darknet_weights(two_layers()[:2], path, is_prefix=True)


def test_a_missing_file_is_refused(tmp_path):
    with fault(ModelError, "none.weights", "a readable weight file"):
        load_darknet_weights(two_layers(), tmp_path / "none.weights")
