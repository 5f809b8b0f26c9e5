"""Tables of stages that overlap, and of stages that some frames do without."""

from dataclasses import dataclass, replace

import pytest

from perception.evaluation.stage_times import StageTimes
from perception.types import StageSpan
from tests.known_result import known_result


@dataclass
class Timed:
    """As much of a result as has to do with time; every stage takes 10 ms."""

    spans: tuple[StageSpan, ...]

    @property
    def duration_s(self):
        return 0.010 + max(span.start_s for span in self.spans) - self.spans[0].start_s

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


def collected_of(*frames_ms, depthcn_ms=0.0):
    """Return the times of frames, in each of which DepthCN takes a part."""
    collected = StageTimes()
    for frame_ms in frames_ms:
        spans = (
            StageSpan("DepthCN", "worker", 0.0, depthcn_ms / 1e3),
            StageSpan("ground", "worker", depthcn_ms / 1e3, frame_ms / 1e3),
        )
        timings_s = {span.stage: span.stop_s - span.start_s for span in spans}
        collected.update(replace(known_result(0), spans=spans, timings_s=timings_s))
    return collected


@pytest.mark.parametrize(
    ("frames_ms", "depthcn_ms", "verdict"),
    [
        (
            (60, 60, 80),
            20,
            "60 ms/frame at the median, 80 ms at p99: keeps up with scans at 10 Hz",
        ),
        (
            (90, 110, 110, 110),
            40,
            "110 ms/frame at the median, 110 ms at p99: too slow for scans at 10 Hz in 75 % of the frames; "
            "--pipeline.detection.depthcn.no-enabled would keep up, and leaves out DepthCN",
        ),
        (
            (300, 300),
            10,
            "300 ms/frame at the median, 300 ms at p99: too slow for scans at 10 Hz in 100 % of the frames; "
            "no flag makes this machine keep up",
        ),
    ],
)
def test_the_verdict_names_what_would_keep_up(frames_ms, depthcn_ms, verdict):
    times = collected_of(*frames_ms, depthcn_ms=depthcn_ms)
    assert times.verdict(period_s=0.1) == f"pipeline: {verdict}"


@pytest.mark.parametrize(
    ("detectors_ms", "advice"),
    [
        ({"bev detector": 90}, "[] would keep up, and leaves out all detectors of vehicles"),
        (
            {"bev detector": 90, "rgb detector": 30},
            "rgb would keep up, and leaves out all detectors but that of the image",
        ),
        (
            {"bev detector": 30, "rgb detector": 90},
            "bev would keep up, and leaves out all detectors but that from above",
        ),
        (
            {"bev detector": 90, "rgb detector": 90},
            "[] would keep up, and leaves out all detectors of vehicles",
        ),
    ],
)
def test_the_verdict_keeps_a_detector_that_ran_and_is_quick_enough(detectors_ms, advice):
    collected, stop_ms, spans = StageTimes(), 60, [StageSpan("ground", "worker", 0, 0.06)]
    for name, of_one_ms in detectors_ms.items():
        spans.append(StageSpan(name, "worker", stop_ms / 1e3, (stop_ms + of_one_ms) / 1e3))
        stop_ms += of_one_ms
    timings_s = {span.stage: span.stop_s - span.start_s for span in spans}
    collected.update(replace(known_result(0), spans=tuple(spans), timings_s=timings_s))
    assert collected.verdict(period_s=0.1).endswith(f"; --pipeline.detection.modalities {advice}")
