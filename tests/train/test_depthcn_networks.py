"""The two verifiers: sizes by hand, what they see, and that they say where boxes are."""

import numpy as np
import pytest
import torch

from perception.errors import ModelError, UsageError
from tests.faults import fault
from train.networks.depthcn import (
    VERIFIER_INPUTS,
    DefaultVerifier,
    RelativeDepthEncoding,
    ThesisVerifier,
    load_verifier,
    make_verifier,
    object_logits,
)


def crops_of(count: int, channels: int, seed: int = 0) -> torch.Tensor:
    random = np.random.default_rng(seed)
    return torch.from_numpy(random.integers(0, 256, (count, channels, 66, 112), dtype=np.uint8))


WINDOWS_PX = torch.tensor([[100.0, 50.0, 300.0, 150.0], [-20.0, 10.0, 92.0, 76.0]])


def test_the_thesis_maps_have_the_sizes_of_fig_6_5():
    maps, sizes = crops_of(2, 1).float(), []
    for layer in ThesisVerifier().features:
        maps = layer(maps)
        sizes.append(tuple(maps.shape[1:]))
    assert sizes == [
        (32, 66, 112),
        (32, 66, 112),
        (32, 32, 55),
        (64, 32, 55),
        (64, 32, 55),
        (64, 15, 27),
    ]


def test_the_thesis_network_has_the_weights_of_fig_6_5():
    first = 5 * 5 * 1 * 32 + 32
    second = 5 * 5 * 32 * 64 + 64
    full = 25_920 * 64 + 64
    last = 64 * 2 + 2
    counted = sum(weights.numel() for weights in ThesisVerifier().parameters())
    assert counted == first + second + full + last == 1_711_170


def test_the_thesis_network_drops_half_before_its_last_layer():
    layers = list(ThesisVerifier().classifier)
    assert isinstance(layers[-2], torch.nn.Dropout)
    assert layers[-2].p == 0.5


def test_another_dropout_may_be_asked_for():
    def dropped(network):
        return [layer.p for layer in network.modules() if isinstance(layer, torch.nn.Dropout)]

    assert dropped(make_verifier("thesis", 0.0)) == [0.0]
    assert dropped(make_verifier("default", 0.4)) == [0.4]
    assert dropped(make_verifier("default")) == [0.2]
    with fault(UsageError, "dropout", "a fraction from 0 to below 1", "1"):
        make_verifier("thesis", 1.0)


def test_one_logit_says_what_the_softmax_of_two_says():
    network = make_verifier("thesis").eval()
    crops = crops_of(3, 1)
    classes = network.classifier(network.features(crops.float()))
    logits, _ = network.heads(crops)
    torch.testing.assert_close(logits.sigmoid(), classes.softmax(dim=1)[:, 1])


def test_the_thesis_network_subtracts_the_mean_image():
    network = ThesisVerifier().eval()
    crops = crops_of(1, 1)
    network.mean_image.copy_(crops[0])
    biases_alone = network.heads(crops)[0]
    network.mean_image.zero_()
    torch.testing.assert_close(network.heads(torch.zeros_like(crops))[0], biases_alone)


def test_the_thesis_box_is_the_window():
    _, boxes_px = make_verifier("thesis").eval()(crops_of(2, 1), WINDOWS_PX)
    assert torch.equal(boxes_px, WINDOWS_PX)


def test_the_default_network_is_light():
    counted = sum(weights.numel() for weights in DefaultVerifier().parameters())
    assert 300_000 < counted < 500_000


def test_the_default_box_is_a_share_of_the_window():
    network = DefaultVerifier().eval()
    with torch.no_grad():
        network.box.weight.zero_()
        network.box.bias.copy_(torch.tensor([0.25, 0.5, 0.75, 1.25]))
    _, boxes_px = network(crops_of(2, 3), WINDOWS_PX)
    expected = torch.tensor([[150.0, 100.0, 250.0, 175.0], [8.0, 43.0, 64.0, 92.5]])
    torch.testing.assert_close(boxes_px, expected)


@pytest.mark.parametrize("method", ["default", "thesis"])
def test_bytes_and_floats_have_the_same_score(method):
    network = make_verifier(method).eval()
    crops = crops_of(2, len(VERIFIER_INPUTS[method].channels))
    for of_bytes, of_numbers in zip(
        network(crops, WINDOWS_PX), network(crops.float(), WINDOWS_PX), strict=True
    ):
        assert torch.equal(of_bytes, of_numbers)


