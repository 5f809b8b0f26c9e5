"""Poses beside those of a drive: single steps, heading, end of the path, and drift as KITTI's odometry measures it."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Final

import numpy as np

from perception.evaluation.report import CONTEXT, Metric, Metrics, Report, Table, value_table
from perception.geometry.se3 import inverse, rotation_angle_rad
from perception.localization.ins_fusion import is_flat
from perception.types import Float64, Labels, PointTruth, Result

# Sub-paths of KITTI's odometry benchmark, and those of a drive that is shorter than all of them.
_LENGTHS_M: Final = (100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0)
_SHORT_LENGTHS_M: Final = (10.0, 20.0, 50.0)
_START_FRAMES: Final = 10  # between the starts of sub-paths
_LEVEL: Final = 1e-6  # change of a tilt that never changes

PROTOCOL = {
    "step": "motion from a frame to the next beside that of the reference: rotation angle and distance",
    "yaw": "largest error of the heading, poses joined to the reference at the first frame",
    "end": "distance and angle between the last poses, joined in the same way",
    "drift": "mean error over sub-paths, a start every tenth frame, divided by their length (KITTI odometry)",
    "lengths_m": _LENGTHS_M,
    "lengths_m_of_short_drives": _SHORT_LENGTHS_M,
    "height": "of poses of constant height, which is none that was measured, errors are those in the plane",
    "tilt": "of poses of constant height and tilt, rotation errors are those of the heading",
}


@dataclass(frozen=True)
class PoseAccuracy(Metrics):
    """Errors of the poses of one run, or of runs over several drives together.

    Attributes:
        step_p50_deg: Median rotation error of a step.
        step_p90_deg: Its 90th percentile.
        step_max_deg: Largest one.
        step_yaw_max_deg: Largest error of the heading in a step.
        step_p50_cm: Median error of the distance of a step.
        step_p90_cm: Its 90th percentile.
        step_max_cm: Largest one.
        yaw_deg: Largest error of the heading over the drive.
        end_m: Distance from the end of the path, the largest of several drives.
        end_deg: Rotation error there.
        drift_percent: Error of the position over sub-paths, a share of their length.
        drift_deg_100m: Error of the rotation over 100 m of sub-paths.
        p50_ms: Median time of registration.
        p99_ms: Its 99th percentile.
        faults: Number of frames with each finding of LiDAR, INS and registration.
    """

    step_p50_deg: Annotated[float, Metric("step p50 [°]", ".3f")]
    step_p90_deg: Annotated[float, Metric("p90 [°]", ".3f")]
    step_max_deg: Annotated[float, Metric("max [°]", ".2f")]
    step_yaw_max_deg: Annotated[float, Metric("yaw max [°]", ".2f")]
    step_p50_cm: Annotated[float, Metric("step p50 [cm]", ".1f")]
    step_p90_cm: Annotated[float, Metric("p90 [cm]", ".1f")]
    step_max_cm: Annotated[float, Metric("max [cm]", ".1f")]
    yaw_deg: Annotated[float, Metric("yaw [°]", ".2f")]
    end_m: Annotated[float, Metric("end [m]", ".2f")]
    end_deg: Annotated[float, Metric("end [°]", ".2f")]
    drift_percent: Annotated[float, Metric("drift [%]", ".2f")]
    drift_deg_100m: Annotated[float, Metric("[°/100 m]", ".2f")]
    p50_ms: Annotated[float, Metric("p50 [ms]", ".1f")]
    p99_ms: Annotated[float, Metric("p99 [ms]", ".1f")]
    faults: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class PoseReport(Report):
    """Errors of several runs over one drive.

    Attributes:
        runs: Errors by run.
        paths_m: (F, 2) path of each run and of the reference, from the first frame on.
        lengths_m: Lengths of the sub-paths.
        is_exact: Whether the poses of the drive are the truth.
        is_flat: Whether they have no height.
        is_level: Whether they have no tilt either.
    """

    runs: dict[str, PoseAccuracy]
    paths_m: Annotated[Mapping[str, Float64], CONTEXT]
    lengths_m: tuple[float, ...]
    is_exact: bool
    is_flat: bool
    is_level: bool

    def tables(self) -> Sequence[Table[Any]]:
        """Return the errors, and the findings of the monitors where there are any."""
        notes = []
        if not self.is_exact:
            notes.append("The INS is no truth: its own errors are among these.")
        if self.lengths_m != _LENGTHS_M:
            lengths = ", ".join(f"{one:g}" for one in self.lengths_m)
            notes.append(f"The drive is shorter than 100 m: drift over sub-paths of {lengths} m.")
        if self.is_flat:
            notes.append("Its poses have one height: errors of position are those in the plane.")
        if self.is_level:
            notes.append("They have one tilt, too: errors of rotation are those of the heading.")
        tables: list[Table[Any]] = [Table("", PoseAccuracy.columns(), self.runs, notes=notes)]
        faults = {name: one.faults for name, one in self.runs.items()}
        if any(faults.values()):
            tables.append(value_table("Frames with a finding", faults))
        return tables

    def to_json(self) -> dict[str, Any]:
        """Return the errors, and the paths as a figure draws them."""
        paths = {name: {"x_m": way[:, 0], "y_m": way[:, 1]} for name, way in self.paths_m.items()}
        return {**super().to_json(), "paths": paths}


@dataclass(frozen=True)
class _DriveErrors:
    """Errors of one run over one drive: of each step, of the heading of each frame, of the end, of each sub-path."""

    steps_deg: Float64
    steps_yaw_deg: Float64
    steps_cm: Float64
    yaws_deg: Float64
    end_m: float
    end_deg: float
    drift: Float64
    seconds: Float64
    faults: Counter[str]


class PoseMeasure:
    """Collects the poses of one run, and compares them with those of the drive."""

    def __init__(self, reference: Sequence[Float64]) -> None:
        """Start without a frame.

        Args:
            reference: (4, 4) pose of the LiDAR in the world of each frame of the drive.
        """
        self._all = reference
        self._reference: list[Float64] = []
        self._poses: list[Float64] = []
        self._seconds: list[float] = []
        self._faults: Counter[str] = Counter()
        self.is_flat = is_flat(reference)
        """Whether the poses of the drive have no height."""
        self.is_level = self.is_flat and _is_level(reference)
        """Whether they have no tilt either."""

    def update(self, result: Result, labels: Labels | None, truth: PointTruth | None) -> None:
        """Add one frame; labels and truth tell nothing of poses."""
        del labels, truth
        seconds = result.timings_s.get("registration", np.nan)
        self.add(result.frame.index, result.world_SE3_velo, seconds)
        self._faults.update(result.health.faults)

    def add(self, index: int, world_SE3_velo: Float64, seconds: float) -> None:
        """Add a pose.

        Args:
            index: Number of the frame in the drive.
            world_SE3_velo: (4, 4) pose.
            seconds: Time that it took.
        """
        self._reference.append(self._all[index])
        self._poses.append(world_SE3_velo)
        self._seconds.append(seconds)

    @property
    def joined_m(self) -> Float64:
        """(F, 2) path, joined to that of the reference at the first frame."""
        return np.array(self._joined())[:, :2, 3]

    @property
    def reference_m(self) -> Float64:
        """(F, 2) path of the reference."""
        return np.array(self._reference)[:, :2, 3]

    @property
    def lengths_m(self) -> tuple[float, ...]:
        """Lengths of the sub-paths."""
        is_long = _travelled_m(self._reference)[-1] >= _LENGTHS_M[0]
        return _LENGTHS_M if is_long else _SHORT_LENGTHS_M

    def compute(self) -> PoseAccuracy:
        """Return the errors of all frames so far."""
        return pooled([self])

    def errors(self) -> _DriveErrors:
        """Return the errors of all frames so far, one by one."""
        joined, reference = self._joined(), self._reference
        steps = [
            _motion(_motion(reference[k - 1], reference[k]), _motion(joined[k - 1], joined[k]))
            for k in range(1, len(joined))
        ]
        errors = [_motion(*pair) for pair in zip(reference, joined, strict=True)]
        return _DriveErrors(
            np.degrees([self._angle_rad(one) for one in steps]),
            np.degrees([abs(_yaw_rad(one)) for one in steps]),
            100 * np.array([self._distance_m(one) for one in steps]),
            np.degrees([abs(_yaw_rad(one)) for one in errors]),
            self._distance_m(errors[-1]),
            float(np.degrees(self._angle_rad(errors[-1]))),
            np.array(list(self._drift(joined))).reshape(-1, 2),
            np.array(self._seconds),
            self._faults,
        )

    def _joined(self) -> list[Float64]:
        """Return the poses in the world of the reference."""
        world_SE3_own = self._reference[0] @ inverse(self._poses[0])
        return [world_SE3_own @ pose for pose in self._poses]

    def _drift(self, poses: Sequence[Float64]) -> Iterator[tuple[float, float]]:
        """Yield the error of position and rotation of each sub-path, in m and rad per m of its length."""
        reference, travelled_m = self._reference, _travelled_m(self._reference)
        for first in range(0, len(reference), _START_FRAMES):
            for length_m in self.lengths_m:
                last = int(np.searchsorted(travelled_m, travelled_m[first] + length_m))
                if last == len(reference):
                    break
                error = _motion(
                    _motion(reference[first], reference[last]), _motion(poses[first], poses[last])
                )
                yield self._distance_m(error) / length_m, self._angle_rad(error) / length_m

    def _distance_m(self, error: Float64) -> float:
        return float(np.linalg.norm(error[: 2 if self.is_flat else 3, 3]))

    def _angle_rad(self, error: Float64) -> float:
        return abs(_yaw_rad(error)) if self.is_level else rotation_angle_rad(error)


def _is_level(poses: Sequence[Float64]) -> bool:
    """Return whether the world's vertical keeps its direction in the frame of the LiDAR."""
    return bool((np.ptp(np.array(poses)[:, 2, :3], axis=0) <= _LEVEL).all())


