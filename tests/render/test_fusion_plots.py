"""Figures of the fusion: written, with what they promise to show."""

import numpy as np
import pytest

from perception.evaluation.detection.reliability import Reliability
from perception.render.figure import save_figure
from perception.render.fusion_plots import reliability_figure, rescoring_figure, sizes_figure


@pytest.fixture
def path(tmp_path):
    return tmp_path / "made" / "figure.png"


def test_the_surfaces_of_rescoring(path):
    levels = np.linspace(0, 1, 4)
    overlaps = np.random.default_rng(0).uniform(size=(4,) * 3 + (3,))
    save_figure(rescoring_figure("Joint rescoring", levels, overlaps), path)
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
    save_figure(sizes_figure("Neurons", one, two), path)
    assert path.stat().st_size > 5_000


def test_reliability(path):
    found = Reliability(np.array([0.2, 0.8]), np.array([0.1, 0.9]), np.array([10, 40]))
    none = Reliability(np.zeros(0), np.zeros(0), np.zeros(0, int))
    save_figure(reliability_figure("Scores", {"fusion": found, "nothing": none}), path)
    assert path.stat().st_size > 5_000
