"""The fusion's network by Levenberg-Marquardt, until what was kept back says that it is enough."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Self

import torch

from perception.geometry.threads import limit_blas_threads
from perception.types import Float64
from train.fusion.config import FusionSets, FusionTrainingConfig
from train.fusion.levenberg_marquardt import LevenbergMarquardtStep, levenberg_marquardt_steps
from train.fusion.mlp_least_squares import MlpLeastSquares


@dataclass(frozen=True)
class BestFit:
    """Where the error on what was kept back was lowest."""

    step: int
    parameters: Float64
    training: float
    validation: float


@dataclass(frozen=True)
class LevenbergMarquardtState:
    """How far a descent is: all that it takes to go on."""

    last: LevenbergMarquardtStep
    best: BestFit

    @property
    def state(self) -> dict[str, dict[str, Any]]:
        """What a checkpoint keeps of it."""
        return {
            name: {**vars(place), "parameters": torch.from_numpy(place.parameters)}
            for name, place in vars(self).items()
        }

    @classmethod
    def from_dict(cls, state: dict[str, dict[str, Any]]) -> Self:
        """Read what a checkpoint keeps."""
        last, best = (
            {**state[name], "parameters": state[name]["parameters"].numpy()}
            for name in ("last", "best")
        )
        return cls(LevenbergMarquardtStep(**last), BestFit(**best))


def fit_levenberg_marquardt(
    sets: FusionSets,
    config: FusionTrainingConfig,
    watch: Callable[[LevenbergMarquardtState, float], None] | None = None,
    resumed_state: LevenbergMarquardtState | None = None,
) -> BestFit:
    """Go down by Levenberg-Marquardt until what was kept back says that it is enough.

    Args:
        sets: combinations.
        config: the network, and when to stop.
        watch: is told of each step and of its error on what was kept back.
        resumed_state: a descent to go on with, from its last step.
    """
    network = config.initial_network(sets.training)
    problem, validation_problem = (
        MlpLeastSquares(network, sets.training),
        MlpLeastSquares(network, sets.validation),
    )
    best = None if resumed_state is None else resumed_state.best
    start, damping, first = problem.start, config.damping, 0
    if resumed_state is not None:
        start, first = resumed_state.last.parameters, resumed_state.last.number
        damping = replace(damping, first=resumed_state.last.damping)
    with limit_blas_threads():
        for step in levenberg_marquardt_steps(problem, start, damping, first):
            error = validation_problem.mean_square(step.parameters)
            if best is None or error < best.validation:
                best = BestFit(step.number, step.parameters, step.mean_square, error)
            if watch is not None:
                watch(LevenbergMarquardtState(step, best), error)
            if step.number - best.step >= config.checks:
                break
    assert best is not None  # the start is one
    return best
