"""`trifuse study`: the thesis' own studies and those of its claims, a picture and a table each."""

from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
from tqdm import tqdm

from data.drive import Drive
from data.open_drive import open_drive
from data.synthetic.drive import SyntheticDrive
from data.synthetic.scenarios import KINDS, Kind
from perception.cli.evaluations.otd import trackers_named
from perception.cli.studies import detectors
from perception.cli.studies.augmentation import AugmentationPlan, study_augmentation
from perception.cli.studies.dense_cloud import study_dense_cloud
from perception.cli.studies.following import FollowingPlan, study_following
from perception.cli.studies.gates import study_gates
from perception.cli.studies.ground_error import GroundErrorPlan, study_ground_error
from perception.cli.studies.ins_error import InsErrorPlan, study_ins_error
from perception.cli.studies.masks import study_masks
from perception.cli.studies.motion_grid import Preset, study_motion_grid
from perception.cli.studies.output import publish
from perception.cli.studies.sensors import SensorsPlan, study_sensors
from perception.cli.studies.speed import SpeedPlan, study_speed
from perception.cli.studies.stages import study_stages
from perception.cli.training.trainer_choice import listed
from perception.cli.training.verifier_plan import VerifierData
from perception.errors import UsageError
from perception.sensor import sensor_named
from perception.types import Frame, Method

_RESULTS = Path("results") / "study"
_SYNTHETIC_FRAMES = 40
_KINDS: dict[str, Kind] = {kind.lower(): kind for kind in KINDS}


