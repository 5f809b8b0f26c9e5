"""Levenberg-Marquardt: between Gauss-Newton and steepest descent, by an adaptive damping.

D. W. Marquardt, "An algorithm for least-squares estimation of nonlinear parameters", 1963; M. T. Hagan,
M. B. Menhaj, "Training feedforward networks with the Marquardt algorithm", 1994. The damping's numbers are
those of MATLAB's trainlm, by which the thesis' networks were trained (7.2.2).

    (JᵀJ + μ I) step = -Jᵀr        over means of the rows, so that μ means the same for few and for many
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from perception.types import Float64
from train.fusion.config import LevenbergMarquardtConfig

_CONFIG = LevenbergMarquardtConfig()


@dataclass(frozen=True)
class NormalEquations:
    """Mean square of residuals and its derivatives at P parameters.

    Attributes:
        mean_square: Mean square of the residuals.
        gradient: (P,) gradient Jᵀr / n.
        normal_matrix: (P, P) Gauss-Newton matrix JᵀJ / n.
    """

    mean_square: float
    gradient: Float64
    normal_matrix: Float64


class LeastSquaresProblem(Protocol):
    """Residuals to minimize."""

    def mean_square(self, parameters: Float64) -> float:
        """Return the mean of the squared residuals."""
        ...

    def normal_equations(self, parameters: Float64) -> NormalEquations:
        """Return the same with its derivatives."""
        ...


@dataclass(frozen=True)
class LevenbergMarquardtStep:
    """Parameters with a lower error than all before them.

    Attributes:
        number: Number of the step, 0 of the start.
        parameters: (P,) parameters.
        mean_square: Mean square of the residuals.
        gradient: Norm of the gradient Jᵀr / n.
        damping: Damping of the next step.
    """

    number: int
    parameters: Float64
    mean_square: float
    gradient: float
    damping: float


def levenberg_marquardt_steps(
    problem: LeastSquaresProblem,
    start: Float64,
    config: LevenbergMarquardtConfig = _CONFIG,
    first: int = 0,
) -> Iterator[LevenbergMarquardtStep]:
    """Yield the start and then parameters of ever lower error; the caller may stop earlier.

    From a step's parameters, damping and number it continues as if it had not stopped.

    Args:
        problem: Residuals to minimize.
        start: (P,) initial parameters.
        config: Damping and stopping criteria.
        first: Number of the start.
    """
    mu, parameters = config.initial_damping, np.asarray(start, np.float64)
    for number in range(first, config.max_steps + 1):
        here = problem.normal_equations(parameters)
        length = float(np.linalg.norm(here.gradient))
        yield LevenbergMarquardtStep(number, parameters, here.mean_square, length, mu)
        if number == config.max_steps or length < config.min_gradient:
            return
        while mu <= config.max_damping:
            tried = _tried(parameters, here, mu)
            if tried is not None and problem.mean_square(tried) < here.mean_square:
                mu *= config.decrease
                break
            mu *= config.increase
        else:
            return
        assert tried is not None  # it was lower
        parameters = tried


def _tried(parameters: Float64, here: NormalEquations, mu: float) -> Float64 | None:
    """Return the parameters after a damped step, or None where its equations cannot be solved."""
    damped = here.normal_matrix + mu * np.eye(len(parameters))
    try:
        step = cho_solve(cho_factor(damped, check_finite=False), here.gradient, check_finite=False)
    except LinAlgError:
        return None
    tried: Float64 = parameters - step
    return tried if np.isfinite(tried).all() else None
