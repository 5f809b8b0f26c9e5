"""The descent finds known optima, and those that scipy finds."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from train.fusion.config import LevenbergMarquardtConfig
from train.fusion.levenberg_marquardt import NormalEquations, levenberg_marquardt_steps


class Problem:
    """Residuals and their Jacobian, as functions of the parameters."""

    def __init__(self, residuals, jacobian):
        self.residuals, self.jacobian = residuals, jacobian

    def mean_square(self, parameters):
        return float(np.mean(self.residuals(parameters) ** 2))

    def normal_equations(self, parameters):
        r, jacobian = self.residuals(parameters), self.jacobian(parameters)
        gradient, normal_matrix = jacobian.T @ r / len(r), jacobian.T @ jacobian / len(r)
        return NormalEquations(self.mean_square(parameters), gradient, normal_matrix)


def rosenbrock():
    return Problem(
        lambda p: np.array([10 * (p[1] - p[0] ** 2), 1 - p[0]]),
        lambda p: np.array([[-20 * p[0], 10], [-1, 0]]),
    )


def decay():
    rng = np.random.default_rng(0)
    x = np.linspace(0, 4, 60)
    y = 2.5 * np.exp(-1.3 * x) + 0.5 + rng.normal(0, 0.02, 60)
    return Problem(
        lambda p: p[0] * np.exp(-p[1] * x) + p[2] - y,
        lambda p: np.stack(
            [np.exp(-p[1] * x), -p[0] * x * np.exp(-p[1] * x), np.ones_like(x)], axis=1
        ),
    )


def test_the_valley_of_rosenbrock():
    *_, last = levenberg_marquardt_steps(rosenbrock(), np.array([-1.2, 1.0]))
    np.testing.assert_allclose(last.parameters, [1, 1], atol=1e-6)
    assert last.mean_square < 1e-12


def test_a_line_is_fitted_as_by_its_normal_equations():
    rng = np.random.default_rng(1)
    matrix, y = rng.normal(size=(50, 4)), rng.normal(size=50)
    *_, last = levenberg_marquardt_steps(
        Problem(lambda p: matrix @ p - y, lambda p: matrix), np.zeros(4)
    )
    expected = np.linalg.lstsq(matrix, y, rcond=None)[0]
    np.testing.assert_allclose(last.parameters, expected, atol=1e-6)


@pytest.mark.parametrize("start", [[1.0, 1.0, 0.0], [5.0, 0.2, 2.0], [0.1, 4.0, -1.0]])
def test_as_low_as_scipy_goes(start):
    problem = decay()
    *_, last = levenberg_marquardt_steps(problem, np.array(start))
    theirs = least_squares(problem.residuals, start, problem.jacobian, method="lm")
    np.testing.assert_allclose(last.parameters, theirs.x, atol=1e-5)
    assert last.mean_square == pytest.approx(2 * theirs.cost / 60, rel=1e-9)


def test_every_step_is_lower_than_the_one_before():
    steps = list(levenberg_marquardt_steps(decay(), np.array([5.0, 0.2, 2.0])))
    assert (np.diff([step.mean_square for step in steps]) < 0).all()
    assert [step.number for step in steps] == list(range(len(steps)))


def test_parameters_of_no_effect_do_no_harm():
    problem = Problem(
        lambda p: np.array([p[0] - 3.0, 0.0]), lambda p: np.array([[1.0, 0.0], [0.0, 0.0]])
    )
    *_, last = levenberg_marquardt_steps(problem, np.array([0.0, 7.0]))
    np.testing.assert_allclose(last.parameters, [3, 7], atol=1e-6)


def test_it_stops_at_the_limit_of_steps():
    steps = list(
        levenberg_marquardt_steps(
            rosenbrock(), np.array([-1.2, 1.0]), LevenbergMarquardtConfig(max_steps=3)
        )
    )
    assert len(steps) == 4
    # A start from which no step leads down.
    flat = Problem(lambda p: np.array([1.0 + p[0] ** 2]), lambda p: np.array([[1.0]]))
    assert len(list(levenberg_marquardt_steps(flat, np.zeros(1)))) == 1
