"""How long the stages took over many frames, for people and for programs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from perception.pipeline.clock import relative_to_start
from perception.types import Result, StageSpan

STAGE_HEADER = ("stage", "median ms", "99 % ms", "share %")
_FRAME = "first to last stage"


def stage_rows(seconds: Mapping[str, Sequence[float]]) -> list[list[str]]:
    """Return stage, median, 99th percentile and share, all stages together last.

    Args:
        seconds: by stage, one entry a frame; NaN where a stage had nothing to do.
    """
    stages = {name: np.array(of_stage) for name, of_stage in seconds.items()}
    total = np.nansum(list(stages.values()), axis=0)
    return [
        [name, *_median_and_p99(of_stage), f"{100 * np.nansum(of_stage) / total.sum():.0f}"]
        for name, of_stage in [*stages.items(), ("all stages", total)]
    ]


def stage_metrics(seconds: Mapping[str, Sequence[float]]) -> dict[str, dict[str, float]]:
    """Return the same figures by stage; none of no frames."""
    return {
        name: {"median": float(median), "p99": float(p99), "share_percent": float(share)}
        for name, median, p99, share in (stage_rows(seconds) if seconds else [])
    }


def median_frame_s(seconds: Mapping[str, Sequence[float]]) -> float:
    """Return the median over the frames of the time of all stages."""
    return float(np.median(np.nansum(list(seconds.values()), axis=0)))


@dataclass
class StageTimes:
    """When every stage of every frame ran.

    Attributes:
        seconds: by stage, one entry a frame; NaN where it had nothing to do.
        frames_s: from the begin of each frame's first stage to the end of its last; NaN where it is not known.
        spans: of each frame, since the first stage began.
    """

    seconds: dict[str, list[float]] = field(default_factory=dict)
    frames_s: list[float] = field(default_factory=list)
    spans: list[tuple[StageSpan, ...]] = field(default_factory=list)

    def add(self, result: Result) -> None:
        """Take in one frame."""
        before = len(self.spans)
        for stage in dict.fromkeys([*self.seconds, *result.timings_s]):
            of_stage = self.seconds.setdefault(stage, [np.nan] * before)
            of_stage.append(result.timings_s.get(stage, np.nan))
        spans = relative_to_start(result.spans)
        self.frames_s.append(max((span.stop_s for span in spans), default=np.nan))
        self.spans.append(spans)

    def rows(self) -> list[list[str]]:
        """Return the rows of a table, the whole frame last: stages that overlap take less than their sum."""
        return [*stage_rows(self.seconds), [_FRAME, *_median_and_p99(self.frames_s), ""]]

    def to_json(self) -> dict[str, dict[str, float]]:
        """Return the same figures by stage; none of no frames."""
        if not self.spans:
            return {}
        median, p99 = map(float, _median_and_p99(self.frames_s))
        return stage_metrics(self.seconds) | {_FRAME: {"median": median, "p99": p99}}

    def typical(self) -> tuple[StageSpan, ...]:
        """Return when the stages ran in the frame that takes as long as most, among those with all stages."""
        most = max(map(len, self.spans))
        whole = [spans for spans in self.spans if len(spans) == most]
        whole.sort(key=lambda spans: max(span.stop_s for span in spans))
        return whole[len(whole) // 2]


def _median_and_p99(seconds: Sequence[float]) -> tuple[str, str]:
    return f"{1e3 * np.nanmedian(seconds):.1f}", f"{1e3 * np.nanpercentile(seconds, 99):.1f}"
