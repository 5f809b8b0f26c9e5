"""What a run found, added up frame by frame: for the screen and for summary.json."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from perception.evaluation.confusion import Confusion, confusion_table
from perception.evaluation.ground import LabelledScan, ground_confusion
from perception.evaluation.obstacles import PointMotion, point_motion
from perception.evaluation.stage_times import StageTimes
from perception.geometry.grids import LocalArea
from perception.types import PointState, PointTruth, Result

# From this score on a vehicle is more likely there than not.
_MIN_SCORE = 0.5


@dataclass
class RunSummary:
    """What a run found, added up frame by frame.

    Attributes:
        drive: its name.
        out: where the results are.
        times: of the stages.
        points: by `PointState`, over all frames.
        moving_voxels: one entry a frame.
        track_ids: of every track so far.
        live_tracks: one entry a frame.
        vehicle_ids: of every followed vehicle so far.
        detected_vehicles: in each frame that detectors looked at, those with a score of 0.5 or more.
        ground: points called ground against exact truth, where the drive has it.
        motion: points called static or moving against exact truth, where the drive has it.
        elapsed_s: wall time with reading, drawing and writing.
    """

    drive: str
    out: Path
    times: StageTimes = field(default_factory=StageTimes)
    points: np.ndarray = field(default_factory=lambda: np.zeros(len(PointState), np.int64))
    moving_voxels: list[int] = field(default_factory=list)
    track_ids: set[int] = field(default_factory=set)
    live_tracks: list[int] = field(default_factory=list)
    vehicle_ids: set[int] = field(default_factory=set)
    detected_vehicles: list[int] = field(default_factory=list)
    ground: Confusion = field(default_factory=Confusion)
    motion: PointMotion = field(default_factory=PointMotion)
    elapsed_s: float = 0.0

    def add(self, result: Result, truth: PointTruth | None, area: LocalArea) -> None:
        """Count one frame."""
        self.times.update(result)
        self.points += np.bincount(result.obstacles.point_states, minlength=len(PointState))
        self.moving_voxels.append(len(result.obstacles.moving))
        self.track_ids.update(result.tracks.ids.tolist())
        self.live_tracks.append(len(result.tracks))
        if (vehicles := result.vehicles) is not None:
            self.vehicle_ids.update(vehicles.ids[vehicles.ids >= 0].tolist())
            is_detected = vehicles.fused.detections.scores >= _MIN_SCORE
            self.detected_vehicles.append(int(np.count_nonzero(is_detected)))
        if truth is not None:
            states = result.obstacles.point_states
            scan = LabelledScan(result.frame.points_velo, states, truth.classes)
            self.ground = sum(ground_confusion(scan, area), self.ground)
            self.motion += point_motion(states, truth.classes, truth.is_moving)

    @property
    def frames(self) -> int:
        """Frames done."""
        return len(self.moving_voxels)

    def table(self) -> str:
        """Return what is printed at the end."""
        if not self.frames:
            return f"{self.drive}: no frame was done"
        stages = self.times.table(f"{self.drive}: {self.frames} frames").text()
        seen = self.points / self.frames
        lines = [
            stages,
            "",
            f"a frame: {seen[PointState.GROUND]:.0f} ground, {seen[PointState.STATIC]:.0f} static, "
            f"{seen[PointState.MOVING]:.0f} moving points; "
            f"{self.frames / self.elapsed_s:.1f} frames/s with reading, drawing and writing",
            f"tracks: {len(self.track_ids)} in all, {np.mean(self.live_tracks):.1f} at a time",
            *self._vehicle_lines(),
            f"results: {self.out}",
        ]
        if self.ground.true_positives:
            lines.insert(1, f"\n{self._truth_table()}")
        return "\n".join(lines)

    def _vehicle_lines(self) -> list[str]:
        if not self.detected_vehicles:
            return []
        return [
            f"vehicles: {len(self.vehicle_ids)} followed, {np.mean(self.detected_vehicles):.1f} "
            f"at a time with a score of {_MIN_SCORE:g} or more"
        ]

    def _truth_table(self) -> str:
        """Return how the points compare with the exact truth of a synthetic drive."""
        return confusion_table(
            "points against the exact truth of this synthetic drive",
            {"ground": self.ground, "static": self.motion.static, "moving": self.motion.moving},
        ).text()

    def to_json(self) -> dict[str, object]:
        """Return the same figures for summary.json."""
        return {
            "drive": self.drive,
            "frames": self.frames,
            "elapsed_s": round(self.elapsed_s, 3),
            "stages_ms": self.times.table("").to_json(),
            "points_against_truth": {
                "ground": self.ground.to_json(),
                "static": self.motion.static.to_json(),
                "moving": self.motion.moving.to_json(),
            }
            if self.ground.true_positives
            else None,
            "tracks": {
                "ids": len(self.track_ids),
                "mean_alive": float(np.mean(self.live_tracks)) if self.frames else None,
            },
            "vehicles": {
                "ids": len(self.vehicle_ids),
                "mean_likely": float(np.mean(self.detected_vehicles)),
            }
            if self.detected_vehicles
            else None,
            "points": {state.name.lower(): int(self.points[state]) for state in PointState},
        }
