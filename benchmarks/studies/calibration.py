"""Calibration of LiDAR and camera under known errors: what is found again, and what is noticed while driving."""

from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.studies.report import RESULTS, formatted_table, publish
from perception.errors import PerceptionError
from perception.sensor import LidarModel
from perception.types import Float64, Frame

if TYPE_CHECKING:
    from data.recorded_drive import RecordedDrive
    from perception.calibration.frame_edges import FrameEdges

_AXES = ("pitch", "yaw", "roll", "right", "down", "ahead")
_ROTATIONS_DEG = (0.0, 0.5, 1.0, 2.0, 4.0)
_TRANSLATION_M = 0.05
_RESTART_EVERY = 22  # frames, after which the monitor begins anew with a wrong calibration
_LEARNED, _CHANGED_EVERY = (
    50,
    26,
)  # frames before the first error amid a drive, and for which each is watched
_RANDOM_AXES = 3


class _Watch:
    """The monitor on one error, which begins anew every few frames; without an error never."""

    def __init__(self, sensor: LidarModel, error: Float64) -> None:
        from perception.calibration.edge_alignment import offset_SE3

        self._sensor, self._error_SE3_cam, self._restarts = sensor, offset_SE3(error), error.any()
        self.starts, self.delays = 0, list[int]()
        self._begin()

    def _begin(self) -> None:
        from perception.health.miscalibration import MiscalibrationMonitor

        self._monitor, self._frames, self._is_done = MiscalibrationMonitor(self._sensor), 0, False

    def update(self, frame: Frame) -> None:
        """Give the monitor a frame with the error."""
        self._frames += 1
        pose = frame.world_SE3_velo if frame.world_SE3_velo is not None else np.eye(4)
        from perception.health.miscalibration import corrected

        found = self._monitor.update(corrected(frame, self._error_SE3_cam), pose)
        if found and not self._is_done:
            self.delays.append(self._frames)
            self._is_done = True
        if self._restarts and self._frames == _RESTART_EVERY:
            self.starts += 1
            self._begin()

    @property
    def cells(self) -> tuple[int, int, float]:
        """Starts, how many of them were noticed, and the median delay in frames."""
        starts = self.starts if self._restarts else 1
        delay = float(np.median(self.delays)) if self.delays else float("nan")
        return starts, min(len(self.delays), starts), delay


class _Changes:
    """The monitor of a clean drive, of which copies meet an error every few frames."""

    def __init__(self, sensor: LidarModel, errors: Mapping[str, Float64]) -> None:
        from perception.calibration.edge_alignment import offset_SE3
        from perception.health.miscalibration import MiscalibrationMonitor

        self._monitor = MiscalibrationMonitor(sensor)
        self._errors = {name: offset_SE3(error) for name, error in errors.items() if error.any()}
        self._frames = 0
        self._copies: dict[str, MiscalibrationMonitor] = {}
        self.starts = 0
        self.delays: dict[str, list[int]] = {name: [] for name in self._errors}

    def update(self, frame: Frame) -> None:
        """Give the monitor a frame, and its copies the same with their errors."""
        from perception.health.miscalibration import corrected

        pose = frame.world_SE3_velo if frame.world_SE3_velo is not None else np.eye(4)
        since = (self._frames - _LEARNED) % _CHANGED_EVERY
        if self._frames >= _LEARNED and since == 0:
            self._copies = {name: deepcopy(self._monitor) for name in self._errors}
        for name, monitor in list(self._copies.items()):
            if monitor.update(corrected(frame, self._errors[name]), pose):
                self.delays[name].append(since + 1)
                del self._copies[name]
        self._monitor.update(frame, pose)
        self._frames += 1
        if self._frames > _LEARNED and since == _CHANGED_EVERY - 1:
            self.starts += 1

    @property
    def cells(self) -> dict[str, tuple[int, int, float]]:
        """Starts, how many of them were noticed, and the median delay in frames, of each error."""
        return {
            name: (
                self.starts,
                min(len(delays), self.starts),
                float(np.median(np.array(delays, float)) if delays else np.nan),
            )
            for name, delays in self.delays.items()
        }


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
    from perception.cli.progress import frame_progress_bar

    opened = open_drive(drive, sequence=sequence, config=OpenConfig(sensor=sensor))
    read = read_calibrated_frames(opened, frames, frame_progress_bar(opened.name, delay_s=0))
    accuracy_columns = {"rotation [deg]": ".2f", "translation [cm]": ".1f", "CPU [s]": ".1f"}
    found = dict(_recalibrated(read.edges, opened, np.random.default_rng(seed)))
    tables = {
        "recalibration": formatted_table(
            f"{opened.name}: difference from the drive's calibration",
            "error made",
            accuracy_columns,
            found,
        )
    }
    if opened.is_sequence:
        watches = {name: _Watch(opened.sensor, error) for name, error in _errors()}
        changes = _Changes(opened.sensor, dict(_errors()))
        for index in frame_progress_bar("monitor", delay_s=0)(range(len(opened))):
            frame = opened[index]
            for watch in watches.values():
                watch.update(frame)
            changes.update(frame)
        columns = {"starts": "d", "noticed": "d", "median delay [frames]": ".0f"}
        tables["monitor"] = formatted_table(
            f"{opened.name}: noticed within {_RESTART_EVERY} frames",
            "error made",
            columns,
            {name: watch.cells for name, watch in watches.items()},
        )
        tables["changes"] = formatted_table(
            f"{opened.name}: made amid the drive, noticed within {_CHANGED_EVERY} frames",
            "error made",
            columns,
            changes.cells,
        )
    publish(
        out, "Calibration", tables, {"drive": opened.name, "frames": len(read.edges), "seed": seed}
    )


def _errors() -> Iterator[tuple[str, Float64]]:
    """Yield errors of half a degree and 5 cm along each axis, and none."""
    yield "none", np.zeros(6)
    for axis, name in enumerate(_AXES):
        size, text = (np.radians(0.5), "0.5 deg") if axis < 3 else (_TRANSLATION_M, "5 cm")
        for sign in (1, -1):
            yield f"{name} {'+' if sign > 0 else '-'}{text}", sign * size * np.eye(6)[axis]


def _recalibrated(
    edges: "Sequence[FrameEdges]", drive: "RecordedDrive", rng: np.random.Generator
) -> Iterator[tuple[str, tuple[float, float, float]]]:
    """Yield what is left of errors of several sizes, by edges, each the worst of some axes."""
    import time

    from perception.calibration.edge_alignment import offset_SE3
    from perception.calibration.recalibration import recalibrate
    from perception.geometry.se3 import inverse, rotation_angle_rad

    stated = edges[0].cam_SE3_velo
    for angle_deg in _ROTATIONS_DEG:
        worst = np.zeros(3)
        for _ in range(_RANDOM_AXES if angle_deg else 1):
            axis, along = rng.standard_normal((2, 3))
            turn = np.radians(angle_deg) * axis / np.linalg.norm(axis)
            shift = (0.1 if angle_deg else 0.0) * along / np.linalg.norm(along)
            off = offset_SE3(np.concatenate([turn, shift]))
            wrong = [replace(one, cam_SE3_velo=off @ stated) for one in edges]
            start_s = time.process_time()
            try:
                left = recalibrate(wrong, drive.sensor).cam_SE3_velo @ inverse(stated)
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