def _travelled_m(poses: Sequence[Float64]) -> Float64:
    steps_m = np.linalg.norm(np.diff(np.array(poses)[:, :3, 3], axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps_m)])


def _motion(before: Float64, after: Float64) -> Float64:
    return inverse(before) @ after


def _yaw_rad(motion: Float64) -> float:
    return float(np.arctan2(motion[1, 0], motion[0, 0]))


def _percentile(values: Sequence[float] | Float64, percent: float) -> float:
    known = np.asarray(values, np.float64)
    known = known[np.isfinite(known)]
    return float(np.percentile(known, percent)) if len(known) else float("nan")


def pooled(measures: Sequence[PoseMeasure]) -> PoseAccuracy:
    """Return the errors of runs over several drives: percentiles of all steps together, the largest of the ends."""
    drives = [one.errors() for one in measures]
    steps_deg = np.concatenate([one.steps_deg for one in drives])
    steps_cm = np.concatenate([one.steps_cm for one in drives])
    drift = np.concatenate([one.drift for one in drives])
    drift_percent, drift_rad = drift.mean(axis=0) if len(drift) else (np.nan, np.nan)
    seconds = np.concatenate([one.seconds for one in drives])
    return PoseAccuracy(
        step_p50_deg=_percentile(steps_deg, 50),
        step_p90_deg=_percentile(steps_deg, 90),
        step_max_deg=_percentile(steps_deg, 100),
        step_yaw_max_deg=_percentile(np.concatenate([one.steps_yaw_deg for one in drives]), 100),
        step_p50_cm=_percentile(steps_cm, 50),
        step_p90_cm=_percentile(steps_cm, 90),
        step_max_cm=_percentile(steps_cm, 100),
        yaw_deg=float(max(one.yaws_deg.max() for one in drives)),
        end_m=max(one.end_m for one in drives),
        end_deg=max(one.end_deg for one in drives),
        drift_percent=100 * float(drift_percent),
        drift_deg_100m=100 * float(np.degrees(drift_rad)),
        p50_ms=1e3 * _percentile(seconds, 50),
        p99_ms=1e3 * _percentile(seconds, 99),
        faults=dict(sum((one.faults for one in drives), Counter[str]())),
    )
