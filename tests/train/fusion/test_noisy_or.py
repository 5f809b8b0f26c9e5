"""The default's network by hand: a further modality adds, and never takes away."""

import numpy as np
import pytest
import torch

from perception.errors import UsageError
from tests.faults import fault
from tests.train.fusion.toy_rows import LM, toy_words, train_toy
from train.fusion.network import NoisyOr

CAR = [1.0, 0, 0, 0, 0]
VAN = [0, 1.0, 0, 0, 0]


def scores_of(network: NoisyOr, *rows: list[float]) -> np.ndarray:
    with torch.no_grad():
        return network(torch.tensor(rows)).numpy()


def test_untrained_it_is_the_probability_that_not_all_are_wrong():
    found = scores_of(NoisyOr(), [0.8, 0.5, 0.0, *CAR], [0.0, 0.3, 0.0, *VAN])
    np.testing.assert_allclose(found, [[0.9] * 3, [0.3] * 3], rtol=1e-5)


def test_offsets_are_of_modality_and_class():
    network = NoisyOr()
    with torch.no_grad():
        network.offsets[1] = -np.log(4)  # odds of 1 become 1/4
        network.class_offsets[1, 1] = np.log(8)
    found = scores_of(network, [0.5, 0.5, 0, *CAR], [0.5, 0.5, 0, *VAN], [0.5, 0, 0, *VAN])
    np.testing.assert_allclose(found[:, 0], [1 - 0.5 * 0.8, 1 - 0.5 / 3, 0.5], rtol=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_a_higher_score_or_a_further_box_never_lowers_the_score(seed):
    torch.manual_seed(seed)
    network = NoisyOr()
    for weights in network.parameters():
        torch.nn.init.normal_(weights)
    low = torch.rand(50, 3) * (torch.rand(50, 3) < 0.5)
    high = low + (1 - low) * torch.rand(50, 3)
    flags = torch.eye(5)[torch.randint(5, (50,))]
    scores = [network(torch.hstack([one, flags])) for one in (low, high)]
    assert (scores[1] >= scores[0]).all()


def test_levenberg_marquardt_needs_a_variant_of_the_thesis(tmp_path):
    with fault(UsageError, "--optimizer", "features and scores", "variant default"):
        train_toy(tmp_path, toy_words(LM, 1, "--model.variant=default"))
