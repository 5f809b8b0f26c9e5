"""`trifuse study`: the studies of ground and obstacles (chapter 5), as commands."""

from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.studies.dense_cloud import study_dense_cloud
from benchmarks.studies.drives import scan_bar, study_drive
from benchmarks.studies.gates import study_gates
from benchmarks.studies.ground_error import GroundErrorConfig, study_ground_error
from benchmarks.studies.masks import study_masks
from benchmarks.studies.report import RESULTS, publish
from benchmarks.studies.speed import SpeedConfig, study_speed
from benchmarks.studies.stages import study_stages
from perception.cli.flags import require_positive


def ground_error(
    drive: str,
    sequence: str | None = None,
    frames: int | None = None,
    every: int = 4,
    seed: int = 0,
    out: Path = RESULTS / "ground-error.png",
) -> None:
    """Measure the thesis' ground over merged scans m and slice width η, each 2 to 10 (Fig. 7.1).

    Example: trifuse study ground-error kitti/tracking --sequence 0000 --every 1

    Args:
        drive: a labelled drive: a KITTI tracking folder, or the word synthetic.
        sequence: which one, where there are several.
        frames: at most so many from the start.
        every: measure in each such frame; all are registered.
        seed: of RANSAC.
        out: the picture; the numbers are written beside it.
    """
    require_positive("--every", every)
    config = GroundErrorConfig(every=every, frames=frames, seed=seed)
    opened = study_drive(drive, sequence)
    count = len(opened) if frames is None else min(frames, len(opened))
    publish(study_ground_error(opened, out, config, partial(scan_bar, total=count)), out)


def speed(
    drive: str,
    sequence: str | None = None,
    frames: int = 5,
    out: Path = RESULTS / "speed.png",
) -> None:
    """Measure frames a second over merged scans m and voxel size, thesis beside default (Fig. 7.3).

    Example: trifuse study speed synthetic --frames 3

    Args:
        drive: any drive with INS, or the word synthetic.
        sequence: which one, where there are several.
        frames: measured, after the ten that fill the longest window.
        out: the picture; the numbers are written beside it.
    """
    require_positive("--frames", frames)
    config = SpeedConfig(frames=frames)
    publish(study_speed(study_drive(drive, sequence), out, config, scan_bar), out)


def stages(
    drive: str,
    sequence: str | None = None,
    frames: int = 10,
    out: Path = RESULTS / "stages.png",
) -> None:
    """Measure the share of time of each stage: published, repeated, and by default (Table 7.3).

    Example: trifuse study stages synthetic

    Args:
        drive: any drive with INS, or the word synthetic.
        sequence: which one, where there are several.
        frames: measured, after those that fill the window.
        out: the picture; the numbers are written beside it.
    """
    require_positive("--frames", frames)
    publish(study_stages(study_drive(drive, sequence), out, frames=frames, progress=scan_bar), out)


def dense_cloud(
    drive: str,
    sequence: str | None = None,
    frame: int | None = None,
    previous_scans: int = 6,
    at: tuple[float, float] | None = None,
    out: Path = RESULTS / "dense-cloud.png",
) -> None:
    """Draw a pole in the merged cloud, by INS alone and after registration (Fig. 5.2).

    Example: trifuse study dense-cloud kitti/raw/2011_09_26/2011_09_26_drive_0005_sync --frame 77

    Args:
        drive: any drive with INS, or the word synthetic.
        sequence: which one, where there are several.
        frame: the newest scan; else the middle of the drive.
        previous_scans: m, how many scans before it are merged.
        at: x and y of the object in metres; else the most isolated pole.
        out: the picture; the numbers are written beside it.
    """
    require_positive("--previous_scans", previous_scans)
    place_m = None if at is None else np.array(at)
    publish(
        study_dense_cloud(
            study_drive(drive, sequence),
            out,
            frame=frame,
            previous_scans=previous_scans,
            place_m=place_m,
        ),
        out,
    )


def gates(
    drive: str,
    sequence: str | None = None,
    frame: int | None = None,
    previous_scans: int = 6,
    seed: int = 0,
    out: Path = RESULTS / "gates.png",
) -> None:
    """Draw the gates and planes of the thesis' ground from the side (Figs 5.4, 5.5).

    Example: trifuse study gates synthetic

    Args:
        drive: any drive, or the word synthetic.
        sequence: which one, where there are several.
        frame: the newest scan; else the middle of the drive.
        previous_scans: m, how many scans before it are merged.
        seed: of RANSAC.
        out: the picture; the numbers are written beside it.
    """
    require_positive("--previous_scans", previous_scans)
    opened = study_drive(drive, sequence)
    study = study_gates(opened, out, frame=frame, previous_scans=previous_scans, seed=seed)
    publish(study, out)


def masks(
    drive: str,
    sequence: str | None = None,
    frame: int | None = None,
    previous_scans: int = 6,
    seed: int = 0,
    out: Path = RESULTS / "masks.png",
) -> None:
    """Draw the counters, their ratio, and the static and moving masks (Fig. 5.6).

    Example: trifuse study masks synthetic --frame 30

    Args:
        drive: any drive, or the word synthetic.
        sequence: which one, where there are several.
        frame: the newest scan; else the middle of the drive.
        previous_scans: m, how many scans before it are merged.
        seed: of RANSAC.
        out: the picture; the numbers are written beside it.
    """
    require_positive("--previous_scans", previous_scans)
    opened = study_drive(drive, sequence)
    study = study_masks(opened, out, frame=frame, previous_scans=previous_scans, seed=seed)
    publish(study, out)


COMMANDS = {
    "ground-error": ground_error,
    "speed": speed,
    "stages": stages,
    "dense-cloud": dense_cloud,
    "gates": gates,
    "masks": masks,
}
