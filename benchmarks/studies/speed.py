"""Frames per second over the number of merged scans m and the voxel size υ (Fig. 7.3)."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

from benchmarks.studies.report import RESULTS, DriveOfStudy, formatted_table, publish
from benchmarks.studies.stages import (
    PUBLISHED_FRAMES_PER_S,
    chain_config,
    frames_per_s,
    stage_times,
)
from perception.cli.flags import require_positive
from perception.render.curve_plots import Curve, CurvePanel, plot_curves

_PUBLISHED_SCANS = 6  # m of Table 7.1


@dataclass(frozen=True)
class SpeedConfig(DriveOfStudy):
    """Drive and measured settings.

    Attributes:
        previous_scans: Values of m, the number of merged scans before the newest.
        voxel_sizes_m: Values of υ in metres, for the thesis' method.
        frames: Number of measured frames, after those that fill the longest window.
    """

    previous_scans: tuple[int, ...] = (2, 4, 6, 8, 10)
    voxel_sizes_m: tuple[float, ...] = (0.05, 0.1, 0.2, 0.4)
    frames: int = 5

    def __post_init__(self) -> None:
        """Validate the number of frames."""
        require_positive("--frames", self.frames)


def speed(drive: str, *, config: SpeedConfig, out: Path = RESULTS / "speed.png") -> None:
    """Measure frames per second over merged scans m and voxel size, thesis and default (Fig. 7.3).

    Example: trifuse study speed synthetic --frames 3

    Args:
        drive: Folder of a drive with INS, or the word synthetic.
        out: Figure; a JSON file with the numbers is written beside it.
    """
    opened, scans, frames = config.open(drive), config.previous_scans, config.frames
    methods = {
        f"thesis, υ = {100 * size_m:g} cm": partial(chain_config, "thesis", voxel_size_m=size_m)
        for size_m in config.voxel_sizes_m
    }
    methods["default, υ = 10 cm"] = partial(chain_config, "default")
    speeds = {
        name: [frames_per_s(stage_times(opened, make(m), max(scans), frames)) for m in scans]
        for name, make in methods.items()
    }
    title = f"Speed over merged scans and voxel size, {opened.name}, {frames} frames"
    curves = [
        Curve(name, scans, values, is_emphasised=name.startswith("default"))
        for name, values in speeds.items()
    ]
    # Of the thesis' figure only the speed at the values of Table 7.1 is stated.
    name = "thesis, published, υ = 10 cm"
    published = [PUBLISHED_FRAMES_PER_S if m == _PUBLISHED_SCANS else None for m in scans]
    curves.append(Curve(name, [_PUBLISHED_SCANS], [PUBLISHED_FRAMES_PER_S]))
    specs = {f"m = {m}": ".2f" for m in scans}
    panel = CurvePanel("", "merged scans before the newest, m", "frames/s", curves)
    plot_curves(out, title, [panel])
    publish(
        out,
        "Fig. 7.3",
        {"frames_per_s": formatted_table(title, "frames/s", specs, {**speeds, name: published})},
        {
            "drive": opened.name,
            "config": config,
            "timing": "stages alone, reading and monitors left out",
        },
    )
