"""Sweep of the sizes of the fusion's network: training and validation error over neurons (Fig. 7.13)."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace

from tqdm import tqdm

from train.fusion.config import FusionTrainingConfig
from train.fusion.fit_lm import fit_levenberg_marquardt
from train.fusion.targets import FusionSets

Hidden = tuple[int, ...]


@dataclass(frozen=True)
class SweptSize:
    """Errors of one network.

    Attributes:
        hidden: Neurons of each hidden layer.
        training: Mean square training error at the lowest validation error.
        validation: Lowest mean square validation error.
    """

    hidden: Hidden
    training: float
    validation: float


def hidden_sizes(one: Sequence[int], two: Sequence[int]) -> list[Hidden]:
    """Return networks of one layer, and those of two of which the second is the smaller."""
    pairs = [(first, second) for first in two for second in two if second < first]
    return [*((size,) for size in one), *pairs]


def sweep(
    sets: FusionSets,
    config: FusionTrainingConfig,
    sizes: Sequence[Hidden],
) -> list[SweptSize]:
    """Fit a network of each size by Levenberg-Marquardt, all from the same seed."""
    swept = []
    for hidden in tqdm(sizes, "sizes", unit="network", file=sys.stderr, delay=2):
        best = fit_levenberg_marquardt(sets, replace(config, hidden=hidden))
        swept.append(SweptSize(hidden, best.training, best.validation))
    return swept
