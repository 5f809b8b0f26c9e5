"""Time of each stage over many frames."""

from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from perception.evaluation.report import Column, Table
from perception.types import Result, StageSpan, relative_to_start

Key = TypeVar("Key")

ALL_STAGES = "all stages"
END_TO_END = "end to end"

_DEPTHCN, _RGB, _BEV = "DepthCN", "rgb detector", "bev detector"
_MAPS = ("dm detector", "rm detector", "maps", "fusion")
_NO_DEPTHCN = "--pipeline.detection.depthcn.no-enabled"
_MODALITIES = "--pipeline.detection.modalities"
# What makes a frame cheaper, the smallest loss first: flags, what they leave out, its stages, and the one they keep.
_SAVINGS: Sequence[tuple[str, str, tuple[str, ...], str | None]] = (
    ("", "DepthCN", (), None),
    (f"{_MODALITIES} rgb", "all detectors but that of the image", (*_MAPS, _BEV), _RGB),
    (f"{_MODALITIES} bev", "all detectors but that from above", (*_MAPS, _RGB), _BEV),
    (
        f"{_MODALITIES} []",
        "all detectors of vehicles",
        (*_MAPS, _RGB, _BEV, "vehicle location", "vehicles"),
        None,
    ),
)


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
    """Collects when every stage of every frame ran: 24 bytes a stage and frame.

    Attributes:
        seconds: By stage, one entry a frame, NaN where the stage did not run.
        frames_s: Time from the start of the first stage to the end of the last, NaN where it is unknown.
        starts_s: By stage and worker, one entry a frame, from the start of the first stage.
        stops_s: The same of the ends.
    """

    seconds: dict[str, "array[float]"] = field(default_factory=dict)
    frames_s: "array[float]" = field(default_factory=lambda: array("d"))
    starts_s: dict[tuple[str, str], "array[float]"] = field(default_factory=dict)
    stops_s: dict[tuple[str, str], "array[float]"] = field(default_factory=dict)

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.frames_s)

    def update(self, result: Result) -> None:
        """Add one frame."""
        before = len(self)
        spans = relative_to_start(result.spans)
        _append(self.seconds, result.timings_s, before)
        _append(self.starts_s, {(one.stage, one.worker): one.start_s for one in spans}, before)
        _append(self.stops_s, {(one.stage, one.worker): one.stop_s for one in spans}, before)
        self.frames_s.append(result.duration_s)

    def table(self, title: str) -> Table[StageTime]:
        """Return the stages, their sum, and the whole frame, which is less than the sum where stages overlap."""
        table = stage_table(title, self.seconds)
        rows = {**table.rows, END_TO_END: StageTime.of(self.frames_s)} if len(self) else {}
        return Table(title, COLUMNS, rows, heading=table.heading)

    def verdict(self, period_s: float) -> str:
        """Return one line: the time of a frame, and whether the pipeline keeps up with the sensor.

        Where it does not, the line names the flags with which it would, if the stages that they leave out are a large
        enough share of the time of all.

        Args:
            period_s: Time from one scan to the next in seconds.
        """
        rows, period_ms = self.table("").rows, 1e3 * period_s
        whole, rate = rows[END_TO_END], f"scans at {1 / period_s:.3g} Hz"
        line = f"pipeline: {whole.p50_ms:.0f} ms/frame at the median, {whole.p99_ms:.0f} ms at p99"
        if whole.p99_ms <= period_ms:
            return f"{line}: keeps up with {rate}"
        late = np.nanmean(np.asarray(self.frames_s) > period_s)
        line += f": too slow for {rate} in {100 * late:.0f} % of the frames"
        without = [_NO_DEPTHCN] if _DEPTHCN in rows else []
        for flags, left_out, stages, kept in _SAVINGS:
            shares = [
                rows[name].share_percent or 0.0 for name in (_DEPTHCN, *stages) if name in rows
            ]
            is_less = whole.p99_ms * (1 - sum(shares) / 100) <= period_ms
            if is_less and (kept is None or kept in rows):
                named = " ".join([*without, flags]).strip()
                return f"{line}; {named} would keep up, and leaves out {left_out}"
        return f"{line}; no flag makes this machine keep up"

    def typical(self) -> tuple[StageSpan, ...]:
        """Return the spans of the frame with the median duration among those in which most stages ran."""
        starts_s = np.reshape([*self.starts_s.values()], (-1, len(self)))
        counts = np.isfinite(starts_s).sum(axis=0)
        complete = np.flatnonzero(counts == counts.max(initial=0))
        ordered = complete[np.argsort(np.asarray(self.frames_s)[complete], kind="stable")]
        frame = int(ordered[len(ordered) // 2])
        return tuple(
            StageSpan(stage, worker, of_stage[frame], self.stops_s[stage, worker][frame])
            for (stage, worker), of_stage in self.starts_s.items()
            if np.isfinite(of_stage[frame])
        )


def _append(columns: dict[Key, "array[float]"], values: Mapping[Key, float], before: int) -> None:
    """Append the values of a frame to their columns, NaN where there is none."""
    for key in dict.fromkeys([*columns, *values]):
        column = columns.setdefault(key, array("d", [np.nan]) * before)
        column.append(values.get(key, np.nan))


def _totals_s(seconds: Mapping[str, Sequence[float]]) -> Sequence[float]:
    totals: list[float] = np.nansum(list(seconds.values()), axis=0).tolist() if seconds else []
    return totals
