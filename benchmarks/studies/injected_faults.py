"""Faults of sensors that are injected into drives in memory, and what the monitors say of them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from benchmarks.studies.report import publish
from data.faults.injection import Fault, inject
from data.faults.kinds import FAULT_KINDS, FaultKind
from data.open_drive import open_drive, sequences_in
from perception.evaluation.report import Metric, Metrics, Table
from perception.geometry.grids import EgoVehicle
from perception.health.camera_monitors import CameraMonitors
from perception.health.ins_monitor import InsMonitor
from perception.health.monitors import ScanAndInsMonitors
from perception.health.scan_statistics import ScanMeter
from perception.localization.odometry import LidarOdometry
from perception.render.curve_plots import Curve, CurvePanel, plot_curves
from perception.types import CAMERA, INS, Drive, Float64, Frame, HealthFinding

if TYPE_CHECKING:
    from benchmarks.studies.fault_detection import InjectionConfig
    from perception.cli.flags import SourceFlags

_WARM_UP = 15  # frames from which monitors learn what is usual
_MIN_SPEED_M_S = 1.0  # a frozen pose of a vehicle that stands is no fault yet


@dataclass
class FaultDetection(Metrics):
    """Faults of one kind and size.

    Attributes:
        faults: Number of faults.
        named: Number of faults that were named in time.
        delays: Frames from the first one of a fault to that which names it, of the faults that are named in time.
    """

    faults: Annotated[int, Metric("faults")] = 0
    named: Annotated[int, Metric("named")] = 0
    delays: list[int] = field(default_factory=list)

    @property
    def recall(self) -> Annotated[float, Metric("recall", ".3f")]:
        """Share of the faults that are named in time."""
        return self.named / self.faults if self.faults else float("nan")

    @property
    def mean_delay(self) -> Annotated[float, Metric("delay, mean [frames]", ".1f")]:
        """Mean delay in frames; 0 for a fault that its first frame names."""
        return float(np.mean(self.delays)) if self.delays else float("nan")

    @property
    def max_delay(self) -> Annotated[float, Metric("delay, max [frames]", ".0f")]:
        """Largest delay in frames."""
        return float(max(self.delays, default=np.nan))


@dataclass
class CleanDriving(Metrics):
    """Clean frames and the alarms in them.

    Attributes:
        frames: Number of clean frames.
        seconds: Their time.
        alarms: Sentences of the false alarms, one for each beginning.
    """

    frames: Annotated[int, Metric("frames")] = 0
    seconds: Annotated[float, Metric("time [s]", ".0f")] = 0.0
    alarms: list[str] = field(default_factory=list)

    @property
    def false_alarms(self) -> Annotated[int, Metric("false alarms")]:
        """Number of false alarms."""
        return len(self.alarms)

    @property
    def max_rate(self) -> Annotated[float, Metric("at most, 95 % [/h]", ".0f")]:
        """Upper bound of the rate of false alarms an hour, at 95 % (rule of three where there is none)."""
        from scipy.stats import chi2

        return float(chi2.ppf(0.95, 2 * len(self.alarms) + 2) / 2 / max(self.seconds, 1e-9) * 3600)


class _Monitors:
    """The monitors of one part, fed with frames and their registered poses."""

    def __init__(self, part: str, meter: ScanMeter) -> None:
        self._camera = CameraMonitors() if part == CAMERA else None
        self._ins = InsMonitor() if part == INS else None
        self._scans = ScanAndInsMonitors(meter) if part not in (CAMERA, INS) else None

    def update(self, frame: Frame, pose: Float64) -> Sequence[HealthFinding]:
        if self._camera is not None:
            return self._camera.update(frame)
        if self._ins is not None:
            found = self._ins.update(frame)
            self._ins.register(frame, pose, is_trusted=True)
            return found
        assert self._scans is not None
        return self._scans.update(frame).findings


@dataclass(frozen=True)
class _Recording:
    """Frames of a drive in memory, with the poses that registration gives them."""

    name: str
    frames: Sequence[Frame]
    poses: Sequence[Float64]
    meter: ScanMeter

    @classmethod
    def of(cls, drive: Drive, limit: int) -> "_Recording":
        odometry, ego = LidarOdometry(), EgoVehicle()
        count = min(limit or len(drive), len(drive))
        frames = [drive[index] for index in range(count)]
        poses = [
            odometry.update(
                ego.crop(one.points_velo).points_velo, one.stamp_s, one.world_SE3_velo, one.source
            ).world_SE3_velo
            for one in frames
        ]
        return cls(drive.name, frames, poses, ScanMeter(drive.sensor))

    @property
    def parts(self) -> list[str]:
        first = self.frames[0]
        present = {
            "lidar": True,
            CAMERA: first.image is not None,
            INS: first.world_SE3_velo is not None,
        }
        return [part for part, is_present in present.items() if is_present]

    def speed_m_s(self, row: int) -> float:
        step = np.linalg.norm(self.poses[row][:3, 3] - self.poses[row - 1][:3, 3])
        return float(step / (self.frames[row].stamp_s - self.frames[row - 1].stamp_s))

    def alarms(self) -> Iterator[str]:
        """Yield the beginning of each finding in the clean drive."""
        for part in self.parts:
            monitors, before = _Monitors(part, self.meter), set[str]()
            for frame, pose in zip(self.frames, self.poses, strict=True):
                found = monitors.update(frame, pose)
                yield from (
                    f"{self.name} frame {frame.index}: {one}"
                    for one in found
                    if one.fault not in before
                )
                before = {one.fault for one in found}

    def delay(self, fault: Fault, within: int) -> int | None:
        """Return after how many frames a fault is named, None where it is not in time."""
        first = max(0, fault.first - _WARM_UP)
        part = slice(first, fault.first + within)
        monitors = _Monitors(fault.definition.part, self.meter)
        injected = inject(self.frames[part], [fault])
        for frame, pose in zip(injected, self.poses[part], strict=True):
            found = monitors.update(frame, pose)
            is_named = any(one.fault in fault.definition.reported for one in found)
            if frame.index >= fault.first and is_named:
                return frame.index - fault.first
        return None


def measure_faults(
    roots: Sequence[str], source: "SourceFlags", config: "InjectionConfig", out: Path
) -> None:
    """Inject faults into drives; print and write how they are named, and the false alarms.

    Args:
        roots: Folders or files of drives.
        source: Which sequence, and how it is read.
        config: Faults that are injected.
        out: Figure; a JSON file with the numbers is written beside it.
    """
    clean, detections = CleanDriving(), dict[str, FaultDetection]()
    for root in roots:
        names = sequences_in(Path(root)) if source.sequence is None else [source.sequence]
        for name in names:
            drive = open_drive(Path(root), sequence=name, config=source.reading, images=True)
            recording = _Recording.of(drive, config.frames)
            clean.frames += len(recording.frames)
            clean.seconds += recording.frames[-1].stamp_s - recording.frames[0].stamp_s
            clean.alarms += recording.alarms()
            _inject_all(recording, config, detections)
    for alarm in clean.alarms:
        print(alarm)
    tables: dict[str, Table[Any]] = {
        "clean": Table("clean driving", CleanDriving.columns(), {"all": clean}),
        "faults": Table("faults", FaultDetection.columns(), detections),
    }
    plot_curves(
        out, "Faults named within five frames", _panels(detections), columns=5, share_y="all"
    )
    publish(out, "faults of sensors", tables, {"config": config, "drives": roots})


def _inject_all(
    recording: _Recording, config: "InjectionConfig", detections: dict[str, FaultDetection]
) -> None:
    """Inject faults of each kind and size at random frames."""
    rng = np.random.default_rng(config.seed)
    last = len(recording.frames) - config.within
    if last <= _WARM_UP:
        return
    for kind, size in _cases(config):
        if FAULT_KINDS[kind].part not in recording.parts:
            continue
        detection = detections.setdefault(f"{kind} {size:g}", FaultDetection())
        for _ in range(config.injections):
            first, seed = int(rng.integers(_WARM_UP, last)), int(rng.integers(1 << 30))
            if kind == "ins-frozen" and recording.speed_m_s(first) < _MIN_SPEED_M_S:
                continue
            fault = Fault(kind, first, first + config.within - 1, size, seed)
            delay = recording.delay(fault, config.within)
            detection.faults += 1
            if delay is not None:
                detection.named += 1
                detection.delays.append(delay)


def _panels(detections: Mapping[str, FaultDetection]) -> list[CurvePanel]:
    """Return the recall of each kind of fault over its size."""
    by_kind: dict[str, dict[float, float]] = {}
    for name, one in detections.items():
        kind, size = name.split()
        by_kind.setdefault(kind, {})[float(size)] = one.recall
    return [
        CurvePanel(
            kind,
            FAULT_KINDS[kind].size or "size",
            "recall",
            [Curve("recall", list(recalls), list(recalls.values()))],
            y_limits=(0.0, 1.05),
        )
        for kind, recalls in by_kind.items()
    ]


def _cases(config: "InjectionConfig") -> Iterator[tuple[str, float]]:
    for kind in config.kinds or FAULT_KINDS:
        definition: FaultKind = FAULT_KINDS[kind]
        for size in definition.sizes if config.curves else (definition.default,):
            yield kind, size
