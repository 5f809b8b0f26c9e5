"""Checkpoints as training writes them, of networks that have learned nothing."""

import numpy as np
import pytest
import torch

from export.depthcn import random_inputs
from train.networks.depthcn import VERIFIER_INPUTS, make_verifier


def spread(verifier, crops):
    """Draw weights so that the scores of such crops lie anywhere between 0 and 1."""
    torch.manual_seed(0)
    for layer in verifier.modules():
        if isinstance(layer, torch.nn.Conv2d | torch.nn.Linear):
            torch.nn.init.kaiming_normal_(layer.weight)
    for _ in range(10):
        verifier.train()(crops, torch.zeros(len(crops), 4))
    logits = verifier.eval().heads(crops)[0]
    last = verifier.vehicle if hasattr(verifier, "vehicle") else verifier.classifier[-1]
    last.weight *= 2 / logits.std()
    last.bias[-1] -= 2 * logits.mean() / logits.std()


def checkpoint_of(method):
    verifier = make_verifier(method)
    planes = len(VERIFIER_INPUTS[method].channels)
    crops = random_inputs(planes, 16, np.random.default_rng(0))["crops"]
    with torch.no_grad():
        spread(verifier, torch.from_numpy(crops))
    return {
        "epoch": 39,
        "hyper_parameters": {
            "model": "depthcn",
            "method": method,
            "classes": ["Car"],
            "training_data": "two streets",
            "revision": "0123abc",
        },
        "state_dict": {f"network.{name}": weight for name, weight in verifier.state_dict().items()},
    }


@pytest.fixture(scope="session", params=["default", "thesis"])
def checkpoint(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("checkpoints") / f"{request.param}.ckpt"
    torch.save(checkpoint_of(request.param), path)
    return path


@pytest.fixture(scope="session")
def thesis_checkpoint(tmp_path_factory):
    """Of the network that is exported faster."""
    path = tmp_path_factory.mktemp("checkpoints") / "last.ckpt"
    torch.save(checkpoint_of("thesis"), path)
    return path
