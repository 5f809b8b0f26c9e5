"""Which faults of sensors are named, how soon, and how often a clean drive raises an alarm."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from benchmarks.studies.frame_rate import frame_step
from benchmarks.studies.report import publish
from data.synthetic.words import StreetKind
from perception.cli.flags import SourceFlags
from perception.cli.parser import FlagGroup
from perception.cli.progress import progress_bar
from perception.errors import UsageError
from perception.evaluation.report import Metric, Metrics, Table
from perception.render.curve_plots import Curve, CurvePanel, plot_curves
from perception.sensor.files import load_sensor
from perception.types import CALIBRATION, Drive

if TYPE_CHECKING:
    from benchmarks.studies.monitored_recording import MonitoredRecording
    from data.faults.kinds import FaultKind

_MIN_SPEED_M_S = 1.0  # a frozen pose of a vehicle that stands is no fault yet
_USUAL_HZ = 10.0  # at which sizes of faults in time are as they stand; at others they are the same share of a period
_BY_PERIOD = ("lidar-late", "lidar-out-of-order")


@dataclass(frozen=True)
class InjectionConfig(FlagGroup):
    """Faults that are injected.

    Attributes:
        injections: Number of faults of each kind and size, in each drive.
        kinds: Kinds of faults; none for all.
        frames: Number of frames of each drive; 0 for all.
        rates: Frame rates in Hz: synthetic drives are made at each, recorded ones thinned to it; none for that of
            the drive.
        within: Number of frames within which a fault must be named; above 10 Hz the time of as many at 10 Hz.
        calibration_within: The same of the calibration, which edges tell over two seconds.
        worlds: Number of synthetic drives, made in memory one after the other, beside those of the folders.
        world_sensors: LiDAR models of the synthetic drives, in turn.
        world_street: Kind of their streets; else any.
        world_night: Whether it is night there.
        world_images: Whether synthetic drives have images, which take most of the time.
        seed: Seed of the faults.
        curves: Inject faults of all sizes, not of the default size alone.
    """

    injections: int = 20
    kinds: tuple[str, ...] = ()
    frames: int = 0
    rates: tuple[float, ...] = ()
    within: int = 5
    calibration_within: int = 30
    worlds: int = 0
    world_sensors: tuple[str, ...] = ("HDL-64E", "VLP-16", "OS1-64")
    world_street: StreetKind | None = None
    world_night: bool = False
    world_images: bool = True
    seed: int = 0
    curves: bool = False


@dataclass
class FaultDetection(Metrics):
    """Faults of one kind and size.

    Attributes:
        faults: Number of faults.
        named: Number of faults that were named in time.
        delays: Frames from the first one of a fault to that which names it, of the faults that are named in time.
        delays_s: The same in seconds.
    """

    faults: Annotated[int, Metric("faults")] = 0
    named: Annotated[int, Metric("named")] = 0
    delays: list[int] = field(default_factory=list)
    delays_s: list[float] = field(default_factory=list)

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

    @property
    def mean_delay_s(self) -> Annotated[float, Metric("mean [s]", ".2f")]:
        """Mean delay in seconds."""
        return float(np.mean(self.delays_s)) if self.delays_s else float("nan")


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


def fault_detection(
    roots: tuple[str, ...] = (),
    *,
    source: SourceFlags,
    config: InjectionConfig,
    out: Path = Path("results/fault-detection.png"),
) -> None:
    """Inject faults of sensors into drives; measure which are named within five frames, and false alarms.

    With --injections 0 false alarms alone are counted; --worlds 100 drives the monitors through synthetic drives, and
    --rates 2,5,10,20 measures each frame rate.

    Example: trifuse study fault-detection kitti/tracking --sequence 0000

    Args:
        roots: Folders or files of drives; of several drives in a folder, all are read. None with --worlds.
        out: Figure; a JSON file with the numbers is written beside it.
    """
    from benchmarks.studies.monitored_recording import MonitoredRecording
    from data.faults.kinds import FAULT_KINDS

    if not roots and not config.worlds:
        raise UsageError(
            "ROOTS",
            expected="folders of drives, or --worlds",
            found="neither",
            advice="name a drive, or add --worlds 20 for synthetic ones",
        )
    if unknown := [kind for kind in config.kinds if kind not in FAULT_KINDS]:
        expected = f"some of {', '.join(FAULT_KINDS)}"
        raise UsageError("--kinds", expected=expected, found=", ".join(unknown))
    clean, detections = dict[str, CleanDriving](), dict[str, FaultDetection]()
    for rate_hz in config.rates or (None,):
        name = "all" if rate_hz is None else f"{rate_hz:g} Hz"
        one = clean.setdefault(name, CleanDriving())
        drives = _drives(roots, source, config, rate_hz)
        for drive in progress_bar(drives, f"drives, {name}", unit="drive"):
            step = frame_step(drive, rate_hz)
            recording = MonitoredRecording.of(drive, config.frames, step)
            one.frames += len(recording.frames)
            one.seconds += recording.frames[-1].stamp_s - recording.frames[0].stamp_s
            one.alarms += [f"{name}: {alarm}" for alarm in recording.alarms()]
            _inject_all(recording, config, rate_hz, detections)
        for alarm in one.alarms:
            print(alarm)
    tables: dict[str, Table[Any]] = {
        "clean": Table("clean driving", CleanDriving.columns(), clean),
        "faults": Table("faults", FaultDetection.columns(), detections),
    }
    plot_curves(out, "Faults named in time", _panels(detections), columns=5, share_y="all")
    publish(out, "faults of sensors", tables, {"config": config, "drives": roots})


def _drives(
    roots: Sequence[str], source: SourceFlags, config: InjectionConfig, rate_hz: float | None
) -> Iterator[Drive]:
    """Yield the recorded drives, and the synthetic ones at a frame rate."""
    from data.open_drive import open_drive, sequences_in
    from data.synthetic.collection import SynthConfig, draw_drive

    for root in roots:
        names = sequences_in(Path(root)) if source.sequence is None else [source.sequence]
        for name in names:
            yield open_drive(Path(root), sequence=name, config=source.reading, images=True)
    for number in range(config.worlds):
        sensor = load_sensor(config.world_sensors[number % len(config.world_sensors)])
        synth = SynthConfig(
            sensor=replace(sensor, rate_hz=rate_hz or sensor.rate_hz),
            seed=config.seed + 1,
            images=config.world_images,
            street=config.world_street,
            is_night=config.world_night,
        )
        yield draw_drive(synth, number + 1, config.frames or synth.frames)


def _inject_all(
    recording: "MonitoredRecording",
    config: InjectionConfig,
    rate_hz: float | None,
    detections: dict[str, FaultDetection],
) -> None:
    """Inject faults of each kind and size at random frames."""
    from benchmarks.studies.monitored_recording import WARM_UP
    from data.faults.injection import Fault
    from data.faults.kinds import FAULT_KINDS

    rng = np.random.default_rng(config.seed)
    periods = 1.0 if rate_hz is None else _USUAL_HZ / rate_hz
    for kind, size in _cases(config):
        part = FAULT_KINDS[kind].part
        # Edges tell the calibration over two seconds.
        within = config.calibration_within if part == CALIBRATION else config.within
        within = round(within / min(periods, 1.0))
        last = len(recording.frames) - within
        if part not in recording.parts or last <= WARM_UP:
            continue
        name = f"{kind} {size:g}" if rate_hz is None else f"{kind} {size:g}, {rate_hz:g} Hz"
        detection = detections.setdefault(name, FaultDetection())
        of_rate = size * periods if kind in _BY_PERIOD else size
        for _ in range(config.injections):
            first, seed = int(rng.integers(WARM_UP, last)), int(rng.integers(1 << 30))
            if kind == "ins-frozen" and recording.speed_m_s(first) < _MIN_SPEED_M_S:
                continue
            fault = Fault(kind, first, first + within - 1, of_rate, seed)
            delay = recording.delay(fault, within)
            detection.faults += 1
            if delay is not None:
                detection.named += 1
                detection.delays.append(delay)
                frames = recording.frames
                detection.delays_s.append(frames[first + delay].stamp_s - frames[first].stamp_s)


def _panels(detections: Mapping[str, FaultDetection]) -> list[CurvePanel]:
    """Return the recall of each kind of fault over its size, a curve for each frame rate."""
    from data.faults.kinds import FAULT_KINDS

    by_kind: dict[str, dict[str, dict[float, float]]] = {}
    for name, one in detections.items():
        case, _, rate = name.partition(", ")
        kind, size = case.split()
        by_kind.setdefault(kind, {}).setdefault(rate or "recall", {})[float(size)] = one.recall
    return [
        CurvePanel(
            kind,
            FAULT_KINDS[kind].size or "size",
            "recall",
            [Curve(rate, list(recalls), list(recalls.values())) for rate, recalls in rates.items()],
            y_limits=(0.0, 1.05),
        )
        for kind, rates in by_kind.items()
    ]


def _cases(config: InjectionConfig) -> Iterator[tuple[str, float]]:
    from data.faults.kinds import FAULT_KINDS

    for kind in config.kinds or FAULT_KINDS:
        definition: FaultKind = FAULT_KINDS[kind]
        for size in definition.sizes if config.curves else (definition.default,):
            yield kind, size
