"""The result files of a run as a report reads them: frames, objects by id, and facts of the run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np

from data.report.run_facts import RunFacts
from data.results.folder import CONFIG
from data.results.objects import FrameTracks, FrameVehicles, Number, ObjectRecord
from data.results.run_folder import FrameRecord, RunFolder
from perception.detection.config import DetectionConfig
from perception.errors import DriveError
from perception.types import Float64

_NO_TIME = float("nan")


@dataclass(frozen=True)
class ObjectPath:
    """One tracked object over the frames in which it has a velocity.

    Attributes:
        id: Track id.
        type: Class that a detector gave it last; empty where there is none.
        frames: (K,) indices of the frames.
        speeds_m_s: (K,) speeds over the ground.
        positions_m: (K, 2) x and y in the world frame.
    """

    id: int
    type: str
    frames: Float64
    speeds_m_s: Float64
    positions_m: Float64


@dataclass(frozen=True)
class RunData:
    """Results of one run.

    Attributes:
        path: Folder of the run.
        frames: Frames in the order in which they were processed, at least one.
        tracks: Tracks by the index of the frame.
        vehicles: Detected vehicles by the index of the frame; none where the run had no detectors.
        poses: (F, 4, 4) world_SE3_velo of each frame.
        summary: The printed summary.
        facts: Facts that the other files do not hold.
        config: Configuration as YAML; empty where it is missing.
    """

    path: Path
    frames: Sequence[FrameRecord]
    tracks: Mapping[int, FrameTracks]
    vehicles: Mapping[int, FrameVehicles]
    poses: Float64
    summary: Mapping[str, Any]
    facts: RunFacts
    config: str

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read the folder of a run.

        Raises:
            DriveError: The folder holds no results of a run, or none of a frame.
            LabelError: A file is damaged.
        """
        folder = RunFolder(path)
        frames = folder.frames()
        if not frames or not (path / "summary.json").is_file():
            found = "no summary.json" if frames else "no frame in frames.jsonl"
            raise DriveError(path, expected="results of at least one frame", found=found)
        config = path / CONFIG
        return cls(
            path=path,
            frames=frames,
            tracks=folder.tracks(),
            vehicles=folder.vehicles(),
            poses=folder.poses(),
            summary=folder.summary(),
            facts=RunFacts.read(path),
            config=config.read_text() if config.is_file() else "",
        )

    @property
    def name(self) -> str:
        """Name of the drive."""
        return str(self.summary.get("drive", self.path.name))

    @cached_property
    def frame_numbers(self) -> Float64:
        """(F,) indices of the frames."""
        return np.array([one.frame for one in self.frames], np.float64)

    @cached_property
    def times_s(self) -> Float64:
        """(F,) times since the first frame."""
        stamps_s = np.array([one.stamp_s for one in self.frames])
        return np.asarray(stamps_s - stamps_s[0])

    @property
    def period_s(self) -> float:
        """Time of a revolution of the LiDAR; of a run that does not state it, the usual time between frames."""
        if self.facts.period_s is not None:
            return self.facts.period_s
        steps_s = np.diff(self.times_s)
        return float(np.median(steps_s)) if len(steps_s) else _NO_TIME

    @cached_property
    def frames_ms(self) -> Float64:
        """(F,) times from the start of the first stage to the end of the last, NaN where unknown."""
        latencies_s = [one.latency_s for one in self.frames]
        return np.array([np.nan if one is None else 1e3 * one for one in latencies_s])

    @cached_property
    def stages_ms(self) -> dict[str, Float64]:
        """(F,) time of each stage, NaN where it did not run."""
        names = dict.fromkeys(name for one in self.frames for name in one.seconds)
        return {
            name: np.array([1e3 * one.seconds.get(name, np.nan) for one in self.frames])
            for name in names
        }

    @property
    def travelled_m(self) -> float:
        """Length of the path of the vehicle."""
        return float(np.linalg.norm(np.diff(self.poses[:, :3, 3], axis=0), axis=1).sum())

    @property
    def ground_error_m(self) -> float | None:
        """Mean over the frames of the ground's mean error at labelled objects; None without any."""
        known = [one.mean_m for one in self.facts.ground if one.mean_m is not None]
        return float(np.mean(known)) if known else None

    def objects(self, frame: int) -> list[ObjectRecord]:
        """Return the tracks of a frame, and the vehicles that no track stands for and that a video shows."""
        tracks: list[ObjectRecord] = [*self.tracks[frame].tracks] if frame in self.tracks else []
        ids = {one.id for one in tracks}
        vehicles = self.vehicles[frame].vehicles if frame in self.vehicles else []
        return tracks + [
            one
            for one in vehicles
            if (one.score or 0.0) >= DetectionConfig.display_score
            and (one.id is None or one.id not in ids)
        ]

    @cached_property
    def paths(self) -> list[ObjectPath]:
        """Objects that were tracked with a velocity, those of the most frames first."""
        types: dict[int, str] = {}
        found: dict[int, list[list[Number]]] = {}
        for frame in self.frames:
            for one in self.objects(frame.frame):
                if one.id is not None and one.speed_m_s is not None:
                    row = [frame.frame, one.speed_m_s, *one.world.position_m[:2]]
                    found.setdefault(one.id, []).append(row)
                    types[one.id] = one.type or types.get(one.id, "")
        return [
            ObjectPath(track, types[track], rows[:, 0], rows[:, 1], rows[:, 2:])
            for track, rows in (
                (track, np.array(rows, np.float64))
                for track, rows in sorted(found.items(), key=lambda item: -len(item[1]))
            )
        ]
