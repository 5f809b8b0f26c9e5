"""Calibration of LiDAR and camera under known errors: what is found again, and what is noticed while driving."""

import time
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.studies.report import RESULTS, formatted_table, publish
from perception.cli.progress import frame_progress_bar
from perception.errors import PerceptionError
from perception.types import Float64, Frame

if TYPE_CHECKING:
    from data.calibration_files import CalibratedFrames
    from data.recorded_drive import RecordedDrive
    from perception.health.miscalibration import MiscalibrationMonitor

_AXES = ("pitch", "yaw", "roll", "right", "down", "ahead")
_ROTATIONS_DEG = (0.0, 0.5, 1.0, 2.0, 4.0)
_TRANSLATION_M = 0.05
_RESTART_EVERY = 22  # frames, after which the monitor begins anew with a wrong calibration
# Frames before the first error amid a drive, and for which each is watched.
_LEARNED, _CHANGED_EVERY = 50, 26
_RANDOM_AXES = 3


class _Watch:
    """Whether monitors notice one error, each from the frame on in which it begins."""

    def __init__(self, error: Float64) -> None:
        from perception.geometry.se3 import from_motion_vector

        self._error_SE3_cam = from_motion_vector(error)
        self._monitor: MiscalibrationMonitor | None = None
        self._frames = self._within = self._starts = 0
        self._delays: list[int] = []

    def begin(self, monitor: "MiscalibrationMonitor", within: int) -> None:
        """Watch a monitor from now on, which has not met the error, for some frames."""
        self._monitor, self._frames, self._within = monitor, 0, within
        self._starts += 1

    def update(self, frame: Frame, world_SE3_velo: Float64) -> None:
        """Give the monitor a frame with the error, until it notices."""
        from perception.health.miscalibration import corrected

        if self._monitor is None or self._frames == self._within:
            return
        self._frames += 1
        if self._monitor.update(corrected(frame, self._error_SE3_cam), world_SE3_velo):
            self._delays.append(self._frames)
            self._monitor = None

    @property
    def cells(self) -> tuple[int, int, float]:
        """Starts, how many of them were noticed, and the median delay in frames."""
        delay = float(np.median(self._delays)) if self._delays else float("nan")
        return self._starts, len(self._delays), delay


class _Watches:
    """Errors that are there from the start of the monitor on, and others that begin amid a drive."""

    def __init__(self, drive: "RecordedDrive") -> None:
        from perception.health.miscalibration import MiscalibrationMonitor
        from perception.localization.frame_registration import FrameRegistration

        self._drive, self._registration = drive, FrameRegistration()
        self._clean = MiscalibrationMonitor(drive.sensor)
        self.none = _Watch(np.zeros(6))
        self.none.begin(MiscalibrationMonitor(drive.sensor), len(drive))
        self.from_start = {name: _Watch(error) for name, error in _errors()}
        self.amid = {name: _Watch(error) for name, error in _errors()}

    def update(self, index: int) -> None:
        """Give all monitors a frame; those whose time has come begin with it, where enough frames are left."""
        from perception.health.miscalibration import MiscalibrationMonitor

        frame, left = self._drive[index], len(self._drive) - index
        pose = self._registration.update(frame)
        if index % _RESTART_EVERY == 0 and left >= _RESTART_EVERY:
            for watch in self.from_start.values():
                watch.begin(MiscalibrationMonitor(self._drive.sensor), _RESTART_EVERY)
        since = index - _LEARNED
        if since >= 0 and since % _CHANGED_EVERY == 0 and left >= _CHANGED_EVERY:
            for watch in self.amid.values():
                watch.begin(deepcopy(self._clean), _CHANGED_EVERY)
        for watch in (self.none, *self.from_start.values(), *self.amid.values()):
            watch.update(frame, pose)
        self._clean.update(frame, pose)


