"""Time of each stage over many frames."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from perception.evaluation.report import Column, Table
from perception.types import Result, StageSpan, relative_to_start

ALL_STAGES = "all stages"
END_TO_END = "end to end"


@dataclass(frozen=True)
class StageTime:
    """Time of one stage, rounded as it is printed.

    Attributes:
        p50_ms: Median over the frames.
        p99_ms: 99th percentile over the frames.
        share_percent: Share in the sum over all stages; None where stages overlap.
    """

    p50_ms: float
    p99_ms: float
    share_percent: float | None = None

    @classmethod
    def of(cls, seconds: Sequence[float], total_s: float | None = None) -> "StageTime":
        """Return the time of a stage.

        Args:
            seconds: (F,) one entry a frame, NaN where the stage did not run.
            total_s: Sum over all stages and frames.
        """
        share = None if total_s is None else round(100 * float(np.nansum(seconds)) / total_s)
        p50, p99 = (round(1e3 * float(np.nanpercentile(seconds, q)), 1) for q in (50, 99))
        return cls(p50, p99, share)


COLUMNS = (
    Column[StageTime]("p50 [ms]", lambda row: row.p50_ms, ".1f", "p50"),
    Column[StageTime]("p99 [ms]", lambda row: row.p99_ms, ".1f", "p99"),
    Column[StageTime]("share [%]", lambda row: row.share_percent, ".0f", "share_percent"),
)


def stage_table(title: str, seconds: Mapping[str, Sequence[float]]) -> Table[StageTime]:
    """Return the table of all stages, their sum last; without rows where there are no frames.

    Args:
        title: Title of the table.
        seconds: By stage, one entry a frame, NaN where the stage did not run.
    """
    totals_s = _totals_s(seconds)
    stages = {**seconds, ALL_STAGES: totals_s} if len(totals_s) else {}
    total_s = float(np.sum(totals_s))
    rows = {name: StageTime.of(of_stage, total_s) for name, of_stage in stages.items()}
    return Table(title, COLUMNS, rows, heading="stage")


def median_frame_s(seconds: Mapping[str, Sequence[float]]) -> float:
    """Return the median over the frames of the time of all stages."""
    return float(np.median(_totals_s(seconds)))


@dataclass
class StageTimes:
    """Collects when every stage of every frame ran.

    Attributes:
        seconds: By stage, one entry a frame, NaN where the stage did not run.
        frames_s: Time from the start of the first stage to the end of the last, NaN where it is unknown.
        spans: Spans of each frame, from the start of its first stage.
    """

    seconds: dict[str, list[float]] = field(default_factory=dict)
    frames_s: list[float] = field(default_factory=list)
    spans: list[tuple[StageSpan, ...]] = field(default_factory=list)

    def update(self, result: Result) -> None:
        """Add one frame."""
        before = len(self.spans)
        for stage in dict.fromkeys([*self.seconds, *result.timings_s]):
            of_stage = self.seconds.setdefault(stage, [np.nan] * before)
            of_stage.append(result.timings_s.get(stage, np.nan))
        spans = relative_to_start(result.spans)
        self.frames_s.append(max((span.stop_s for span in spans), default=np.nan))
        self.spans.append(spans)

    def table(self, title: str) -> Table[StageTime]:
        """Return the stages, their sum, and the whole frame, which is less than the sum where stages overlap."""
        table = stage_table(title, self.seconds)
        rows = {**table.rows, END_TO_END: StageTime.of(self.frames_s)} if self.spans else {}
        return Table(title, COLUMNS, rows, heading=table.heading)

    def typical(self) -> tuple[StageSpan, ...]:
        """Return the spans of the frame with the median duration among those in which most stages ran."""
        most = max(map(len, self.spans))
        complete = [spans for spans in self.spans if len(spans) == most]
        complete.sort(key=lambda spans: max(span.stop_s for span in spans))
        return complete[len(complete) // 2]


def _totals_s(seconds: Mapping[str, Sequence[float]]) -> Sequence[float]:
    totals: list[float] = np.nansum(list(seconds.values()), axis=0).tolist() if seconds else []
    return totals
