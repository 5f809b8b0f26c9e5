"""Results of `trifuse run`: every file is whole, whenever the run ends. `data.results.folder` lists the files."""

import json
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from data.kitti.tracking_rows import format_result_rows
from data.results.kitti_rows import format_object_rows, track_rows, vehicle_rows
from data.results.objects import (
    FrameLine,
    FrameTracks,
    FrameVehicles,
    TrajectoryRecord,
    frame_of,
    numbers,
)
from data.results.records import FrameRecords, append_record, read_records
from data.results.result_writer import ResultWriter
from perception.atomic_file import append_atomically, atomic_file, write_atomically
from perception.detection.vehicles.camera_views import views_of
from perception.errors import DriveError
from perception.geometry.grids import LocalArea
from perception.render.scene import SelectedObject
from perception.types import Drive, Float64, GroundModel, PointState, Result

FRAMES = "frames.jsonl"
# Classes of SemanticKITTI; its moving-object benchmark maps all static classes to 9, all moving ones to 251.
SEMANTIC_KITTI = np.zeros(len(PointState), np.uint32)
SEMANTIC_KITTI[PointState.GROUND] = 40
SEMANTIC_KITTI[PointState.STATIC] = 9
SEMANTIC_KITTI[PointState.MOVING] = 251


@dataclass(frozen=True)
class FindingRecord:
    """One finding on a sensor or a stage.

    Attributes:
        part: Sensor or stage.
        level: WARN or ERROR.
        fault: Name of the fault.
        reason: What was found, in one sentence.
    """

    part: str
    level: str
    fault: str
    reason: str


@dataclass(frozen=True)
class FrameRecord(FrameLine):
    """One line of `frames.jsonl`.

    Attributes:
        name: Name of the frame's files.
        invalid_points: Number of points that were no measurement, of all points of the scan.
        position_m: Position of the LiDAR in the world frame x, y, z.
        points: Number of points by state: outside, ground, static, moving.
        voxels: Number of static and of moving voxels.
        tracks: Number of tracks.
        vehicles: Number of vehicles in `vehicles.jsonl`; null without detectors.
        latency_s: Time from the start of the first stage to the end of the last.
        seconds: Time of each stage.
        pose_deviations: Standard deviations of the pose since the first scan, x, y, z in metres and rotations about the
            world's axes in rad; null where the method gives none.
        health: Findings on sensors and stages, the worst first; none where all is well.
    """

    name: str
    invalid_points: int
    position_m: list[float]
    points: dict[str, int]
    voxels: dict[str, int]
    tracks: int
    vehicles: int | None
    latency_s: float | None
    seconds: dict[str, float]
    pose_deviations: list[float | None] | None = None
    health: list[FindingRecord] = field(default_factory=list)

    @classmethod
    def of(cls, result: Result, vehicles: FrameVehicles | None) -> Self:
        """Return the record of one result with its listed vehicles."""
        states = np.bincount(result.obstacles.point_states, minlength=len(PointState))
        obstacles = result.obstacles
        return cls(
            *frame_of(result),
            name=result.frame.name,
            invalid_points=result.frame.invalid_points,
            position_m=numbers(result.world_SE3_velo[:3, 3]),
            points={state.name.lower(): int(states[state]) for state in PointState},
            voxels={"static": len(obstacles.static), "moving": len(obstacles.moving)},
            tracks=len(result.tracks),
            vehicles=None if vehicles is None else len(vehicles.vehicles),
            latency_s=round(result.duration_s, 6) if result.spans else None,
            seconds={stage: round(seconds, 6) for stage, seconds in result.timings_s.items()},
            pose_deviations=numbers(np.sqrt(np.diagonal(result.pose_covariance)), digits=5),
            health=[
                FindingRecord(one.part, one.level.name, one.fault, one.reason)
                for one in result.health.findings
            ],
        )


class RunFiles(ResultWriter):
    """Writes the files of a run; every file is whole after each frame."""

    def __init__(self, out: Path, drive: Drive, area: LocalArea, min_vehicle_score: float) -> None:
        """Write nothing yet.

        Args:
            out: Folder of the results.
            drive: Drive of the run.
            area: Area in which ground heights are written.
            min_vehicle_score: Score from which a vehicle is listed in `vehicles.jsonl`.
        """
        self._out, self._drive, self._area = out, drive, area
        self._min_vehicle_score = min_vehicle_score

    def add(self, result: Result, selected: SelectedObject | None) -> None:
        """Write the result of one frame."""
        out = self._out
        _write_obstacles(out, result, self._area)
        pose = " ".join(f"{x:.9g}" for x in result.world_SE3_velo[:3].ravel())
        append_atomically(out / "poses.txt", f"{pose}\n".encode())
        append_record(out / "tracks.jsonl", FrameTracks.of(result))
        vehicles = FrameVehicles.of(result, self._min_vehicle_score)
        if vehicles is not None:
            append_record(out / "vehicles.jsonl", vehicles)
        append_kitti_rows(out, self._drive, result)
        append_record(out / FRAMES, FrameRecord.of(result, vehicles))
        if selected is not None:
            record = TrajectoryRecord.of(result, selected.tracked, selected.track_id, kind=None)
            append_record(out / "trajectory.jsonl", record)

    def snapshot(self) -> bytes:
        """Return nothing: the checkpoint knows how long the files are."""
        return b""

    def restore(self, snapshot: bytes) -> None:
        """Do nothing: the files have been cut off."""

    def close(self, *, is_complete: bool) -> None:
        """Do nothing: the files are whole."""


