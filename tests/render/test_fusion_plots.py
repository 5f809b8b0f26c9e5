"""Figures of the fusion: written, with what they promise to show."""

import numpy as np
import pytest

from perception.evaluation.detection.reliability import Reliability
from perception.render.fusion_plots import plot_reliability, plot_rescoring, plot_sizes


@pytest.fixture
def path(tmp_path):
    return tmp_path / "made" / "figure.png"


def test_the_surfaces_of_rescoring(path):
    levels = np.linspace(0, 1, 4)
    plot_rescoring(
        path, "Joint rescoring", levels, np.random.default_rng(0).uniform(size=(4,) * 3 + (3,))
    )
    assert path.stat().st_size > 10_000


@pytest.mark.parametrize(
    ("one", "two"),
    [
        ({5: (0.02, 0.03), 10: (0.01, 0.02)}, {}),
        ({}, {(4, 2): 0.02, (6, 2): 0.01, (6, 4): 0.03}),
        ({5: (0.02, 0.03)}, {(4, 2): 0.02}),
    ],
)
def test_the_sizes_of_networks(path, one, two):
    plot_sizes(path, "Neurons", one, two)
    assert path.stat().st_size > 5_000


def test_reliability(path):
    found = Reliability(np.array([0.2, 0.8]), np.array([0.1, 0.9]), np.array([10, 40]))
    none = Reliability(np.zeros(0), np.zeros(0), np.zeros(0, int))
    plot_reliability(path, "Scores", {"fusion": found, "nothing": none})
    assert path.stat().st_size > 5_000
