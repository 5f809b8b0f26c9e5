"""Cost of a frame: blocks of a long run, stages in processor time, and memory with shared pages counted once."""

import subprocess
import sys
import time
from dataclasses import replace

import pytest

from benchmarks.measure import memory_mib, processor_clock
from benchmarks.studies.growth import GrowthConfig, blocks_of, median_stages_ms
from data.synthetic.drive import SyntheticDrive
from perception.cli.main import COMMANDS, SUMMARIES
from perception.errors import UsageError
from perception.evaluation.stage_times import ALL_STAGES
from perception.pipeline import PipelineConfig
from perception.sensor import VLP_16
from tests.faults import fault

on_linux = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")


def test_blocks_hold_the_median_of_their_frames():
    times_s = [0.001 * (number // 3) for number in range(50)]  # blocks of three frames
    run = blocks_of(times_s, len(times_s))
    assert run.frames == [*range(3, 49, 3), 50]
    assert run.medians_ms == pytest.approx(range(17))
    assert len(run.memory_mib) == 17


def test_a_short_run_has_a_block_a_frame():
    assert blocks_of([0.5, 0.25], 2).medians_ms == pytest.approx([500.0, 250.0])


def test_no_frame_is_refused():
    with fault(UsageError, "--length", found="0"):
        GrowthConfig(length=0)


def test_waiting_is_no_processor_time():
    wall_clock = time.perf_counter
    with processor_clock():
        start_s = time.perf_counter()
        time.sleep(0.2)
        assert time.perf_counter() - start_s < 0.1
    assert time.perf_counter is wall_clock


def test_every_stage_has_a_cost():
    frames = list(SyntheticDrive(10, sensor=VLP_16, images=False))
    config = replace(PipelineConfig.for_motion("none"), parallel=False)
    costs = median_stages_ms(VLP_16, frames, config)
    stages = ["scan health", "registration", "ground", "voxels", "static and moving", ALL_STAGES]
    assert [stage for stage in costs if stage not in ("image health", "calibration")] == stages
    assert costs[ALL_STAGES] > sum(costs.values()) - costs[ALL_STAGES] > 0


@on_linux
def test_memory_holds_started_processes():
    before_mib = memory_mib()
    # 512 MiB: what this process shares with others changes while they start and end.
    code = "held = bytes(range(256)) * 2**21; print(flush=True); input()"
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as started:
        started.stdout.readline()
        assert 400 < memory_mib() - before_mib < 620
        started.communicate(b"\n")


@pytest.mark.parametrize("name", ["growth", "ins-error", "tracker-parameters"])
def test_a_study_is_the_function_of_its_name(name):
    assert COMMANDS[f"study {name}"].load().__name__ == name.replace("-", "_")
    assert COMMANDS[f"study {name}"].summary == SUMMARIES[f"study {name}"]
