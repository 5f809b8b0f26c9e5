"""The sums over rows: those of the whole Jacobian, on every precision, by parts."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch.func import functional_call, jacrev

from perception.detection.fusion.features import FEATURES
from perception.errors import UsageError
from tests.faults import fault
from tests.train.fusion.toy_rows import toy_rows
from train.fusion.datamodule import row_tensors
from train.fusion.gauss_newton import mean_square, normal_equations, weighted_entropy
from train.fusion.network import NaiveBayes, RescoringMlp


def toy_network(hidden=(4,), dtype=torch.float64):
    torch.manual_seed(0)
    network = RescoringMlp("scores", hidden)
    network.fit_inputs(toy_rows().features)
    return network.to(dtype)


def tensors_of(rows, dtype=torch.float64):
    return [column.to(dtype) for column in row_tensors(rows)]


def residuals_of(network, rows, parameters):
    features, targets, weights = rows
    outputs = functional_call(network, parameters, (features,))
    return ((outputs - targets) * weights.sqrt()).flatten()


@pytest.mark.parametrize("hidden", [(2,), (4, 3), (3, 2, 2)])
def test_the_sums_are_those_of_the_whole_jacobian(hidden):
    rows = tensors_of(toy_rows())
    network = toy_network(hidden)
    parameters = {name: weight.detach() for name, weight in network.named_parameters()}
    by_name = jacrev(lambda values: residuals_of(network, rows, values))(parameters)
    jacobian = torch.cat([one.flatten(1) for one in by_name.values()], dim=1)
    residuals, total = residuals_of(network, rows, parameters), rows[2].sum()
    found = normal_equations(network, rows)
    torch.testing.assert_close(found.mean_square, residuals.square().sum() / total)
    torch.testing.assert_close(found.gradient, jacobian.T @ residuals / total)
    torch.testing.assert_close(found.matrix, jacobian.T @ jacobian / total)
    torch.testing.assert_close(mean_square(network, rows), found.mean_square)


def test_the_cross_entropy_of_probabilities_is_that_of_its_definition():
    rows = tensors_of(toy_rows(features=len(FEATURES["default"])))
    rows[0], rows[1] = rows[0].sigmoid(), rows[1].clamp(0, 1)
    network = NaiveBayes().double()
    scores = network(rows[0])
    terms = rows[1] * scores.log() + (1 - rows[1]) * (1 - scores).log()
    found = weighted_entropy(network, rows)
    torch.testing.assert_close(found, torch.stack([-(rows[2] * terms).sum(), rows[2].sum()]))


def test_the_sums_are_those_of_all_rows_whatever_the_parts(monkeypatch):
    network, rows = toy_network(), tensors_of(toy_rows())
    whole = normal_equations(network, rows)
    monkeypatch.setattr("train.fusion.gauss_newton._CPU_ROWS", 7)
    parts = normal_equations(network, rows)
    for name, values in vars(whole).items():
        torch.testing.assert_close(getattr(parts, name), values, msg=name)


def test_the_sums_of_processes_add_up():
    network, rows = toy_network(), tensors_of(toy_rows())
    shares = [[column[part::2] for column in rows] for part in range(2)]
    seen: list[list[torch.Tensor]] = []
    for share in shares:
        seen.append([])
        normal_equations(network, share, lambda sums, keep=seen[-1]: keep.append(sums) or sums)
    added = iter([one + other for one, other in zip(*seen, strict=True)])
    together = normal_equations(network, shares[0], lambda sums: next(added))
    for name, values in vars(normal_equations(network, rows)).items():
        torch.testing.assert_close(getattr(together, name), values, msg=name)


def test_single_precision_is_near_double():
    double, single = (
        normal_equations(toy_network((4, 3), dtype=dtype), tensors_of(toy_rows(), dtype))
        for dtype in (torch.float64, torch.float32)
    )
    assert single.matrix.dtype == torch.float32
    for name, values in vars(double).items():
        torch.testing.assert_close(
            getattr(single, name).double(), values, rtol=1e-4, atol=1e-6, msg=name
        )


def test_inputs_go_to_minus_one_and_one_and_constant_ones_stay():
    network = RescoringMlp("scores", (2,))
    network.fit_inputs(np.array([[0, 5, 1], [10, 5, 2]], np.float32))
    others = torch.tensor([[0.0, 5, 1], [10, 7, 2]])
    assert network.mapped(others).tolist() == [[-1, -1, -1], [1, -1, 1]]


def test_rows_without_weight_do_not_count():
    rows = toy_rows()
    doubled = replace(rows, targets=np.where(rows.weights > 0, rows.targets, 7).astype(np.float32))
    network = toy_network()
    torch.testing.assert_close(
        mean_square(network, tensors_of(doubled)), mean_square(network, tensors_of(rows))
    )


def test_a_network_without_neurons_is_refused():
    with fault(UsageError, "hidden layers", "neurons in each", "none"):
        RescoringMlp("scores", ())
    with fault(UsageError, found="4, 0"):
        RescoringMlp("scores", (4, 0))
