"""The default training ends where its error is least, whatever the order of the rows."""

import numpy as np
import pytest
import torch

from perception.detection.fusion.features import CLASSES
from tests.train.fusion.conftest import train_default
from train.fusion.network import NaiveBayes


def test_another_order_of_the_rows_leads_to_the_same_scores(fitted, tmp_path):
    other = train_default(tmp_path, "--seed_everything=7")
    rng = np.random.default_rng(0)
    scores = rng.uniform(0, 1, (200, 3)) * (rng.random((200, 3)) < 0.7)
    is_car = np.eye(len(CLASSES))[np.zeros(200, int)]
    rows = np.hstack([scores, np.ones((200, 3)), is_car])
    np.testing.assert_allclose(other.predict(rows), fitted.predict(rows), atol=1e-3)


def test_the_penalty_is_the_squared_distance_from_the_start():
    network = NaiveBayes()
    assert float(network.penalty()) == 0
    with torch.no_grad():
        network.offsets += 2.0
        network.log_slopes -= 1.0
    assert float(network.penalty()) == pytest.approx(1e-5 * (24 * 4 + 48), rel=1e-4)