def ground_error(
    drive: str,
    sequence: str | None = None,
    frames: int | None = None,
    every: int = 4,
    seed: int = 0,
    out: Path = _RESULTS / "ground-error.png",
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
    plan = GroundErrorPlan(every=_positive("every", every), frames=frames, seed=seed)
    opened = _open(drive, sequence)
    count = len(opened) if frames is None else min(frames, len(opened))
    publish(study_ground_error(opened, out, plan, partial(_bar, total=count)), out)


def speed(
    drive: str,
    sequence: str | None = None,
    frames: int = 5,
    out: Path = _RESULTS / "speed.png",
) -> None:
    """Measure frames a second over merged scans m and voxel size, thesis beside default (Fig. 7.3).

    Example: trifuse study speed synthetic --frames 3

    Args:
        drive: any drive with INS, or the word synthetic.
        sequence: which one, where there are several.
        frames: measured, after the ten that fill the longest window.
        out: the picture; the numbers are written beside it.
    """
    plan = SpeedPlan(frames=_positive("frames", frames))
    publish(study_speed(_open(drive, sequence), out, plan, _bar), out)


def stages(
    drive: str,
    sequence: str | None = None,
    frames: int = 10,
    out: Path = _RESULTS / "stages.png",
) -> None:
    """Measure the share of time of each stage: published, repeated, and by default (Table 7.3).

    Example: trifuse study stages synthetic

    Args:
        drive: any drive with INS, or the word synthetic.
        sequence: which one, where there are several.
        frames: measured, after those that fill the window.
        out: the picture; the numbers are written beside it.
    """
    count = _positive("frames", frames)
    publish(study_stages(_open(drive, sequence), out, frames=count, progress=_bar), out)


def dense_cloud(
    drive: str,
    sequence: str | None = None,
    frame: int | None = None,
    previous_scans: int = 6,
    at: tuple[float, float] | None = None,
    out: Path = _RESULTS / "dense-cloud.png",
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
    place_m = None if at is None else np.array(at)
    publish(
        study_dense_cloud(
            _open(drive, sequence),
            out,
            frame=frame,
            previous_scans=_positive("previous_scans", previous_scans),
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
    out: Path = _RESULTS / "gates.png",
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
    scans = _positive("previous_scans", previous_scans)
    opened = _open(drive, sequence)
    publish(study_gates(opened, out, frame=frame, previous_scans=scans, seed=seed), out)


def masks(
    drive: str,
    sequence: str | None = None,
    frame: int | None = None,
    previous_scans: int = 6,
    seed: int = 0,
    out: Path = _RESULTS / "masks.png",
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
    scans = _positive("previous_scans", previous_scans)
    opened = _open(drive, sequence)
    publish(study_masks(opened, out, frame=frame, previous_scans=scans, seed=seed), out)


def ins_error(
    frames: int = 80,
    seed: int = 0,
    drives: int = 1,
    sensor: str = "HDL-64E",
    out: Path = _RESULTS / "ins-error.png",
) -> None:
    """Measure the tracks of moving objects over the error of the INS, 0 to 1 m and 0 to 2° (7.1.1).

    Example: trifuse study ins-error --frames 20

    Args:
        frames: of each synthetic drive.
        seed: of the first drive; the next ones have the numbers after it.
        drives: how many are measured together.
        sensor: HDL-64E, HDL-32E, VLP-16 or a .json file.
        out: the picture; the numbers are written beside it.
    """
    seeds = tuple(range(seed, seed + _positive("drives", drives)))
    plan = InsErrorPlan(_positive("frames", frames), seeds, sensor_named(sensor))
    publish(study_ins_error(out, plan), out)


def sensors(
    frames: int = 80,
    seed: int = 0,
    drives: int = 1,
    out: Path = _RESULTS / "sensors.png",
) -> None:
    """Measure the tracks of moving objects on the same streets by HDL-64E, HDL-32E and VLP-16.

    Example: trifuse study sensors --frames 20

    Args:
        frames: of each synthetic drive.
        seed: of the first drive; the next ones have the numbers after it.
        drives: how many are measured together.
        out: the picture; the numbers are written beside it.
    """
    seeds = tuple(range(seed, seed + _positive("drives", drives)))
    publish(study_sensors(out, SensorsPlan(_positive("frames", frames), seeds)), out)


def motion_grid(
    drive: str,
    sequence: str | None = None,
    frame: int | None = None,
    preset: Preset = "thesis",
    out: Path = _RESULTS / "motion-grid.png",
) -> None:
    """Draw the 2.5D motion grids: subtraction, suppression, and the things in them (Fig. 5.10).

    Example: trifuse study motion-grid kitti/tracking --sequence 0000 --frame 60

    Args:
        drive: any drive, with or without a camera, or the word synthetic.
        sequence: which one, where there are several.
        frame: the newest scan; else the middle of the drive.
        preset: the values of the thesis' Table 7.4, or those of its author's code.
        out: the picture; the numbers are written beside it.
    """
    opened = _open(drive, sequence, images=True)
    publish(study_motion_grid(opened, out, _bar, frame=frame, preset=preset), out)


def following(
    trackers: str = "default,h-fus,l-fus,3d-ms,3d-kf",
    kind: Literal["car", "cyclist", "pedestrian"] = "car",
    duration: float = 6.0,
    seed: int = 0,
    sensor: str = "HDL-64E",
    out: Path = _RESULTS / "following.png",
) -> None:
    """Measure trackers of one object while it is hidden, turns, changes its pace, or the light changes.

    Example: trifuse study following --kind cyclist --trackers default,h-fus,opencv-kcf

    Args:
        trackers: names with commas between; an unknown one is answered with all.
        kind: what is followed.
        duration: of each scene, in seconds; what happens is stretched with it.
        seed: of the street, of looks and of noise.
        sensor: HDL-64E, HDL-32E, VLP-16 or a .json file.
        out: the picture; the numbers are written beside it.
    """
    plan = FollowingPlan(
        trackers_named(trackers), _KINDS[kind], duration, seed, sensor_named(sensor)
    )
    publish(study_following(out, plan), out)


def augmentation(  # noqa: PLR0913 - flags of a command
    drives: list[Path],
    *,
    validation: Path | list[Path] | None = None,
    method: Method = "thesis",
    epochs: int = 40,
    batch: int = 128,
    seed: int = 0,
    workers: int = 0,
    resume: bool = False,
    cache: Path | None = None,
    out: Path = _RESULTS / "augmentation.png",
) -> None:
    """Train DepthCN's network without and with augmentation; accuracies beside Table 7.8's.

    Example: trifuse study augmentation synth/train --validation synth/val

    Args:
        drives: labelled drives that it learns from.
        validation: drives to judge by, one or [several]; without, a fifth of the frames is kept back.
        method: thesis, the network of Fig. 6.5 with its own schedule, or default.
        epochs: of each of the two trainings.
        batch: samples a step.
        seed: of both.
        workers: processes that make samples.
        resume: go on where this study ended before.
        cache: folder for pictures and candidates of the frames; else the user's cache folder.
        out: the picture; the numbers and both trainings are written beside it.
    """
    data = VerifierData(tuple(drives), listed(validation), batch, workers=workers, cache=cache)
    publish(study_augmentation(data, out, AugmentationPlan(method, epochs, seed, resume)), out)


COMMANDS = {
    "ground-error": ground_error,
    "speed": speed,
    "stages": stages,
    "dense-cloud": dense_cloud,
    "gates": gates,
    "masks": masks,
    "motion-grid": motion_grid,
    "ins-error": ins_error,
    "sensors": sensors,
    "following": following,
    "augmentation": augmentation,
    **detectors.COMMANDS,
}


def _open(drive: str, sequence: str | None, *, images: bool = False) -> Drive:
    """Open a path, or make the synthetic drive."""
    if drive == "synthetic":
        return SyntheticDrive(_SYNTHETIC_FRAMES, images=images)
    return open_drive(Path(drive), sequence=sequence, images=images)


def _positive(name: str, value: int) -> int:
    if value < 1:
        raise UsageError(f"--{name}", expected="at least 1", found=str(value))
    return value


def _bar(frames: Iterable[Frame], total: int | None = None) -> Iterable[Frame]:
    bar: Iterable[Frame] = tqdm(frames, total=total, desc="study", unit="frame", delay=2)
    return bar
