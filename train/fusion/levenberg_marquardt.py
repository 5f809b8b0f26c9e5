"""Levenberg-Marquardt: between Gauss-Newton and the steepest descent, by a damping that follows success.

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


@dataclass(frozen=True)
class NormalEquations:
    """What is known of a sum of squares at one place in the space of P parameters.

    Attributes:
        mean_square: of the residuals.
        gradient: (P,) Jᵀr / n.
        normal_matrix: (P, P) JᵀJ / n.
    """

    mean_square: float
    gradient: Float64
    normal_matrix: Float64


class LeastSquaresProblem(Protocol):
    """Residuals that shall be small."""

    def mean_square(self, parameters: Float64) -> float:
        """Return the mean of the squared residuals."""
        ...

    def normal_equations(self, parameters: Float64) -> NormalEquations:
        """Return the same with its derivatives."""
        ...


@dataclass(frozen=True)
class LevenbergMarquardtConfig:
    """How the damping follows success, and when there is nothing left to gain.

    Attributes:
        first: damping of the first step.
        fall: factor after a step that helped.
        rise: factor after one that did not.
        most: no step helps beyond this.
        min_gradient: below which the place is as low as it gets.
        max_steps: that are taken.
    """

    first: float = 1e-3
    fall: float = 0.1
    rise: float = 10.0
    most: float = 1e10
    min_gradient: float = 1e-7
    max_steps: int = 1000


@dataclass(frozen=True)
class LevenbergMarquardtStep:
    """A place that is lower than all before it.

    Attributes:
        number: of the step, 0 of the start.
        parameters: (P,)
        mean_square: of the residuals.
        gradient: length of Jᵀr / n.
        damping: of the next step.
    """

    number: int
    parameters: Float64
    mean_square: float
    gradient: float
    damping: float


def levenberg_marquardt_steps(
    problem: LeastSquaresProblem,
    start: Float64,
    damping: LevenbergMarquardtConfig = LevenbergMarquardtConfig(),
    first: int = 0,
) -> Iterator[LevenbergMarquardtStep]:
    """Yield the start and then ever lower places, until none is found; who looks on may stop earlier.

    From a step's parameters, damping and number it goes on as if it had not stopped.

    Args:
        problem: what shall be small.
        start: (P,) parameters.
        damping: from that of the first step on.
        first: number of the start.
    """
    mu, parameters = damping.first, np.asarray(start, np.float64)
    for number in range(first, damping.max_steps + 1):
        here = problem.normal_equations(parameters)
        length = float(np.linalg.norm(here.gradient))
        yield LevenbergMarquardtStep(number, parameters, here.mean_square, length, mu)
        if number == damping.max_steps or length < damping.min_gradient:
            return
        while mu <= damping.most:
            tried = _tried(parameters, here, mu)
            if tried is not None and problem.mean_square(tried) < here.mean_square:
                mu *= damping.fall
                break
            mu *= damping.rise
        else:
            return
        assert tried is not None  # it was lower
        parameters = tried


def _tried(parameters: Float64, here: NormalEquations, mu: float) -> Float64 | None:
    """Return where the damped step leads, or None where its equations are not solvable."""
    damped = here.normal_matrix + mu * np.eye(len(parameters))
    try:
        step = cho_solve(cho_factor(damped, check_finite=False), here.gradient, check_finite=False)
    except LinAlgError:
        return None
    tried: Float64 = parameters - step
    return tried if np.isfinite(tried).all() else None
