"""A frame that would be late goes without some stages, and its result says so."""

from dataclasses import replace

import numpy as np
import pytest

from perception.detection.config import DetectionConfig
from perception.errors import UsageError
from perception.pipeline import Pipeline, PipelineConfig
from perception.pipeline.budget import TimeBudget
from perception.pipeline.skipped_stages import modalities_without, skippable_stages
from perception.pipeline.workers import StageClock
from perception.sensor import HDL_64E
from tests.faults import fault

_THESIS = DetectionConfig(method="thesis")


@pytest.fixture
def now_s(monkeypatch) -> list[float]:
    """Return the time of all clocks, to be set."""
    now = [0.0]
    monkeypatch.setattr("perception.pipeline.workers.time.perf_counter", lambda: now[0])
    return now


def run(budget: TimeBudget, now_s: list[float], *skipped: str, taken_s: float) -> None:
    with budget.measured(skipped, StageClock()):
        now_s[0] += taken_s


def test_stages_run_while_the_frame_is_expected_to_be_in_time(now_s):
    budget = TimeBudget(0.1)
    run(budget, now_s, taken_s=0.05)
    clock = StageClock()
    now_s[0] += 0.045
    assert budget.stages_to_skip(["DepthCN"], clock) == ()
    now_s[0] += 0.010
    assert budget.stages_to_skip(["DepthCN"], clock) == ("DepthCN",)


def test_as_few_stages_are_left_out_as_keep_the_budget_in_their_order(now_s):
    budget, order = TimeBudget(0.1), ["DepthCN", "rm detector", "dm detector"]
    run(budget, now_s, taken_s=0.13)
    run(budget, now_s, "DepthCN", taken_s=0.11)
    run(budget, now_s, "DepthCN", "rm detector", taken_s=0.09)
    assert budget.stages_to_skip(order, StageClock()) == ("DepthCN", "rm detector")


def test_all_are_left_out_where_even_these_do_not_suffice(now_s):
    budget, order = TimeBudget(0.1), ["DepthCN", "rm detector"]
    for count in range(3):
        run(budget, now_s, *order[:count], taken_s=0.5)
    assert budget.stages_to_skip(order, StageClock()) == ("DepthCN", "rm detector")


def test_one_slow_frame_does_not_stop_a_stage_for_good(now_s):
    budget = TimeBudget(0.1)
    run(budget, now_s, taken_s=0.5)
    skipped = 0
    while budget.stages_to_skip(["DepthCN"], StageClock()):
        skipped += 1
    assert 1 < skipped < 30


def test_without_a_budget_every_stage_runs(now_s):
    budget = TimeBudget(None)
    run(budget, now_s, taken_s=100.0)
    assert budget.stages_to_skip(["DepthCN"], StageClock()) == ()


def test_of_the_detectors_one_remains():
    order = ["rm detector", "DepthCN", "rgb detector", "dm detector"]
    assert skippable_stages(order, ["rgb", "dm", "rm"], has_depthcn=True) == order[:3]
    assert skippable_stages(order, ["dm"], has_depthcn=False) == []
    assert modalities_without(["rm detector", "DepthCN"]) == ("rgb", "dm")


def test_the_result_names_the_stage_that_was_left_out(street_frames):
    config = PipelineConfig(parallel=False, budget_ms=1.0, detection=_THESIS)
    with Pipeline(HDL_64E, config) as pipeline:
        result = pipeline.step(street_frames[0])
    assert result.skipped == ("DepthCN",)
    assert result.depthcn is None
    assert result.vehicles is not None
    assert "DepthCN" not in result.timings_s


def test_a_late_frame_goes_without_the_stages_that_are_named(street_frames):
    skips = ("rm detector", "dm detector", "rgb detector")
    config = PipelineConfig(parallel=False, budget_ms=1.0, budget_skips=skips, detection=_THESIS)
    with Pipeline(HDL_64E, config) as pipeline:
        result = pipeline.step(street_frames[0])
    assert result.skipped == ("rm detector", "dm detector")
    assert result.modality_detections.keys() == {"rgb"}
    assert result.depthcn is not None and result.vehicles is not None
    faults = {finding.fault for finding in result.health.findings}
    assert faults >= {"rm detector left out", "dm detector left out"}


def test_a_late_frame_goes_without_the_view_from_above(street_frames, all_stages):
    late = replace(
        all_stages, parallel=False, budget_ms=1.0, budget_skips=("bev detector", "rgb detector")
    )
    with Pipeline(HDL_64E, late) as pipeline:
        result = pipeline.step(street_frames[0])
    assert result.skipped == ("bev detector", "rgb detector")
    assert np.isnan(result.vehicles.bev_scores).all()
    assert "bev detector" not in result.timings_s


def test_a_budget_is_positive():
    with fault(UsageError, "budget_ms", "a positive time", "0"):
        PipelineConfig(budget_ms=0.0)
