"""`trifuse study`: the studies of what moves and of one object that is followed, as commands."""

from pathlib import Path
from typing import Literal

from benchmarks.studies.drives import scan_bar, study_drive
from benchmarks.studies.ins_error import InsErrorConfig, study_ins_error
from benchmarks.studies.motion_grid import Preset, study_motion_grid
from benchmarks.studies.report import RESULTS, publish
from benchmarks.studies.sensors import SensorsConfig, study_sensors
from benchmarks.studies.single_object import SingleObjectStudyConfig, study_single_object
from data.synthetic.scenarios import TARGET_CLASSES, TargetClass
from perception.cli.evaluations.otd import parse_trackers
from perception.cli.flags import require_positive
from perception.sensor import load_sensor

_TARGET_CLASSES: dict[str, TargetClass] = {kind.lower(): kind for kind in TARGET_CLASSES}


def motion_grid(
    drive: str,
    sequence: str | None = None,
    frame: int | None = None,
    preset: Preset = "thesis",
    out: Path = RESULTS / "motion-grid.png",
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
    opened = study_drive(drive, sequence, images=True)
    publish(study_motion_grid(opened, out, scan_bar, frame=frame, preset=preset), out)


def ins_error(
    frames: int = 80,
    seed: int = 0,
    drives: int = 1,
    sensor: str = "HDL-64E",
    out: Path = RESULTS / "ins-error.png",
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
    require_positive("--frames", frames)
    require_positive("--drives", drives)
    seeds = tuple(range(seed, seed + drives))
    config = InsErrorConfig(frames, seeds, load_sensor(sensor))
    publish(study_ins_error(out, config), out)


def sensors(
    frames: int = 80,
    seed: int = 0,
    drives: int = 1,
    out: Path = RESULTS / "sensors.png",
) -> None:
    """Measure the tracks of moving objects on the same streets by HDL-64E, HDL-32E and VLP-16.

    Example: trifuse study sensors --frames 20

    Args:
        frames: of each synthetic drive.
        seed: of the first drive; the next ones have the numbers after it.
        drives: how many are measured together.
        out: the picture; the numbers are written beside it.
    """
    require_positive("--frames", frames)
    require_positive("--drives", drives)
    seeds = tuple(range(seed, seed + drives))
    publish(study_sensors(out, SensorsConfig(frames, seeds)), out)


def following(
    trackers: str = "default,h-fus,l-fus,3d-ms,3d-kf",
    kind: Literal["car", "cyclist", "pedestrian"] = "car",
    duration: float = 6.0,
    seed: int = 0,
    sensor: str = "HDL-64E",
    out: Path = RESULTS / "following.png",
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
    config = SingleObjectStudyConfig(
        parse_trackers(trackers), _TARGET_CLASSES[kind], duration, seed, load_sensor(sensor)
    )
    publish(study_single_object(out, config), out)


COMMANDS = {
    "motion-grid": motion_grid,
    "ins-error": ins_error,
    "sensors": sensors,
    "following": following,
}
