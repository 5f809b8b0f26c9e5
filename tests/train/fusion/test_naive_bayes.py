"""The default's network by hand: evidence adds up, and a box that is missing speaks against the object."""

import numpy as np
import pytest
import torch

from perception.errors import UsageError
from tests.faults import fault
from tests.train.fusion.toy_rows import LM, toy_words, train_toy
from train.fusion.network import NaiveBayes

ALL, NO_RM = [1.0, 1, 1], [1.0, 1, 0]
RGB_DM = 0b011  # the set of NO_RM: a bit for each modality
CAR, VAN = [1.0, 0, 0, 0, 0], [0, 1.0, 0, 0, 0]


def log_odds_of(network: NaiveBayes, *rows: list[float]) -> np.ndarray:
    with torch.no_grad():
        scores = network(torch.tensor(rows)).numpy()
    assert (scores == scores[:, :1]).all()
    return np.log(scores[:, 0] / (1 - scores[:, 0]))


def test_half_of_each_log_odds_adds_up_before_the_training():
    found = log_odds_of(NaiveBayes(), [0.8, 0.5, 0.9, *ALL, *CAR], [0.9, 0.9, 0.9, *ALL, *VAN])
    np.testing.assert_allclose(found, [np.log(4) / 2 + np.log(9) / 2, 1.5 * np.log(9)], rtol=1e-4)


def test_only_a_detector_that_ran_can_miss_a_box():
    found = log_odds_of(NaiveBayes(), [0.8, 0.5, 0, *ALL, *CAR], [0.8, 0.5, 0, *NO_RM, *CAR])
    np.testing.assert_allclose(found, [np.log(4) / 2 - 1, np.log(4) / 2], rtol=1e-4)


def test_offsets_are_of_modality_and_class():
    network = NaiveBayes()
    with torch.no_grad():
        network.prior[RGB_DM] = -1.0
        network.offsets[RGB_DM, 1] = 0.3
        network.class_offsets[RGB_DM, 1, 1] = 2.0
    rows = [[0.5, 0.5, 0, *NO_RM, *one] for one in (CAR, VAN)]
    np.testing.assert_allclose(log_odds_of(network, *rows), [-0.7, 1.3], rtol=1e-4)


def test_each_set_of_searched_modalities_has_weights_of_its_own():
    network = NaiveBayes()
    with torch.no_grad():
        network.log_slopes[RGB_DM, :, 1] = np.log(2.0)
    rows = [[0.8, 0.9, 0, *searched, *CAR] for searched in (ALL, NO_RM)]
    found = log_odds_of(network, *rows)
    np.testing.assert_allclose(
        found, [np.log(4) / 2 + np.log(9) / 2 - 1, np.log(4) / 2 + 2 * np.log(9)], rtol=1e-4
    )


@pytest.mark.parametrize("seed", range(3))
def test_a_higher_score_never_lowers_the_score(seed):
    torch.manual_seed(seed)
    network = NaiveBayes()
    for weights in network.parameters():
        torch.nn.init.normal_(weights)
    is_found = torch.rand(50, 3) < 0.5
    low = torch.rand(50, 3)
    high = low + (1 - low) * torch.rand(50, 3)
    flags = torch.hstack([torch.ones(50, 3), torch.eye(5)[torch.randint(5, (50,))]])
    scores = [network(torch.hstack([one * is_found, flags])) for one in (low, high)]
    assert (scores[1] >= scores[0]).all()


def test_levenberg_marquardt_needs_a_variant_of_the_thesis(tmp_path):
    with fault(UsageError, "--optimizer", "features and scores", "variant default"):
        train_toy(tmp_path, toy_words(LM, 1, "--model.variant=default"))