@pytest.mark.parametrize("method", ["default", "thesis"])
def test_a_frame_without_proposals_has_no_boxes(method):
    network = make_verifier(method).eval()
    crops = crops_of(0, len(VERIFIER_INPUTS[method].channels))
    logits, boxes_px = network(crops, torch.zeros(0, 4))
    assert logits.shape == (0,)
    assert boxes_px.shape == (0, 4)


def test_a_crop_has_the_same_score_in_any_batch():
    network = DefaultVerifier().eval()
    crops = crops_of(4, 3)
    together, _ = network.heads(crops)
    alone = torch.cat([network.heads(crop[None])[0] for crop in crops])
    torch.testing.assert_close(together, alone, rtol=1e-4, atol=1e-6)


def test_depth_becomes_meters_behind_the_proposal():
    # (6.2): 10 m, 10.5 m and 40 m of 5..80 m; heights of 128 say that it is known.
    encoded = [round(255 * 80 * (z - 5) / (75 * z)) for z in (10.0, 10.5, 40.0)]
    crop = torch.full((1, 3, 66, 112), 128.0)
    crop[:, 0] = encoded[0]
    crop[:, 0, 0, 0], crop[:, 0, 0, 1] = encoded[1], encoded[2]
    crop[:, :, 0, 2] = 0
    crop[:, :, 40, 50] = 0  # unknown in the middle: leaves the mean as it is
    channels, distance = RelativeDepthEncoding()(crop)
    assert distance.item() == pytest.approx(10 / 80, rel=0.01)
    behind = channels[0, 0]
    assert behind[0, 0].item() == pytest.approx(0.5 / 8, abs=0.01)
    # By the slope at 10 m: what lies far behind comes out nearer, 10 (1 - 10 / 40) m.
    assert behind[0, 1].item() == pytest.approx(7.5 / 8, abs=0.01)
    assert behind[40, 55].item() == pytest.approx(0, abs=1e-5)
    assert channels[0, :, 0, 2].tolist() == [-1, -1, -1]
    assert channels[0, 1, 40, 55].item() == pytest.approx(128 / 127.5 - 1, abs=1e-6)


def test_a_crop_without_known_depth_stays_finite():
    channels, distance = RelativeDepthEncoding()(torch.zeros(2, 3, 66, 112, dtype=torch.uint8))
    assert torch.isfinite(channels).all()
    assert distance.flatten().tolist() == pytest.approx([5 / 80, 5 / 80])


def saved(path, method):
    network = make_verifier(method)
    hyper_parameters = {"model": "depthcn", "method": method, "classes": ["Car"]}
    hyper_parameters["training_data"] = "two streets"
    weights = {f"network.{name}": w for name, w in network.state_dict().items()}
    torch.save({"state_dict": weights, "hyper_parameters": hyper_parameters, "epoch": 4}, path)
    return network.eval()


@pytest.mark.parametrize("method", ["default", "thesis"])
def test_a_checkpoint_gives_the_network_back(tmp_path, method):
    written = saved(tmp_path / "best.ckpt", method)
    network, hyper_parameters = load_verifier(tmp_path / "best.ckpt")
    crops = crops_of(2, len(VERIFIER_INPUTS[method].channels))
    assert torch.equal(network(crops, WINDOWS_PX)[0], written(crops, WINDOWS_PX)[0])
    assert hyper_parameters["method"] == method
    assert hyper_parameters["window"] == {"default": "metric", "thesis": "box"}[method]
    assert (
        hyper_parameters["channels"]
        == {"default": "depth,height,reflectance", "thesis": "depth"}[method]
    )
    assert (hyper_parameters["training_data"], hyper_parameters["epochs"]) == ("two streets", "5")
    assert not network.training


def test_a_checkpoint_of_other_sizes_is_named(tmp_path):
    saved(tmp_path / "best.ckpt", "default")
    content = torch.load(tmp_path / "best.ckpt", weights_only=True)
    content["hyper_parameters"]["method"] = "thesis"
    torch.save(content, tmp_path / "best.ckpt")
    with fault(ModelError, "best.ckpt", "weights of this depthcn", "weights of other sizes"):
        load_verifier(tmp_path / "best.ckpt")


def test_several_classes_have_a_logit_each():
    network = make_verifier("default", class_count=3).eval()
    logits, boxes_px = network(crops_of(2, 3), WINDOWS_PX)
    assert (logits.shape, boxes_px.shape) == ((2, 3), (2, 4))
    assert torch.equal(object_logits(logits), logits.max(dim=1).values)


@pytest.mark.parametrize(("method", "count"), [("thesis", 2), ("default", 0)])
def test_classes_that_a_network_cannot_tell_apart(method, count):
    with fault(UsageError, where=f"classes of {method}", found=f"{count} classes"):
        make_verifier(method, class_count=count)
