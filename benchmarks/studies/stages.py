"""Share of the time of each stage (Table 7.3): as published, repeated, and by the default method."""

from pathlib import Path

from benchmarks.studies.chain_times import (
    PUBLISHED_FRAMES_PER_S,
    PUBLISHED_PERCENT,
    chain_config,
    mean_times_s,
    stage_times,
)
from benchmarks.studies.report import RESULTS, DriveOfStudy, formatted_table, publish
from perception.cli.flags import require_positive
from perception.render.bar_plots import plot_shares

_SPECS = dict.fromkeys(
    ("published [%]", "thesis [%]", "default [%]", "thesis [ms]", "default [ms]"), ".1f"
)
_PREVIOUS_SCANS = 6  # m of Table 7.1


def stages(
    drive: str,
    *,
    source: DriveOfStudy,
    frames: int = 10,
    out: Path = RESULTS / "stages.png",
) -> None:
    """Measure the share of the time of each stage: published, repeated, and by default (Table 7.3).

    Example: trifuse study stages synthetic

    Args:
        drive: Folder of a drive with INS, or the word synthetic.
        frames: Number of measured frames, after those that fill the window.
        out: Figure; a JSON file with the numbers is written beside it.
    """
    require_positive("--frames", frames)
    opened = source.open(drive)
    thesis, default = (
        mean_times_s(
            stage_times(opened, chain_config(method, _PREVIOUS_SCANS), _PREVIOUS_SCANS, frames)
        )
        for method in ("thesis", "default")
    )
    title = f"Share of time by stage, {opened.name}, {frames} frames, m = {_PREVIOUS_SCANS}"
    bars = {
        f"thesis, published\n(MATLAB, {PUBLISHED_FRAMES_PER_S} frames/s)": PUBLISHED_PERCENT,
        f"thesis' method here\n{_total(thesis)}": thesis,
        f"default method\n{_total(default)}": default,
    }
    plot_shares(out, title, bars)
    sources = [PUBLISHED_PERCENT, thesis, default]
    totals = [sum(source.values()) for source in sources]
    rows = {
        f"({letter}) {stage}": (
            *(100 * source[stage] / total for source, total in zip(sources, totals, strict=True)),
            1e3 * thesis[stage],
            1e3 * default[stage],
        )
        for letter, stage in zip("abcd", PUBLISHED_PERCENT, strict=True)
    }
    rows["all stages"] = (100.0, 100.0, 100.0, 1e3 * totals[1], 1e3 * totals[2])
    publish(
        out,
        "Table 7.3",
        {"stages": formatted_table(title, "stage", _SPECS, rows)},
        {"drive": opened.name, "frames": frames, "previous_scans": _PREVIOUS_SCANS},
    )


def _total(times: dict[str, float]) -> str:
    return f"{1e3 * sum(times.values()):.0f} ms, {1 / sum(times.values()):.1f} frames/s"
