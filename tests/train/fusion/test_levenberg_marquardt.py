"""The optimizer finds known optima, and those that scipy finds."""

from dataclasses import dataclass

import numpy as np
import pytest
import torch
from scipy.optimize import least_squares
from torch.func import jacrev
from torch.nn import Parameter

from tests.train.fusion.test_gauss_newton import residuals_of, tensors_of, toy_network
from tests.train.fusion.toy_rows import toy_rows
from train.fusion.gauss_newton import mean_square, normal_equations
from train.fusion.levenberg_marquardt import LevenbergMarquardt, NormalEquations


@dataclass
class Problem:
    """Residuals of parameters, and the errors of all steps."""

    residuals: object
    parameters: Parameter

    def minimize(self, steps=200, **settings):
        """Return the mean square at the start and after each step."""
        optimizer = LevenbergMarquardt([self.parameters], **settings)
        errors = [float(self.mean_square())]
        while len(errors) <= steps and not optimizer.has_converged:
            errors.append(float(optimizer.step(self.equations, self.mean_square)))
        return errors

    def mean_square(self):
        return self.residuals(self.parameters.detach()).square().mean()

    def equations(self):
        at = self.parameters.detach()
        r, jacobian = self.residuals(at), jacrev(self.residuals)(at)
        gradient, matrix = jacobian.T @ r / len(r), jacobian.T @ jacobian / len(r)
        return NormalEquations(r.square().mean(), gradient, matrix)


def problem_of(residuals, start):
    return Problem(residuals, Parameter(torch.tensor(start, dtype=torch.float64)))


def rosenbrock(p):
    return torch.stack([10 * (p[1] - p[0] ** 2), 1 - p[0]])


X = torch.linspace(0, 4, 60, dtype=torch.float64)
Y = (
    2.5 * torch.exp(-1.3 * X)
    + 0.5
    + 0.02 * torch.from_numpy(np.random.default_rng(0).normal(size=60))
)


def decay(p):
    return p[0] * torch.exp(-p[1] * X) + p[2] - Y


def test_the_valley_of_rosenbrock():
    problem = problem_of(rosenbrock, [-1.2, 1.0])
    assert problem.minimize()[-1] < 1e-12
    np.testing.assert_allclose(problem.parameters.detach(), [1, 1], atol=1e-6)


def test_a_line_is_fitted_as_by_its_normal_equations():
    rng = np.random.default_rng(1)
    matrix, y = torch.from_numpy(rng.normal(size=(50, 4))), torch.from_numpy(rng.normal(size=50))
    problem = problem_of(lambda p: matrix @ p - y, [0.0] * 4)
    problem.minimize()
    expected = torch.linalg.lstsq(matrix, y[:, None]).solution[:, 0]
    np.testing.assert_allclose(problem.parameters.detach(), expected, atol=1e-6)


@pytest.mark.parametrize("start", [[1.0, 1.0, 0.0], [5.0, 0.2, 2.0], [0.1, 4.0, -1.0]])
def test_as_low_as_scipy_goes(start):
    problem = problem_of(decay, start)
    errors = problem.minimize()
    theirs = least_squares(lambda p: decay(torch.from_numpy(p)).numpy(), start, method="lm")
    np.testing.assert_allclose(problem.parameters.detach(), theirs.x, atol=1e-5)
    assert errors[-1] == pytest.approx(2 * theirs.cost / 60, rel=1e-9)


def test_every_step_is_lower_than_the_one_before():
    errors = problem_of(decay, [5.0, 0.2, 2.0]).minimize(steps=5)
    assert len(errors) == 6
    assert (np.diff(errors) < 0).all()


def test_parameters_of_no_effect_do_no_harm():
    problem = problem_of(lambda p: torch.stack([p[0] - 3.0, 0 * p[1]]), [0.0, 7.0])
    problem.minimize()
    np.testing.assert_allclose(problem.parameters.detach(), [3, 7], atol=1e-6)


def test_where_no_step_leads_down_it_has_converged_and_stays():
    problem = problem_of(lambda p: 1 + p**2, [0.0])
    assert len(problem.minimize()) == 2
    # A gradient of the wrong sign, after which every step leads up.
    uphill = problem_of(lambda p: p + 1, [0.0])
    exact = uphill.equations()
    optimizer = LevenbergMarquardt([uphill.parameters], max_damping=1e3)
    wrong = NormalEquations(exact.mean_square, -exact.gradient, exact.matrix)
    assert optimizer.step(lambda: wrong, uphill.mean_square) == 1
    assert optimizer.has_converged
    assert uphill.parameters.item() == 0


def test_the_damping_is_a_part_of_its_state():
    problem = problem_of(rosenbrock, [-1.2, 1.0])
    first = LevenbergMarquardt([problem.parameters])
    first.step(problem.equations, problem.mean_square)
    damping = first.param_groups[0]["damping"]
    assert damping != 1e-3
    second = LevenbergMarquardt([problem.parameters])
    second.load_state_dict(first.state_dict())
    assert second.param_groups[0]["damping"] == damping


def test_the_network_gets_as_low_as_by_scipy():
    """Near a network that made the targets, noise apart, there is one place that is lowest."""
    network, (features, targets, weights) = toy_network((2,)), tensors_of(toy_rows())
    rng = np.random.default_rng(0)
    with torch.no_grad():
        for weight in network.parameters():
            weight.mul_(2)
        targets = network(features) + 0.01 * torch.from_numpy(rng.normal(size=targets.shape))
        for weight in network.parameters():
            weight.add_(0.1 * torch.from_numpy(rng.normal(size=weight.shape)))
    rows = (features, targets, weights)
    named = dict(network.named_parameters())
    sizes = [one.numel() for one in named.values()]
    start = torch.cat([one.detach().flatten() for one in named.values()]).numpy()

    def residuals(vector):
        parts = torch.from_numpy(vector).split(sizes)
        values = {k: p.view_as(one) for (k, one), p in zip(named.items(), parts, strict=True)}
        return residuals_of(network, rows, values).detach().numpy()

    theirs = least_squares(residuals, start, method="lm", xtol=1e-12, ftol=1e-12, gtol=1e-12)
    optimizer = LevenbergMarquardt(network.parameters())
    for _ in range(100):
        error = optimizer.step(
            lambda: normal_equations(network, rows), lambda: mean_square(network, rows)
        )
    assert float(error) == pytest.approx(2 * theirs.cost / float(weights.sum()), rel=1e-6)
    assert error < 0.01**2