def calibration(
    drive: Path,
    *,
    sequence: str | None = None,
    sensor: str | None = None,
    frames: int = 40,
    seed: int = 0,
    out: Path = RESULTS / "calibration.json",
) -> None:
    """Make known errors in a drive's calibration; print how they are found again and noticed.

    Example: trifuse study calibration kitti/tracking --sequence 0000

    Args:
        drive: Folder of a drive with a camera.
        sequence: Sequence of a tracking folder.
        sensor: LiDAR model by name; else that of the drive.
        frames: Number of frames for the recalibration, spread evenly.
        seed: Seed of the axes of the errors.
        out: JSON file with the numbers.
    """
    from data.calibration_files import read_calibrated_frames
    from data.layouts import OpenConfig
    from data.open_drive import open_drive

    opened = open_drive(drive, sequence=sequence, config=OpenConfig(sensor=sensor))
    read = read_calibrated_frames(opened, frames, frame_progress_bar(opened.name, delay_s=0))
    accuracy_columns = {"rotation [deg]": ".2f", "translation [cm]": ".1f", "CPU [s]": ".1f"}
    found = dict(_recalibrated(read, opened, np.random.default_rng(seed)))
    tables = {
        "recalibration": formatted_table(
            f"{opened.name}: difference from the drive's calibration",
            "error made",
            accuracy_columns,
            found,
        )
    }
    if opened.is_sequence:
        watches = _Watches(opened)
        for index in frame_progress_bar("monitor", delay_s=0)(range(len(opened))):
            watches.update(index)
        columns = {"starts": "d", "noticed": "d", "median delay [frames]": ".0f"}
        of_start = {"none": watches.none, **watches.from_start}
        for table, when, watched in (
            ("monitor", f"noticed within {_RESTART_EVERY} frames", of_start),
            (
                "changes",
                f"made amid the drive, noticed within {_CHANGED_EVERY} frames",
                watches.amid,
            ),
        ):
            cells = {name: watch.cells for name, watch in watched.items()}
            title = f"{opened.name}: {when}"
            tables[table] = formatted_table(title, "error made", columns, cells)
    publish(
        out, "Calibration", tables, {"drive": opened.name, "frames": len(read.edges), "seed": seed}
    )


def _errors() -> Iterator[tuple[str, Float64]]:
    """Yield errors of half a degree and 5 cm along each axis."""
    for axis, name in enumerate(_AXES):
        size, text = (np.radians(0.5), "0.5 deg") if axis < 3 else (_TRANSLATION_M, "5 cm")
        for sign in (1, -1):
            yield f"{name} {'+' if sign > 0 else '-'}{text}", sign * size * np.eye(6)[axis]


def _recalibrated(
    read: "CalibratedFrames", drive: "RecordedDrive", rng: np.random.Generator
) -> Iterator[tuple[str, tuple[float, float, float]]]:
    """Yield what is left of errors of several sizes, by edges, each the worst of some axes."""
    from perception.calibration.recalibration import recalibrate
    from perception.geometry.se3 import from_motion_vector, inverse, rotation_angle_rad

    stated = read.calibration.cam_SE3_velo
    for angle_deg in _ROTATIONS_DEG:
        worst = np.zeros(3)
        for _ in range(_RANDOM_AXES if angle_deg else 1):
            axis, along = rng.standard_normal((2, 3))
            turn = np.radians(angle_deg) * axis / np.linalg.norm(axis)
            shift = (0.1 if angle_deg else 0.0) * along / np.linalg.norm(along)
            off = from_motion_vector(np.concatenate([turn, shift]))
            wrong = [replace(one, cam_SE3_velo=off @ stated) for one in read.edges]
            tracks = [one.with_calibration(off @ stated) for one in read.tracks]
            start_s = time.process_time()
            try:
                found = recalibrate(wrong, drive.sensor, tracks=tracks)
                left = found.cam_SE3_velo @ inverse(stated)
            except PerceptionError:
                worst[:] = np.nan
                continue
            used_s = time.process_time() - start_s
            left_deg, left_m = np.degrees(rotation_angle_rad(left)), np.linalg.norm(left[:3, 3])
            worst = np.maximum(worst, np.array([left_deg, 100 * left_m, used_s]))
        yield (
            f"{angle_deg:g} deg, {10 if angle_deg else 0} cm",
            (float(worst[0]), float(worst[1]), float(worst[2])),
        )
