"""A frame that would be late goes without DepthCN, and its result says so."""

import pytest

from perception.errors import UsageError
from perception.pipeline import Pipeline, PipelineConfig
from perception.pipeline.budget import TimeBudget
from perception.pipeline.workers import StageClock
from perception.sensor import HDL_64E
from tests.faults import fault


@pytest.fixture
def now_s(monkeypatch) -> list[float]:
    """Return the time of all clocks, to be set."""
    now = [0.0]
    monkeypatch.setattr("perception.pipeline.workers.time.perf_counter", lambda: now[0])
    return now


def run(budget: TimeBudget, now_s: list[float], **taken_s: float) -> StageClock:
    clock = StageClock()
    for stage, seconds in taken_s.items():
        with budget.measured(stage, clock):
            now_s[0] += seconds
    return clock


def test_a_stage_runs_while_it_is_expected_to_end_in_time(now_s):
    budget = TimeBudget(0.1)
    run(budget, now_s, verifier=0.03, vehicles=0.02)
    clock = StageClock()
    now_s[0] += 0.045
    assert budget.allows("verifier", clock, "vehicles")
    now_s[0] += 0.010
    assert not budget.allows("verifier", clock, "vehicles")


def test_one_slow_frame_does_not_stop_a_stage_for_good(now_s):
    budget = TimeBudget(0.1)
    run(budget, now_s, verifier=0.5)
    skipped = 0
    while not budget.allows("verifier", StageClock()):
        skipped += 1
    assert 1 < skipped < 30


def test_without_a_budget_every_stage_runs(now_s):
    budget = TimeBudget(None)
    assert budget.allows("verifier", run(budget, now_s, verifier=100.0))


def test_the_result_names_the_stage_that_was_left_out(street_frames):
    config = PipelineConfig(parallel=False, budget_ms=1.0)
    with Pipeline(HDL_64E, config) as pipeline:
        result = pipeline.step(street_frames[0])
    assert result.skipped == ("DepthCN",)
    assert result.depthcn is None
    assert result.vehicles is not None
    assert "DepthCN" not in result.timings_s


def test_a_budget_is_positive():
    with fault(UsageError, "budget_ms", "a positive time", "0"):
        PipelineConfig(budget_ms=0.0)
