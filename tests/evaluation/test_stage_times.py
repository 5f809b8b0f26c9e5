"""Tables of stages that overlap, and of stages that some frames do without."""

from dataclasses import dataclass

import pytest

from perception.evaluation.stage_times import StageTimes
from perception.types import StageSpan


@dataclass
class Timed:
    """As much of a result as has to do with time; every stage takes 10 ms."""

    spans: tuple[StageSpan, ...]

    @property
    def timings_s(self):
        return {span.stage: 0.010 for span in self.spans}


def spans_at(begun_s, **starts_s):
    return tuple(
        StageSpan(stage, "worker", begun_s + start_s, begun_s + start_s + 0.010)
        for stage, start_s in starts_s.items()
    )


@pytest.fixture
def times():
    collected = StageTimes()
    collected.update(Timed(spans_at(0.5, ground=0.0)))
    for begun_s, maps_s in ((0.0, 0.005), (0.3, 0.010), (0.1, 0.0)):
        collected.update(Timed(spans_at(begun_s, ground=0.0, maps=maps_s)))
    return collected


def test_what_overlaps_counts_twice_in_the_sum_and_once_in_the_frame(times):
    table = times.table("2 stages")
    assert [line.split() for line in table.text().splitlines()[3:]] == [
        ["ground", "10.0", "10.0", "57"],
        ["maps", "10.0", "10.0", "43"],
        ["all", "stages", "20.0", "20.0", "100"],
        ["end", "to", "end", "12.5", "19.9", "-"],
    ]
    written = table.to_json()["end to end"]
    assert written == {"p50": 12.5, "p99": 19.9, "share_percent": None}


def test_a_typical_frame_has_all_stages_and_takes_neither_long_nor_short(times):
    spans = {span.stage: span.start_s for span in times.typical()}
    assert spans == pytest.approx({"ground": 0.0, "maps": 0.005})


def test_no_frames_have_no_rows():
    assert StageTimes().table("").to_json() == {}
