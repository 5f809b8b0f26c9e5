"""Levenberg-Marquardt of the fusion's network, stopped early by the validation error."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Self

import torch

from perception.geometry.threads import limit_blas_threads
from perception.types import Float64
from train.fusion.config import FusionTrainingConfig
from train.fusion.levenberg_marquardt import LevenbergMarquardtStep, levenberg_marquardt_steps
from train.fusion.mlp import initial_network
from train.fusion.mlp_least_squares import MlpLeastSquares
from train.fusion.targets import FusionSets


@dataclass(frozen=True)
class BestFit:
    """Parameters of the lowest validation error.

    Attributes:
        step: Number of the step.
        parameters: (P,) parameters.
        training: Mean square error of the training rows.
        validation: Mean square error of the validation rows.
    """

    step: int
    parameters: Float64
    training: float
    validation: float


@dataclass(frozen=True)
class LevenbergMarquardtState:
    """State of a fit from which it can be resumed.

    Attributes:
        last: Last step.
        best: Parameters of the lowest validation error.
    """

    last: LevenbergMarquardtStep
    best: BestFit

    @property
    def as_dict(self) -> dict[str, dict[str, Any]]:
        """State as a checkpoint stores it."""
        return {
            name: {**vars(part), "parameters": torch.from_numpy(part.parameters)}
            for name, part in vars(self).items()
        }

    @classmethod
    def from_dict(cls, state: dict[str, dict[str, Any]]) -> Self:
        """Return the state that a checkpoint stores."""
        last, best = (
            {**state[name], "parameters": state[name]["parameters"].numpy()}
            for name in ("last", "best")
        )
        return cls(LevenbergMarquardtStep(**last), BestFit(**best))


def fit_levenberg_marquardt(
    sets: FusionSets,
    config: FusionTrainingConfig,
    callback: Callable[[LevenbergMarquardtState, float], None] | None = None,
    resumed_state: LevenbergMarquardtState | None = None,
) -> BestFit:
    """Fit a network by Levenberg-Marquardt until the validation error stops falling.

    Args:
        sets: Combinations for training and validation.
        config: Network, damping and stopping criteria.
        callback: Function called with the state and the validation error after each step.
        resumed_state: State of a fit to continue.
    """
    network = initial_network(config, sets.training.features)
    problem, validation_problem = (
        MlpLeastSquares(network, sets.training),
        MlpLeastSquares(network, sets.validation),
    )
    best = None if resumed_state is None else resumed_state.best
    start, lm, first = problem.start, config.lm, 0
    if resumed_state is not None:
        start, first = resumed_state.last.parameters, resumed_state.last.number
        lm = replace(lm, initial_damping=resumed_state.last.damping)
    with limit_blas_threads():
        for step in levenberg_marquardt_steps(problem, start, lm, first):
            error = validation_problem.mean_square(step.parameters)
            if best is None or error < best.validation:
                best = BestFit(step.number, step.parameters, step.mean_square, error)
            if callback is not None:
                callback(LevenbergMarquardtState(step, best), error)
            if step.number - best.step >= config.lm.patience:
                break
    assert best is not None  # the start was evaluated
    return best
