"""Schedules of the learning rate, and which weights decay."""

import numpy as np
import pytest
import torch
from torch.optim import SGD

from train.optimization import DarknetSteps, StepDecay, WarmupCosine, decay_groups


def factors(schedule_class, steps, at, steps_per_epoch=1, **settings):
    schedule = schedule_class(SGD([torch.zeros(1)], lr=1.0), **settings)
    schedule.set_steps(steps, steps_per_epoch)
    return [schedule.factor(step) for step in at]


def test_the_default_rate_rises_and_falls():
    rates = factors(WarmupCosine, 100, range(100))
    assert np.argmax(rates) == 9
    assert rates[9] == pytest.approx(1, abs=1e-3)
    assert rates[54] == pytest.approx((1 + 0.001) / 2, abs=1e-3)
    assert rates[99] == pytest.approx(0.001)


def test_the_rate_of_depthcn_falls_to_a_tenth_every_eight_epochs():
    rates = factors(StepDecay, 400, (0, 79, 80, 160, 399), steps_per_epoch=10)
    np.testing.assert_allclose(rates, [1, 1, 0.1, 0.01, 0.0001])
    rates = factors(StepDecay, 400, (9, 10, 20), steps_per_epoch=5, epochs=2, gamma=0.5)
    np.testing.assert_allclose(rates, [1, 0.5, 0.25])


def test_the_rate_of_darknet():
    rates = factors(DarknetSteps, 80_200, (499, 999, 39_999, 40_000, 60_000, 80_199))
    np.testing.assert_allclose(rates, [1 / 16, 1, 1, 0.1, 0.01, 0.01])


def test_the_optimizer_takes_the_rate_of_each_step():
    optimizer = SGD([torch.zeros(1, requires_grad=True)], lr=2.0)
    schedule = WarmupCosine(optimizer, warmup=0.5)
    schedule.set_steps(4, 4)
    rates = []
    for _ in range(4):
        rates.append(optimizer.param_groups[0]["lr"])
        optimizer.step()
        schedule.step()
    np.testing.assert_allclose(rates, [1, 2, 1.001, 0.002])


def test_a_resumed_schedule_may_be_longer():
    first, second = (WarmupCosine(SGD([torch.zeros(1)], lr=1.0)) for _ in range(2))
    first.set_steps(10, 5)
    second.set_steps(20, 5)
    second.load_state_dict(first.state_dict())
    assert second.steps == 20


def test_only_matrices_decay():
    network = torch.nn.Sequential(torch.nn.Linear(2, 3), torch.nn.BatchNorm1d(3))
    groups = SGD(decay_groups(network), lr=1.0, weight_decay=0.02).param_groups
    decays = {one["weight_decay"]: {weight.ndim > 1 for weight in one["params"]} for one in groups}
    assert decays == {0.02: {True}, 0.0: {False}}
