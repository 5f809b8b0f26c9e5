"""Weights that a detector starts with: Darknet's and torchvision's."""

from copy import deepcopy
from urllib.error import URLError

import pytest
import torch
from torch import nn
from torchvision import models

from perception.errors import ModelError
from tests.faults import fault
from tests.train.darknet_file import save_darknet_weights
from train.detector.darknet_weights import init_from_darknet
from train.networks.torchvision_detector import (
    TorchvisionDetector,
    TorchvisionTrunk,
    init_from_classifier,
)
from train.networks.yolo_detector import YoloDetector
from train.networks.yolo_head import YoloHead


class SmallTrunk(nn.Module):
    """In the order of YOLOv2: a backbone, and more."""

    def __init__(self) -> None:
        super().__init__()
        self.backbone = nn.Sequential(nn.Conv2d(3, 4, 3, bias=False), nn.BatchNorm2d(4))
        self.deep = nn.Conv2d(4, 4, 1)


def small_detector(class_names=("Car",), seed=0):
    torch.manual_seed(seed)
    return YoloDetector(3, SmallTrunk(), YoloHead(4, 32, [(16, 16)], class_names))


def parts_alike(a, b):
    names = [name for name, weight in a.state_dict().items() if weight.ndim > 1]
    return {n for n in names if torch.equal(a.state_dict()[n], b.state_dict()[n])} - {
        "head.anchors_px"
    }


BACKBONE, DEEP, HEAD = "trunk.backbone.0.weight", "trunk.deep.weight", "head.convolution.weight"


@pytest.mark.parametrize(
    ("content", "named", "alike"),
    [
        (lambda d: d, "detector", {BACKBONE, DEEP, HEAD}),
        (lambda d: small_detector(("Car", "Van", "Truck")), "trunk", {BACKBONE, DEEP}),
        (lambda d: d.trunk.backbone, "backbone", {BACKBONE}),
    ],
)
def test_darknet_fills_what_fits(tmp_path, content, named, alike):
    source, detector = small_detector(), small_detector(seed=1)
    save_darknet_weights(content(source), tmp_path / "some.weights")
    assert init_from_darknet(detector, tmp_path / "some.weights") == named
    assert parts_alike(detector, source) == alike


def test_a_file_too_short_for_the_backbone_is_refused(tmp_path):
    save_darknet_weights(nn.Conv2d(1, 1, 1), tmp_path / "short.weights")
    with fault(ModelError, expected="at least 124 numbers for this network", found="2"):
        init_from_darknet(small_detector(), tmp_path / "short.weights")


@pytest.fixture(scope="module")
def fresh():
    torch.manual_seed(4)
    return TorchvisionDetector("resnet18", ("Car", "Van"), channels=1)


@pytest.fixture
def detector(fresh):
    return deepcopy(fresh)


@pytest.fixture(scope="module")
def resnet_file(tmp_path_factory):
    torch.manual_seed(3)
    path = tmp_path_factory.mktemp("weights") / "resnet18.pth"
    torch.save(models.resnet18(weights=None).state_dict(), path)
    return path


def test_a_classifier_becomes_the_trunk(detector, resnet_file):
    init_from_classifier(detector, "resnet18", resnet_file)
    first = torch.load(resnet_file, weights_only=True)["conv1.weight"]
    torch.testing.assert_close(detector.trunk.maps.conv1.weight.detach(), first)
    raw = detector(torch.zeros(2, 1, 64, 96))
    assert raw.shape == (2, 5, 7, 8, 12)
    assert (raw.sigmoid()[:, :, 4].mean() - 0.02).abs() < 0.02


def test_a_map_goes_in_three_times(detector):
    trunk = detector.trunk.eval()
    maps = torch.rand(1, 1, 64, 64)
    torch.testing.assert_close(trunk(maps), trunk(maps.repeat(1, 3, 1, 1)))


def test_the_trunk_is_shown_what_imagenet_was(detector):
    trunk = detector.trunk.eval()
    shown = []
    trunk.maps.register_forward_pre_hook(lambda module, given: shown.append(given[0]))
    trunk(torch.full((1, 3, 64, 64), 0.5))
    mean = shown[0].mean(dim=(0, 2, 3)).tolist()
    assert mean == pytest.approx([0.015 / 0.229, 0.044 / 0.224, 0.094 / 0.225], rel=1e-5)


@pytest.mark.parametrize("name", ["vit_b_16", "squeezenet1_1"])
def test_classifiers_without_such_maps_are_refused(name):
    with fault(ModelError, f"{name}"):
        TorchvisionTrunk(name)


def test_weights_of_another_classifier_are_refused(detector, tmp_path):
    torch.save({"conv1.weight": torch.zeros(64, 3, 7, 7)}, tmp_path / "other.pth")
    with fault(ModelError, expected="weights of resnet18 that its maps need", found="1 of them"):
        init_from_classifier(detector, "resnet18", tmp_path / "other.pth")


def test_unreadable_weights_are_refused(detector, tmp_path):
    (tmp_path / "bad.pth").write_bytes(b"nothing")
    with fault(ModelError, found="a file that cannot be read"):
        init_from_classifier(detector, "resnet18", tmp_path / "bad.pth")
    with fault(ModelError, found="no such file"):
        init_from_classifier(detector, "resnet18", tmp_path / "none.pth")


def test_without_a_net_the_file_is_asked_for(detector, monkeypatch):
    def unreachable(*args, **config):
        raise URLError("no route to host")

    monkeypatch.setattr("torchvision.models._api.load_state_dict_from_url", unreachable)
    with fault(ModelError, advice="fetch the file elsewhere and give its path"):
        init_from_classifier(detector, "resnet18", "download")
