"""Which stage takes which share of the time (Table 7.3): as published, repeated, and by default."""

from pathlib import Path

from benchmarks.studies.chain_times import (
    DENSE_CLOUD,
    GROUND,
    MOTION,
    VOXELS,
    Progress,
    ThesisCase,
    Times,
    mean_times_s,
    time_default,
    time_thesis,
)
from benchmarks.studies.report import Study
from perception.cli.table import Cell, format_table
from perception.render.plots import plot_shares
from perception.types import Drive

_PUBLISHED = {DENSE_CLOUD: 83.2, GROUND: 7.1, VOXELS: 7.7, MOTION: 2.0}


def study_stages(drive: Drive, plot_path: Path, *, frames: int, progress: Progress) -> Study:
    """Time every stage on the same frames, and draw the shares."""
    case = ThesisCase()
    thesis = mean_times_s(time_thesis(drive, [case], frames, progress)[case])
    default = mean_times_s(time_default(drive, 6, case.previous_scans, frames, progress))
    title = f"Share of time by stage, {drive.name}, {frames} frames, m = {case.previous_scans}"
    bars = {
        "thesis, published\n(MATLAB, 0.3 frames/s)": _PUBLISHED,
        f"thesis' method here\n{_total(thesis)}": thesis,
        f"default method\n{_total(default)}": default,
    }
    plot_shares(plot_path, title, bars)
    published: list[list[Cell]] = [
        [f"published: {stage}", None, f"{share:.1f}"] for stage, share in _PUBLISHED.items()
    ]
    rows = [*published, *_rows("thesis", thesis), *_rows("default", default)]
    return Study(
        name="stages",
        repeats="Table 7.3",
        table=format_table(title, ("stage", "mean [ms]", "share [%]"), rows),
        numbers={"published_percent": _PUBLISHED, "thesis_s": thesis, "default_s": default},
        conditions={"drive": drive.name, "frames": frames, "case": case},
    )


def _total(times: Times) -> str:
    return f"{1e3 * sum(times.values()):.0f} ms, {1 / sum(times.values()):.1f} frames/s"


def _rows(method: str, times: Times) -> list[list[Cell]]:
    total_s = sum(times.values())
    return [
        [f"{method}: {stage}", f"{1e3 * seconds:.1f}", f"{100 * seconds / total_s:.1f}"]
        for stage, seconds in {**times, "all": total_s}.items()
    ]
