"""Summary of one tracked object: frames by status, path, speed, time, and errors against its labels."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from perception.evaluation.report import Column, Table
from perception.evaluation.single_object.metrics import (
    SingleObjectMetrics,
    single_object_errors,
    single_object_metrics,
)
from perception.evaluation.single_object.track import PredictedTrack, TrueTrack
from perception.geometry.boxes import transform_boxes
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.types import Calibration, Float64, Result

_KM_H = 3.6  # one metre per second
# Shortest step of a path: shorter ones are noise of a parked object.
_MIN_STEP_M = 0.5


@dataclass
class TrajectorySummary:
    """Predictions of a one-object tracker, added frame by frame.

    Attributes:
        drive: Name of the drive.
        tracker: Name of the tracker.
        object_name: Name of the object.
        out: Folder of the results.
        truth: Labelled track of the object, or None.
        camera: Camera calibration for errors in the image, or None.
        points_at_start: Number of points of the scan in the first box.
        frames: Indices of the frames.
        tracked: Prediction of each frame.
        seconds: Time of the tracker in each frame.
        stamps_s: Time of each frame.
        positions_world: Centres of the bottom face x, y, z, of the frames with a box that is not lost.
    """

    drive: str
    tracker: str
    object_name: str
    out: Path
    truth: TrueTrack | None = None
    camera: Calibration | None = None
    points_at_start: int = 0
    frames: list[int] = field(default_factory=list)
    tracked: list[TrackedObject] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    stamps_s: list[float] = field(default_factory=list)
    positions_world: list[Float64] = field(default_factory=list)

    def update(self, result: Result, tracked: TrackedObject, seconds: float) -> None:
        """Add one frame."""
        self.frames.append(result.frame.index)
        self.tracked.append(tracked)
        self.seconds.append(seconds)
        self.stamps_s.append(result.frame.stamp_s)
        if tracked.box_velo is not None and tracked.status is not TrackStatus.LOST:
            box_world = transform_boxes(result.odom_SE3_velo, tracked.box_velo)
            self.positions_world.append(box_world.bottom_m[0])

    @property
    def metrics(self) -> SingleObjectMetrics | None:
        """Errors against the labels; None without labels."""
        if self.truth is None or not self.frames:
            return None
        predicted = PredictedTrack.from_predictions(self.frames, self.tracked, self.seconds)
        return single_object_metrics(single_object_errors(self.truth, predicted, self.camera))

    def text(self) -> str:
        """Return what is printed at the end."""
        if not self.frames:
            return f"{self.drive}: no frame could be read"
        values, count = self.to_json(), len(self.frames)
        span = f"frames {self.frames[0]} to {self.frames[-1]}"
        columns: list[Column[int]] = [
            Column("frames", lambda frames: frames),
            Column("share [%]", lambda frames: 100 * frames / count, ".1f"),
        ]
        title = f"{self.drive}, {self.object_name}, tracker {self.tracker}: {span}"
        path, speeds = "none, this tracker works in the image alone", self._speeds_km_h()
        if len(speeds):
            path = (
                f"{values['travelled_m']:.1f} m in {self.stamps_s[-1] - self.stamps_s[0]:.1f} s; "
                f"speed {speeds.mean():.1f} km/h on average, {speeds.max():.1f} km/h at most"
            )
        lines = [
            f"first box: {self.points_at_start} points of the scan",
            f"path: {path}",
            f"tracker: p50 {values['p50_ms']:.1f} ms/frame, p99 {values['p99_ms']:.1f} ms/frame",
            *_metric_lines(values["against_labels"]),
            f"results: {self.out}",
        ]
        table = Table(title, columns, values["states"], heading="status")
        return "\n\n".join([table.text(), "\n".join(lines)])

    def to_json(self) -> dict[str, Any]:
        """Return the content of `summary.json`."""
        speeds, spent_ms = self._speeds_km_h(), 1e3 * np.array(self.seconds)
        p50, p99 = np.percentile(spent_ms, (50, 99)).tolist() if len(spent_ms) else (None, None)
        return {
            "drive": self.drive,
            "object": self.object_name,
            "tracker": self.tracker,
            "frames": len(self.frames),
            "states": {str(s): sum(one.status is s for one in self.tracked) for s in TrackStatus},
            "points_at_start": self.points_at_start,
            "travelled_m": path_length_m(np.array(self.positions_world).reshape(-1, 3)),
            "mean_speed_km_h": float(speeds.mean()) if len(speeds) else None,
            "p50_ms": p50,
            "p99_ms": p99,
            "against_labels": self.metrics,
        }

    def _speeds_km_h(self) -> Float64:
        """Return the speed in each frame with a box that is not lost."""
        known = [
            one.velocity_m_s
            for one in self.tracked
            if one.box_velo is not None and one.status is not TrackStatus.LOST
        ]
        return np.asarray(_KM_H * np.hypot(*np.array(known).reshape(-1, 2).T))


def path_length_m(positions_m: Float64) -> float:
    """Return the length of a path through (K, 3) positions, without the noise of a parked object."""
    length_m, last = 0.0, positions_m[:1, :2].ravel()
    for position in positions_m[:, :2]:
        step_m = float(np.linalg.norm(position - last))
        if step_m >= _MIN_STEP_M:
            length_m, last = length_m + step_m, position
    return length_m


def _metric_lines(metrics: SingleObjectMetrics | None) -> list[str]:
    if metrics is None:
        return []
    errors = {
        f"E3D {metrics.center_m:.2f} m": metrics.center_m,
        f"E2D {metrics.center_px:.1f} px": metrics.center_px,
        f"heading {metrics.heading_rad:.3f} rad": metrics.heading_rad,
        f"drifted in {100 * metrics.drifted:.0f} % of the frames": 0.0,
    }
    known = ", ".join(words for words, value in errors.items() if np.isfinite(value))
    return [f"mean error over {metrics.frames} labels: {known}"]
