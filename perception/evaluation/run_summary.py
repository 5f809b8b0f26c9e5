"""Summary of a run: counts per frame, metrics where the drive has exact truth, and whether the pipeline keeps up."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from perception.evaluation.confusion import Confusion, add_confusions
from perception.evaluation.ground import ground_confusion
from perception.evaluation.obstacles import motion_confusions
from perception.evaluation.report import Table
from perception.evaluation.stage_times import StageTimes
from perception.geometry.grids import LocalArea
from perception.tracking.vehicles.duplicates import distinct_rows
from perception.types import Health, HealthLevel, Int, PointState, PointTruth, Result


@dataclass(frozen=True)
class FaultSummary:
    """One fault over a drive.

    Attributes:
        part: Sensor or stage.
        level: Worst level.
        frames: Number of frames with it.
        first: Index of its first frame.
        reason: What was found in its first frame.
    """

    part: str
    level: HealthLevel
    frames: int
    first: int
    reason: str


@dataclass
class HealthSummary:
    """Faults of a drive, added frame by frame.

    Attributes:
        frames: Number of frames.
        healthy: Number of frames without a finding.
        faults: Faults by name.
    """

    frames: int = 0
    healthy: int = 0
    faults: dict[str, FaultSummary] = field(default_factory=dict)

    def update(self, frame: int, health: Health) -> None:
        """Add the health of a frame by its index."""
        self.frames += 1
        self.healthy += not health.findings
        for one in health.findings:
            new = FaultSummary(one.part, one.level, 0, frame, one.reason)
            known = self.faults.get(one.fault, new)
            level = max(known.level, one.level)
            self.faults[one.fault] = replace(known, frames=known.frames + 1, level=level)

    def text(self) -> str:
        """Return one line, and one for each fault."""
        if not self.faults:
            return f"health: OK in all {self.frames} frames"
        by_frames = sorted(self.faults.items(), key=lambda item: -item[1].frames)
        faults = [
            f"  {name} in {one.frames} from frame {one.first} on ({one.level.name}): {one.reason}"
            for name, one in by_frames
        ]
        return "\n".join([f"health: OK in {self.healthy} of {self.frames} frames", *faults])

    def to_json(self) -> dict[str, object]:
        """Return the numbers and the faults by name."""
        faults = {name: {**vars(one), "level": one.level.name} for name, one in self.faults.items()}
        return {"frames": self.frames, "healthy": self.healthy, "faults": faults}


@dataclass
class RunSummary:
    """Counts of a run, added frame by frame.

    Attributes:
        drive: Name of the drive.
        out: Folder of the results.
        area: Local area of the pipeline.
        display_score: Score from which a vehicle is counted.
        period_s: Time from one scan to the next in seconds.
        times: Times of the stages.
        points: Number of points by `PointState`, over all frames.
        track_ids: Ids of all tracks so far.
        tracks: Number of tracks of each frame.
        vehicle_ids: Ids of all tracked vehicles so far.
        vehicles: Number of vehicles with at least `display_score`, of each frame on which detectors ran.
        health: Faults of sensors and stages.
        confusions: Ground, static and moving points against exact truth; empty without it.
        elapsed_s: Wall time with reading, drawing and writing.
        is_complete: Whether all frames of the run are in it.
    """

    drive: str
    out: Path
    area: LocalArea
    display_score: float = 0.5
    period_s: float = 0.1
    times: StageTimes = field(default_factory=StageTimes)
    points: Int = field(default_factory=lambda: np.zeros(len(PointState), np.int64))
    track_ids: set[int] = field(default_factory=set)
    tracks: list[int] = field(default_factory=list)
    vehicle_ids: set[int] = field(default_factory=set)
    vehicles: list[int] = field(default_factory=list)
    health: HealthSummary = field(default_factory=HealthSummary)
    confusions: dict[str, Confusion] = field(default_factory=dict)
    elapsed_s: float = 0.0
    is_complete: bool = False

    def update(self, result: Result, truth: PointTruth | None) -> None:
        """Add one frame."""
        states = result.obstacles.point_states
        self.times.update(result)
        self.health.update(result.frame.index, result.health)
        self.points = self.points + np.bincount(states, minlength=len(PointState))
        self.track_ids.update(result.tracks.ids.tolist())
        self.tracks.append(len(result.tracks))
        if (vehicles := result.vehicles) is not None:
            self.vehicle_ids.update(vehicles.ids[vehicles.ids >= 0].tolist())
            self.vehicles.append(len(distinct_rows(vehicles, self.display_score)))
        points = result.frame.points_velo
        # The truth of a scan with an injected fault is of other points.
        if truth is not None and len(truth.classes) == len(points):
            by_range = ground_confusion(points, states, truth.classes, self.area)
            ground = sum(by_range.values(), Confusion())
            motion = motion_confusions(states, truth.classes, truth.is_moving)
            added = {"ground": ground, "static": motion["static"], "moving": motion["moving"]}
            self.confusions = add_confusions(self.confusions, added)

    @property
    def frames(self) -> int:
        """Number of frames so far."""
        return len(self.tracks)

    def text(self, *, stages: bool = False) -> str:
        """Return what is printed at the end of a run.

        Args:
            stages: Whether the time of each stage is in it.
        """
        if not self.frames:
            return f"{self.drive}: no frame could be read"
        blocks = [f"{self.drive}: {self.frames} frames"]
        if stages:
            blocks.append(self.times.table("times of the stages").text())
        if self.confusions:
            title = "points against the truth of this drive"
            blocks.append(Table(title, Confusion.columns(), self.confusions).text())
        points = self.points / self.frames
        lines = [
            f"points/frame: {points[PointState.GROUND]:.0f} ground, "
            f"{points[PointState.STATIC]:.0f} static, {points[PointState.MOVING]:.0f} moving",
            f"tracks: {len(self.track_ids)}, {np.mean(self.tracks):.1f}/frame",
        ]
        if self.vehicles:
            lines.append(
                f"vehicles: {len(self.vehicle_ids)} tracked, {np.mean(self.vehicles):.1f}/frame "
                f"with a score of at least {self.display_score:g}"
            )
        run = (
            f"run: {self.elapsed_s:.1f} s with reading, drawing and writing, "
            f"{self.frames / self.elapsed_s:.1f} frames/s"
        )
        lines += [self.health.text(), self.times.verdict(self.period_s), run]
        return "\n\n".join([*blocks, "\n".join([*lines, f"results: {self.out}"])])

    def to_json(self) -> dict[str, object]:
        """Return the content of `summary.json`."""
        points = {state.name.lower(): int(self.points[state]) for state in PointState}
        tracks = {
            "ids": len(self.track_ids),
            "per_frame": float(np.mean(self.tracks)) if self.frames else None,
        }
        vehicles = {"ids": len(self.vehicle_ids), "per_frame": float(np.mean(self.vehicles or [0]))}
        confusions = {name: counts.to_json() for name, counts in self.confusions.items()}
        return {
            "drive": self.drive,
            "frames": self.frames,
            "is_complete": self.is_complete,
            "elapsed_s": round(self.elapsed_s, 3),
            "period_ms": 1e3 * self.period_s,
            "stages_ms": self.times.table("").to_json(),
            "points_against_truth": confusions or None,
            "tracks": tracks,
            "vehicles": vehicles if self.vehicles else None,
            "points": points,
            "health": self.health.to_json(),
        }
