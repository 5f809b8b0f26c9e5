"""What following one object came to: states, way, speed, time, and how far off its labels it was."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from perception.cli.table import format_table, percent
from perception.cli.track_start import TrackStart
from perception.evaluation.single_object.errors import single_object_errors
from perception.evaluation.single_object.metrics import SingleObjectMetrics, single_object_metrics
from perception.evaluation.single_object.track import PredictedTrack
from perception.geometry.boxes import transform_boxes
from perception.render.trails import KM_H
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.types import Calibration, Float64, Result

# A way is measured from one place to the next that is this far off: nearer ones are noise.
_STEP_M = 0.5


@dataclass
class TrackSummary:
    """What a tracker answered, frame by frame.

    Attributes:
        drive: its name.
        tracker: its name.
        start: what the tracker was told.
        out: where the results are.
        points_at_start: of the scan in the first box.
        frames: numbers of the frames.
        tracked_objects: one a frame.
        seconds: that each took.
        stamps_s: times of the frames.
        positions_world: (3,) middle of the box' bottom, of the frames with a box that is not lost.
    """

    drive: str
    tracker: str
    start: TrackStart
    out: Path
    points_at_start: int = 0
    frames: list[int] = field(default_factory=list)
    tracked_objects: list[TrackedObject] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    stamps_s: list[float] = field(default_factory=list)
    positions_world: list[Float64] = field(default_factory=list)

    def add(self, result: Result, tracked: TrackedObject, seconds: float) -> None:
        """Count one frame."""
        self.frames.append(result.frame.index)
        self.tracked_objects.append(tracked)
        self.seconds.append(seconds)
        self.stamps_s.append(result.frame.stamp_s)
        if tracked.box_velo is not None and tracked.state is not TrackStatus.LOST:
            box_world = transform_boxes(result.world_SE3_velo, tracked.box_velo)
            self.positions_world.append(box_world.bottom_m[0])

    @property
    def counts(self) -> dict[TrackStatus, int]:
        """Frames in each state."""
        return {
            state: sum(one.state is state for one in self.tracked_objects) for state in TrackStatus
        }

    @property
    def speeds_km_h(self) -> Float64:
        """Of the frames with a box that is not lost."""
        return np.array(
            [
                KM_H * float(np.hypot(*one.velocity_m_s))
                for one in self.tracked_objects
                if one.box_velo is not None and one.state is not TrackStatus.LOST
            ]
        )

    @property
    def travelled_m(self) -> float:
        """Length of the object's way over the ground."""
        return path_length_m(np.array(self.positions_world).reshape(-1, 3))

    def scores(self, camera: Calibration | None) -> SingleObjectMetrics | None:
        """Compare with the labels; None where there are none."""
        if self.start.truth is None or not self.frames:
            return None
        tracked = PredictedTrack.from_predictions(self.frames, self.tracked_objects, self.seconds)
        return single_object_metrics(single_object_errors(self.start.truth, tracked, camera))

    def table(self, camera: Calibration | None) -> str:
        """Return what is printed at the end."""
        if not self.frames:
            return f"{self.drive}: no frame was done"
        count = len(self.frames)
        states = format_table(
            f"{self.drive}, {self.start.name}, tracker {self.tracker}: "
            f"frames {self.frames[0]} to {self.frames[-1]}",
            ("state", "frames", "share"),
            [[str(state), n, percent(n, count)] for state, n in self.counts.items()],
        )
        spent_ms = 1e3 * np.array(self.seconds)
        lines = [
            states,
            "",
            f"first box: {self.points_at_start} points of the scan in it",
            *self._path_lines(),
            f"tracker: {np.median(spent_ms):.1f} ms a frame, "
            f"{np.percentile(spent_ms, 99):.1f} ms at the 99th percentile",
            *_score_lines(self.scores(camera)),
            f"results: {self.out}",
        ]
        return "\n".join(lines)

    def _path_lines(self) -> list[str]:
        speeds = self.speeds_km_h
        if not len(speeds):
            return ["way: none, as this tracker answers in the image alone"]
        return [
            f"way: {self.travelled_m:.1f} m in {self.stamps_s[-1] - self.stamps_s[0]:.1f} s; "
            f"speed {speeds.mean():.1f} km/h on average, {speeds.max():.1f} km/h at most"
        ]

    def to_json(self, camera: Calibration | None) -> dict[str, Any]:
        """Return the same figures for summary.json."""
        speeds, spent_ms = self.speeds_km_h, 1e3 * np.array(self.seconds)
        return {
            "drive": self.drive,
            "object": self.start.name,
            "tracker": self.tracker,
            "frames": len(self.frames),
            "states": {str(state): count for state, count in self.counts.items()},
            "points_at_start": self.points_at_start,
            "travelled_m": self.travelled_m,
            "mean_speed_km_h": float(speeds.mean()) if len(speeds) else None,
            "median_ms": float(np.median(spent_ms)) if len(spent_ms) else None,
            "p99_ms": float(np.percentile(spent_ms, 99)) if len(spent_ms) else None,
            "against_labels": self.scores(camera),
        }


def path_length_m(positions_m: Float64) -> float:
    """Return the length of a way through (K, 3) places, without the trembling of who stands."""
    length_m, last = 0.0, None
    for position in positions_m[:, :2]:
        if last is None:
            last = position
        step_m = float(np.linalg.norm(position - last))
        if step_m >= _STEP_M:
            length_m, last = length_m + step_m, position
    return length_m


def _score_lines(scores: SingleObjectMetrics | None) -> list[str]:
    if scores is None:
        return []
    errors = [
        f"E3D {scores.center_m:.2f} m" if np.isfinite(scores.center_m) else "",
        f"E2D {scores.center_px:.1f} px" if np.isfinite(scores.center_px) else "",
        f"heading {scores.heading_rad:.3f} rad" if np.isfinite(scores.heading_rad) else "",
        f"beside the object in {100 * scores.drifted:.0f} % of the frames",
    ]
    words = ", ".join(filter(None, errors))
    return [f"against its {scores.frames} labels, on average: {words}"]
