"""The network's error and its derivatives: exact, and as low as scipy brings it."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import torch
from scipy.optimize import approx_fprime, least_squares

from perception.detection.fusion.features import FEATURES
from perception.errors import UsageError
from tests.faults import fault
from train.fusion.config import MlpConfig
from train.fusion.levenberg_marquardt import levenberg_marquardt_steps
from train.fusion.mlp import RescoringMlp
from train.fusion.mlp_least_squares import MlpLeastSquares
from train.fusion.targets import FusionRows


def toy_rows(count=60, seed=0) -> FusionRows:
    rng = np.random.default_rng(seed)
    features = rng.uniform(0, 1, (count, 3)).astype(np.float32)
    means = features.mean(axis=1, keepdims=True)
    targets = np.clip(means + 0.3 * features * features[:, ::-1], 0, 1).astype(np.float32)
    weights = rng.choice([0.0, 0.5, 1.0], (count, 3)).astype(np.float32)
    return FusionRows(features, targets, weights)


def toy_problem(hidden=(4,), rows=None, variant="scores") -> MlpLeastSquares:
    rows = toy_rows() if rows is None else rows
    torch.manual_seed(0)
    network = RescoringMlp(MlpConfig(variant, hidden))
    network.fit_inputs(rows.features)
    return MlpLeastSquares(network, rows)


@pytest.mark.parametrize("hidden", [(4,), (4, 3)])
def test_the_error_and_its_gradient(hidden):
    rows, problem = toy_rows(), toy_problem(hidden)
    start = problem.start
    network = problem.network_of(start)
    says = network(torch.from_numpy(rows.features)).detach().numpy()
    error = (rows.weights * (says - rows.targets) ** 2).sum() / rows.weights.sum()
    here = problem.normal_equations(start)
    assert problem.mean_square(start) == pytest.approx(error, rel=1e-5)
    assert here.mean_square == pytest.approx(problem.mean_square(start), rel=1e-12)
    numeric = approx_fprime(start, problem.mean_square, 1e-7)
    np.testing.assert_allclose(2 * here.gradient, numeric, atol=1e-5)
    assert np.linalg.eigvalsh(here.normal_matrix).min() > -1e-12


def test_the_curvature_is_that_of_all_rows_whatever_the_parts(monkeypatch):
    whole = toy_problem().normal_equations(toy_problem().start)
    monkeypatch.setattr("train.fusion.mlp_least_squares._ROWS_AT_ONCE", 7)
    parts = toy_problem().normal_equations(toy_problem().start)
    np.testing.assert_allclose(parts.normal_matrix, whole.normal_matrix, atol=1e-12)
    np.testing.assert_allclose(parts.gradient, whole.gradient, atol=1e-12)


def jacobian(problem, parameters) -> np.ndarray:
    """The plain twin: (3T, P) derivatives of the residuals, by torch."""
    start = torch.from_numpy(parameters)
    return torch.autograd.functional.jacobian(problem.residuals_of, start).numpy()


@pytest.mark.parametrize("variant", ["scores", "default"])
@pytest.mark.parametrize("hidden", [(2,), (4, 3), (3, 2, 2)])
def test_the_sums_are_those_of_the_whole_jacobian(variant, hidden):
    rng, count = np.random.default_rng(3), len(FEATURES[variant])
    rows = replace(toy_rows(), features=rng.uniform(0, 1, (60, count)).astype(np.float32))
    problem = toy_problem(hidden, rows, variant)
    here, plain = problem.normal_equations(problem.start), jacobian(problem, problem.start)
    total = rows.weights.sum()
    residuals = problem.residuals(problem.start)
    np.testing.assert_allclose(here.normal_matrix, plain.T @ plain / total, atol=1e-12)
    np.testing.assert_allclose(here.gradient, plain.T @ residuals / total, atol=1e-12)


def test_levenberg_marquardt_gets_as_low_as_scipy():
    """Near a network that made the targets, noise apart, there is one place that is lowest."""
    teacher = toy_problem((2,)).start * 2
    says = toy_problem((2,)).network_of(teacher)(torch.from_numpy(toy_rows().features))
    noise = np.random.default_rng(0).normal(0, 0.01, (60, 3))
    rows = replace(toy_rows(), targets=(says.detach().numpy() + noise).astype(np.float32))
    problem = toy_problem((2,), rows)
    start = teacher + 0.1 * np.random.default_rng(1).normal(size=len(teacher))
    *_, last = levenberg_marquardt_steps(problem, start)
    theirs = least_squares(
        problem.residuals, start, partial(jacobian, problem), xtol=1e-12, ftol=1e-12, gtol=1e-12
    )
    assert last.mean_square == pytest.approx(2 * theirs.cost / rows.weights.sum(), rel=1e-6)
    assert last.mean_square < 0.01**2


def test_inputs_go_to_minus_one_and_one():
    features = np.array([[0, 5, 1], [10, 5, 2]], np.float32)
    network = RescoringMlp(MlpConfig("scores"))
    network.fit_inputs(features)
    assert network.mapped(torch.from_numpy(features)).tolist() == [[-1, -1, -1], [1, -1, 1]]


def test_a_network_without_neurons_is_refused():
    with fault(UsageError, expected="neurons in each", found="none"):
        MlpConfig("scores", ())
    with fault(UsageError, found="4, 0"):
        MlpConfig("scores", (4, 0))
