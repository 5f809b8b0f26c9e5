"""Levenberg-Marquardt: between Gauss-Newton and steepest descent, by an adaptive damping.

D. W. Marquardt, "An algorithm for least-squares estimation of nonlinear parameters", 1963; M. T. Hagan,
M. B. Menhaj, "Training feedforward networks with the Marquardt algorithm", 1994. The damping's numbers are
those of MATLAB's trainlm, by which the thesis' networks were trained (7.2.2).

    (JᵀJ + μ I) step = -Jᵀr        over means of the rows, so that μ means the same for few and for many
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import Parameter
from torch.nn.utils import parameters_to_vector
from torch.optim import Optimizer


@dataclass(frozen=True)
class NormalEquations:
    """Mean square of residuals and its derivatives by P parameters, in the order of `parameters_to_vector`.

    Attributes:
        mean_square: Mean square of the residuals.
        gradient: (P,) gradient Jᵀr / n.
        matrix: (P, P) Gauss-Newton matrix JᵀJ / n.
    """

    mean_square: Tensor
    gradient: Tensor
    matrix: Tensor


class LevenbergMarquardt(Optimizer):
    """Minimize a mean of squares by steps that solve its damped normal equations.

    The damping is an entry of the parameter group, as a learning rate is, and so a part of every checkpoint.

    Attributes:
        has_converged: Whether the last step found no lower error, or hardly a gradient.
    """

    def __init__(
        self,
        params: Iterable[Parameter],
        damping: float = 1e-3,
        decrease: float = 0.1,
        increase: float = 10.0,
        max_damping: float = 1e10,
        min_gradient: float = 1e-7,
    ) -> None:
        """Take parameters, damping and stopping criteria; the defaults are those of MATLAB's trainlm.

        Args:
            params: Parameters to optimize, in one group.
            damping: Damping μ of the first step.
            decrease: Factor of the damping after a step that lowers the error.
            increase: Factor of the damping after a step that does not.
            max_damping: Damping beyond which no shorter step is tried.
            min_gradient: Norm of the gradient below which no step is taken.
        """
        defaults = {
            "lr": 1.0,  # of the whole step, for those who log it
            "damping": damping,
            "decrease": decrease,
            "increase": increase,
            "max_damping": max_damping,
            "min_gradient": min_gradient,
        }
        super().__init__(params, defaults)
        self.has_converged = False

    @torch.no_grad()
    def step(  # type: ignore[override]
        self, closure: Callable[[], NormalEquations], mean_square: Callable[[], Tensor]
    ) -> Tensor:
        """Take the first damped step that lowers the error; return the mean square after it.

        Args:
            closure: Function that returns the normal equations at the parameters as they are.
            mean_square: Function that returns the mean square at the parameters as they are.
        """
        (group,) = self.param_groups
        here, start = closure(), parameters_to_vector(group["params"])
        self.has_converged = bool(here.gradient.norm() < group["min_gradient"])
        while not self.has_converged:
            if group["damping"] > group["max_damping"]:
                self.has_converged = True
                break
            self._move(start - _solution(here, group["damping"]))
            after = mean_square()
            if after < here.mean_square:  # neither where it is NaN, as without a solution
                group["damping"] *= group["decrease"]
                return after
            group["damping"] *= group["increase"]
        self._move(start)
        return here.mean_square

    def _move(self, vector: Tensor) -> None:
        parameters = self.param_groups[0]["params"]
        parts = torch.split(vector, [parameter.numel() for parameter in parameters])
        for parameter, part in zip(parameters, parts, strict=True):
            parameter.copy_(part.view_as(parameter))


def _solution(equations: NormalEquations, damping: float) -> Tensor:
    """Return the (P,) solution of the damped equations, NaN where there is none."""
    matrix = equations.matrix.clone()
    matrix.diagonal().add_(damping)
    factor, failed = torch.linalg.cholesky_ex(matrix)
    solution = torch.cholesky_solve(equations.gradient[:, None], factor)[:, 0]
    return torch.where(failed == 0, solution, torch.nan)
