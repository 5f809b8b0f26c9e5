"""Frames a second over the number of merged scans m and the voxel size υ (Fig. 7.3)."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.studies.chain_times import (
    Progress,
    ThesisCase,
    frames_per_s,
    time_default,
    time_thesis,
)
from benchmarks.studies.report import Study
from perception.cli.table import Cell, format_table
from perception.render.plots import Curve, plot_curves
from perception.types import Drive, Float64


@dataclass(frozen=True)
class SpeedConfig:
    """What to measure.

    Attributes:
        previous_scans: values of m.
        voxel_sizes_m: values of υ, for the thesis' method.
        frames: measured, after those that fill the longest window.
    """

    previous_scans: Sequence[int] = (2, 4, 6, 8, 10)
    voxel_sizes_m: Sequence[float] = (0.05, 0.1, 0.2, 0.4)
    frames: int = 5


def study_speed(drive: Drive, plot_path: Path, config: SpeedConfig, progress: Progress) -> Study:
    """Time the thesis' method for each pair, the default method for each m, and draw the curves."""
    cases = [ThesisCase(m, size) for size in config.voxel_sizes_m for m in config.previous_scans]
    measured = time_thesis(drive, cases, config.frames, progress)
    across = (len(config.voxel_sizes_m), len(config.previous_scans))
    thesis = np.array([frames_per_s(measured[case]) for case in cases]).reshape(across)
    longest = max(config.previous_scans)
    default = np.array(
        [
            frames_per_s(time_default(drive, m, longest, config.frames, progress))
            for m in config.previous_scans
        ]
    )
    title = f"Speed over merged scans and voxel size, {drive.name}, {config.frames} frames"
    curves = [
        Curve(f"thesis, υ = {100 * size:g} cm", config.previous_scans, speeds)
        for size, speeds in zip(config.voxel_sizes_m, thesis, strict=True)
    ]
    curves.append(Curve("default, υ = 10 cm", config.previous_scans, default, is_emphasised=True))
    plot_curves(plot_path, title, curves, ("merged scans before the newest, m", "frames/s"))
    return Study(
        name="speed",
        repeats="Fig. 7.3",
        table=_table(title, config, thesis, default),
        numbers={"thesis_frames_per_s": thesis, "default_frames_per_s": default},
        conditions={
            "drive": drive.name,
            "plan": config,
            "timing": "stages alone, reading left out",
        },
    )


def _table(title: str, config: SpeedConfig, thesis: Float64, default: Float64) -> str:
    names = [f"thesis, υ = {100 * size:g} cm" for size in config.voxel_sizes_m]
    rows: list[list[Cell]] = [
        [name, *(f"{speed:.2f}" for speed in speeds)]
        for name, speeds in zip([*names, "default"], [*thesis, default], strict=True)
    ]
    return format_table(title, ("frames/s", *(f"m = {m}" for m in config.previous_scans)), rows)