def _write_obstacles(out: Path, result: Result, area: LocalArea) -> None:
    """Write the classes of the points, the voxels and the ground of one frame."""
    name = result.frame.name
    labels = SEMANTIC_KITTI[result.obstacles.point_states]
    write_atomically(out / "labels" / f"{name}.label", labels.tobytes())
    static, moving = result.obstacles.static, result.obstacles.moving
    xy_m, heights_m = sample_ground(result.ground, area)
    with atomic_file(out / "obstacles" / f"{name}.npz") as part:
        np.savez(
            part,
            static_centers_m=static.centers_m,
            static_counts=static.counts,
            moving_centers_m=moving.centers_m,
            moving_counts=moving.counts,
            ground_xy_m=xy_m,
            ground_height_m=heights_m,
        )


def append_kitti_rows(out: Path, drive: Drive, result: Result) -> None:
    """Write the tracks and the vehicles in the main camera's image as rows of KITTI's benchmarks; only with a camera."""
    frame, calibration = result.frame.number, drive.calibration
    if calibration is not None and calibration.image_size_px is not None:
        rows = format_result_rows(track_rows(frame, result.tracks, calibration))
        append_atomically(out / "tracks" / f"{drive.name}.txt", rows.encode())
    vehicles, calibration = views_of(result)[0].vehicles, result.frame.calibration
    if vehicles is not None and calibration is not None:
        file = out / "data" / f"{result.frame.name}.txt"
        write_atomically(file, format_object_rows(vehicles, calibration).encode())
        if drive.is_sequence:
            rows = format_result_rows(vehicle_rows(frame, vehicles, calibration))
            append_atomically(out / "vehicles" / f"{drive.name}.txt", rows.encode())


class RunFolder:
    """Reads the results of one run."""

    def __init__(self, path: Path) -> None:
        """Open a folder.

        Args:
            path: Folder that `trifuse run --out` wrote.

        Raises:
            DriveError: the folder holds no results of a run.
        """
        if not (path / FRAMES).is_file():
            raise DriveError(
                path, expected="a folder that `trifuse run` wrote", found="no frames.jsonl"
            )
        self.path = path

    def frames(self) -> list[FrameRecord]:
        """Read `frames.jsonl`."""
        return read_records(self.path / FRAMES, FrameRecord)

    def poses(self) -> Float64:
        """Read the (F, 4, 4) world_SE3_velo of `poses.txt`."""
        rows = np.loadtxt(self.path / "poses.txt", ndmin=2).reshape(-1, 3, 4)
        last = np.tile([[[0.0, 0, 0, 1]]], (len(rows), 1, 1))
        return np.concatenate([rows, last], axis=1)

    def tracks(self) -> FrameRecords[FrameTracks]:
        """Return the tracks in `tracks.jsonl` by frame."""
        return FrameRecords(self.path / "tracks.jsonl", FrameTracks)

    def vehicles(self) -> FrameRecords[FrameVehicles]:
        """Return the vehicles in `vehicles.jsonl` by frame; none where the run had no detectors."""
        return FrameRecords(self.path / "vehicles.jsonl", FrameVehicles)

    def labels(self, name: str) -> NDArray[np.uint32]:
        """Read the (N,) SemanticKITTI classes of the points of a frame by its name."""
        return np.fromfile(self.path / "labels" / f"{name}.label", np.uint32)

    def obstacles(self, name: str) -> dict[str, NDArray[Any]]:
        """Read the voxels and ground heights of a frame, in the LiDAR frame, by the names of the arrays."""
        with np.load(self.path / "obstacles" / f"{name}.npz", allow_pickle=False) as arrays:
            return dict(arrays)

    def summary(self) -> dict[str, Any]:
        """Read `summary.json`."""
        document: dict[str, Any] = json.loads((self.path / "summary.json").read_text())
        return document


def sample_ground(ground: GroundModel, area: LocalArea) -> tuple[Float64, Float64]:
    """Return (K, 2) positions on a 1 m grid over an area and the (K,) ground heights there."""
    x = np.arange(-area.behind_m, area.ahead_m + 0.5)
    y = np.arange(-area.side_m, area.side_m + 0.5)
    xy_m = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    return xy_m, ground.height_m(xy_m)


def is_complete(folder: Path) -> bool:
    """Return whether a folder holds all results of a run; not of one that was stopped."""
    with suppress(OSError, ValueError):
        document = json.loads((folder / "summary.json").read_text())
        return bool(document.get("is_complete"))
    return False
