"""Read every file of a drive once, and list missing, damaged and implausible data."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from data.beam_pattern import beam_anomalies
from data.clouds.mounting_estimate import estimate_mounting
from data.kitti.oxts import InsPacket
from data.layouts import OpenConfig
from data.open_drive import open_drive, sequences_in
from data.plausibility import (
    Anomaly,
    calibration_anomalies,
    describe_invalid_points,
    label_anomalies,
    motion_anomalies,
    pose_anomalies,
    projection_anomalies,
    rotation_anomalies,
    time_anomalies,
)
from data.recorded_drive import RecordedDrive
from data.reflectance import sample_indices
from perception.errors import (
    CalibrationError,
    DriveError,
    ImageError,
    LabelError,
    MountingError,
    PerceptionError,
    PoseError,
    ScanError,
)
from perception.health.camera_monitors import CameraMonitors
from perception.health.lidar_monitors import LidarMonitors
from perception.health.scan_statistics import ScanMeter
from perception.localization.mounting import check_mounting
from perception.sensor import LidarModel
from perception.types import Float32, Float64, Frame, Progress

_WHAT = {
    ScanError: "scans missing or damaged",
    ImageError: "images missing, damaged or of another size",
    PoseError: "INS packets missing or malformed",
    CalibrationError: "unusable calibration",
    LabelError: "unreadable labels",
    MountingError: "LiDAR mounting that contradicts its axes or its model",
    DriveError: "unreadable timestamps",
}
_MAX_TILT_DEG = 3.0  # camber and the fall of a road to its kerb: up to 2.2


@dataclass(frozen=True)
class Finding:
    """One kind of fault or note.

    Attributes:
        what: Kind of the finding in a few words.
        count: Number of occurrences.
        first_example: First occurrence in one sentence.
        is_fault: Whether it is a fault; False for a note, such as an optional part that is missing.
    """

    what: str
    count: int
    first_example: str
    is_fault: bool = True


@dataclass(frozen=True)
class DriveSummary:
    """Summary of a drive.

    Attributes:
        name: Name of the drive.
        sensor: Name, beams and rate of its LiDAR.
        frames: Number of scans.
        seconds: Time from the first to the last readable scan; 0 for unrelated frames.
        distance_m: Driven distance by the INS in metres, or None without an INS.
        mean_points: Mean number of points of a readable scan.
        parts: Data beside the scans, such as images and labels.
    """

    name: str
    sensor: str
    frames: int
    seconds: float
    distance_m: float | None
    mean_points: float
    parts: tuple[str, ...]


@dataclass(frozen=True)
class DriveReport:
    """Summary of a drive and all findings."""

    summary: DriveSummary
    findings: tuple[Finding, ...]

    @property
    def faults(self) -> int:
        """Number of damaged or implausible data."""
        return sum(finding.count for finding in self.findings if finding.is_fault)

    def text(self) -> str:
        """Return a description of the drive and a table of the findings."""
        drive = self.summary
        words = [f"{drive.frames} frames"]
        if drive.seconds:
            words.append(f"{drive.seconds:.1f} s")
        if drive.distance_m is not None:
            words.append(f"{drive.distance_m:.1f} m driven")
        words.append(f"{drive.sensor} with {drive.mean_points:,.0f} points/scan")
        words.append(f"with {', '.join(drive.parts)}" if drive.parts else "scans only")
        rows = [("", "finding", "count", "first example")] if self.findings else []
        rows += [
            ("fault" if one.is_fault else "note", one.what, str(one.count), one.first_example)
            for one in self.findings
        ]
        widths = [max((len(row[column]) for row in rows), default=0) for column in range(3)]
        table = [
            f"  {kind:{widths[0]}}  {what:{widths[1]}}  {count:>{widths[2]}}  {example}"
            for kind, what, count, example in rows
        ]
        verdict = f"  {self.faults or 'no'} {'fault' if self.faults == 1 else 'faults'}"
        return "\n".join([f"{drive.name}: {', '.join(words)}", *table, verdict, ""])


@dataclass
class _FindingList:
    """Findings so far, by kind."""

    findings: dict[str, Finding] = field(default_factory=dict)
    sentences: set[str] = field(default_factory=set)

    def add(self, what: str, example: str, *, is_fault: bool = True, count: int = 1) -> None:
        known = self.findings.get(what, Finding(what, 0, example, is_fault))
        self.findings[what] = replace(known, count=known.count + count)

    def add_error(self, error: PerceptionError) -> None:
        # A fault of the whole drive is met again in every frame.
        if str(error) not in self.sentences:
            self.sentences.add(str(error))
            self.add(_WHAT.get(type(error), "other"), str(error))

    def add_anomalies(self, anomalies: Iterable[Anomaly]) -> None:
        for anomaly in anomalies:
            self.add(anomaly.what, anomaly.example)


def inspect_path(
    root: Path,
    sequence: str | None,
    reading: OpenConfig,
    progress: Callable[[str], Progress],
) -> Iterator[tuple[str, int]]:
    """Yield what was found in each drive of a path, as text, and the number of its faults.

    Args:
        root: Folder or file of a drive, or of several.
        sequence: Name of the only drive to read; None for all.
        reading: How a drive is read.
        progress: Function from the name of a drive to its progress bar.

    Raises:
        PerceptionError: The only drive cannot be opened.
    """
    sequences = sequences_in(root) if sequence is None else [sequence]
    for name in sequences:
        try:
            drive = open_drive(root, sequence=name, config=reading)
        except PerceptionError as error:
            if len(sequences) == 1:
                raise
            yield f"{name}: cannot be opened\n  {error}\n", 1
            continue
        report = inspect_drive(drive, progress=progress(drive.name))
        yield report.text(), report.faults


def inspect_drive(drive: RecordedDrive, progress: Progress = iter) -> DriveReport:
    """Read every file of a drive once; continue after a fault, so that all are found.

    Args:
        drive: Drive, opened with its images.
        progress: Progress bar around the frame numbers.
    """
    collected = _FindingList()
    points: list[int] = []
    has_reflectance = False
    sampled = sample_indices(len(drive))
    samples: list[Float32] = []
    stamps_s: dict[int, float] = {}
    monitors = _SensorMonitors(drive)
    for index in progress(range(len(drive))):
        frame = _inspect_frame(drive, index, collected)
        if frame is not None:
            if not points or not drive.is_sequence:
                _inspect_setup(frame, drive, collected)
            monitors.update(frame, collected)
            points.append(len(frame.points_velo))
            has_reflectance |= bool(frame.points_velo[:, 3].any())
            if index in sampled:
                samples.append(frame.points_velo[:, :3])
            stamps_s[frame.number] = frame.stamp_s
            if frame.invalid_points:
                sentence, count = describe_invalid_points(frame), frame.invalid_points
                collected.add("points without a return", sentence, is_fault=False, count=count)
        _inspect_truth(drive, index, collected)
    distance_m = None
    if drive.is_sequence:
        collected.add_anomalies(time_anomalies(stamps_s))
        distance_m = _inspect_poses(drive, stamps_s, collected)
        _inspect_tilt(samples, collected)
    _add_notes(drive, collected, has_reflectance=has_reflectance or not points)
    seconds = max(stamps_s.values()) - min(stamps_s.values()) if stamps_s else 0.0
    summary = DriveSummary(
        name=drive.name,
        sensor=_sensor_words(drive.sensor),
        frames=len(drive),
        seconds=seconds if drive.is_sequence else 0.0,
        distance_m=distance_m,
        mean_points=float(np.mean(points)) if points else 0.0,
        parts=tuple(_parts(drive)),
    )
    return DriveReport(summary, tuple(collected.findings.values()))


def _inspect_frame(drive: RecordedDrive, index: int, collected: _FindingList) -> Frame | None:
    """Read scan and image apart, so that a fault of one does not hide a fault of the other."""
    frame = image = None
    try:
        image = drive.image(index)
    except PerceptionError as error:
        collected.add_error(error)
    try:
        frame = drive.scan(index)
    except PerceptionError as error:
        collected.add_error(error)
    if frame is None or frame.calibration is None or image is None:
        return frame
    size_px = (image.shape[1], image.shape[0])
    calibration = replace(frame.calibration, image_size_px=size_px)
    return replace(frame, calibration=calibration, image=image)


class _SensorMonitors:
    """Monitors of what images and scans show; times, poses and missing files are checked by themselves."""

    def __init__(self, drive: RecordedDrive) -> None:
        self._is_sequence = drive.is_sequence
        self._camera, self._scans = CameraMonitors(), LidarMonitors(ScanMeter(drive.sensor))

    def update(self, frame: Frame, collected: _FindingList) -> None:
        """Add the findings of a frame as notes: a run goes on without what has failed."""
        if not self._is_sequence:
            return
        images = () if frame.image is None else self._camera.update(frame)
        for one in (*images, *self._scans.update(frame)):
            sentence = f"frame {frame.number}: {one.reason}"
            collected.add(one.fault, sentence, is_fault=False)


def _inspect_setup(frame: Frame, drive: RecordedDrive, collected: _FindingList) -> None:
    """Check the sensor and the mounting of LiDAR and camera, for which one frame is enough."""
    try:
        check_mounting(frame.points_velo, drive.sensor, frame.source)
    except MountingError as error:
        collected.add_error(error)
    collected.add_anomalies(beam_anomalies(frame, drive.sensor))
    if frame.calibration is None and drive.has_images:
        sentence = f"{frame.source}: its image is not used, as the drive has no camera calibration"
        collected.add("images without calibration", sentence, is_fault=False)
    if frame.calibration is not None:
        collected.add_anomalies(calibration_anomalies(frame.calibration))
        collected.add_anomalies(projection_anomalies(frame, is_forward=drive.has_forward_camera))


def _inspect_tilt(scans: list[Float32], collected: _FindingList) -> None:
    """Note a LiDAR that is tilted more than roads are: its cars are tilted as much."""
    mounting = estimate_mounting(scans) if scans else None
    if mounting is None or mounting.height_m is None or mounting.axes[2] != "up":
        return
    roll_deg, pitch_deg = np.degrees([mounting.roll_rad, mounting.pitch_rad]).round(1) + 0.0
    if max(abs(roll_deg), abs(pitch_deg)) > _MAX_TILT_DEG:
        sentence = (
            f"expected a level LiDAR, found roll {roll_deg:.1f}, pitch {pitch_deg:.1f} degrees against the road; "
            "a folder of scans states them in drive.yaml, which trifuse adopt writes"
        )
        collected.add("LiDAR tilted", sentence, is_fault=False)


def _inspect_truth(drive: RecordedDrive, index: int, collected: _FindingList) -> None:
    try:
        if drive.has_labels:
            size = drive.calibration.image_size_px if drive.calibration else None
            where = f"frame {drive.frame_numbers[index]}"
            collected.add_anomalies(label_anomalies(drive.labels(index), size, where))
        if drive.has_point_truth:
            drive.point_truth(index)
    except ScanError:
        pass  # reported where the frame was read
    except PerceptionError as error:
        collected.add_error(error)


def _inspect_poses(
    drive: RecordedDrive, stamps_s: dict[int, float], collected: _FindingList
) -> float | None:
    """Read every pose, and every INS packet where there are any, look for jumps, and return the distance driven."""
    if not drive.has_poses:
        return None
    if drive.velo_SE3_imu is not None:
        collected.add_anomalies(
            rotation_anomalies(drive.velo_SE3_imu, f"{drive.name} velo_SE3_imu")
        )
    packets: dict[int, InsPacket] = {}
    poses: dict[int, Float64] = {}
    for index in range(len(drive)):
        try:
            packet, pose = drive.ins_packet(index), drive.world_SE3_velo(index)
        except PoseError as error:
            collected.add_error(error)
            continue
        number = drive.frame_numbers[index]
        if packet is not None:
            packets[number] = packet
        if pose is not None:
            poses[number] = pose
    period_s = 1 / drive.sensor.rate_hz
    if packets:
        collected.add_anomalies(motion_anomalies(packets, stamps_s, period_s))
    else:
        collected.add_anomalies(pose_anomalies(poses, stamps_s, period_s))
    positions_m = [pose[:3, 3] for pose in poses.values()]
    return float(sum(np.linalg.norm(b - a) for a, b in pairwise(positions_m)))


def _parts(drive: RecordedDrive) -> Iterator[str]:
    present = {
        "images": drive.has_images,
        "INS": drive.has_poses,
        "labels": drive.has_labels,
        "point truth": drive.has_point_truth,
    }
    return (part for part, is_present in present.items() if is_present)


def _sensor_words(sensor: LidarModel) -> str:
    beams = f"{sensor.beams} beams, " if sensor.has_rings else ""
    return f"{sensor.name} ({beams}{sensor.rate_hz:g} Hz)"


def _numbering_gaps(drive: RecordedDrive) -> Iterator[str]:
    for index, (number, following) in enumerate(pairwise(drive.frame_numbers)):
        if following > number + 1:
            found = Path(drive.source(index + 1)).name
            yield f"{drive.source(index)}: expected the next number after it, found {found}"


def _add_notes(drive: RecordedDrive, collected: _FindingList, *, has_reflectance: bool) -> None:
    """Note missing parts, gaps in the numbering, and files that are not used as they are."""
    for note in drive.notes:  # each is of its own kind
        collected.findings[note] = Finding("data not used as they are", 1, note, is_fault=False)
    for sentence in _numbering_gaps(drive) if drive.is_sequence else ():
        collected.add("gaps in the numbering", sentence, is_fault=False)
    consequences = {
        "images": (drive.has_images, "stages that need a camera cannot run"),
        "INS": (drive.has_poses or not drive.is_sequence, "poses come from registration alone"),
        "labels": (drive.has_labels, "no evaluation against labels"),
        "reflectance": (has_reflectance, "all are 0; the reflectance map shows nothing"),
    }
    for part, (is_present, consequence) in consequences.items():
        if not is_present:
            collected.add(f"no {part}", f"{drive.root}: {consequence}", is_fault=False)
