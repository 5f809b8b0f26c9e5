"""Read everything of a drive once, and list what is missing, damaged or implausible."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from data.kitti.objects import ObjectFrames
from data.kitti.sequence import KittiSequence
from data.plausibility import (
    Oddity,
    calibration_oddities,
    label_oddities,
    motion_oddities,
    projection_oddities,
    rotation_oddities,
    time_oddities,
)
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
from perception.geometry.mounting import check_mounting
from perception.types import Frame, Progress

KittiDrive = KittiSequence | ObjectFrames

_WHAT = {
    ScanError: "scans missing or damaged",
    ImageError: "images missing, damaged or of another size",
    PoseError: "INS packets missing or malformed",
    CalibrationError: "calibration that cannot be used",
    LabelError: "labels that cannot be read",
    MountingError: "LiDAR not where its axes and its model say",
    DriveError: "timestamps that cannot be read",
}


@dataclass(frozen=True)
class Finding:
    """One kind of thing that is not as it should be.

    Attributes:
        what: in a few words.
        count: how often.
        first_example: the first of them in one sentence.
        is_fault: False where it is worth knowing but no fault, such as a part that is optional.
    """

    what: str
    count: int
    first_example: str
    is_fault: bool = True


@dataclass(frozen=True)
class DriveSummary:
    """What a drive is.

    Attributes:
        name: of the drive.
        sensor: name of its LiDAR.
        frames: their number, missing ones included.
        seconds: from the first to the last readable scan; 0 for unrelated frames.
        distance_m: driven, by the INS, or None without one.
        mean_points: in a readable scan.
        parts: what there is beside the scans.
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
    """What a drive is, and everything found in it."""

    summary: DriveSummary
    findings: tuple[Finding, ...]

    @property
    def faults(self) -> int:
        """How many things are damaged or implausible."""
        return sum(finding.count for finding in self.findings if finding.is_fault)


@dataclass
class _Notebook:
    """Findings so far, by what they are."""

    findings: dict[str, Finding] = field(default_factory=dict)

    def add(self, what: str, example: str, *, is_fault: bool = True) -> None:
        known = self.findings.get(what, Finding(what, 0, example, is_fault))
        self.findings[what] = replace(known, count=known.count + 1)

    def add_error(self, error: PerceptionError) -> None:
        self.add(_WHAT.get(type(error), "other"), str(error))

    def add_oddities(self, oddities: Iterable[Oddity]) -> None:
        for oddity in oddities:
            self.add(oddity.what, oddity.example)


def inspect_drive(drive: KittiDrive, progress: Progress = iter) -> DriveReport:
    """Read every file of a drive once; go on after a fault, so that all are found.

    Args:
        drive: opened with its images.
        progress: wraps the frame numbers, as a progress bar does.
    """
    notebook = _Notebook()
    points: list[int] = []
    stamps_s: dict[int, float] = {}
    for index in progress(range(len(drive))):
        frame = _inspect_frame(drive, index, notebook)
        if frame is not None:
            if not points or not drive.is_sequence:
                _inspect_setup(frame, drive, notebook)
            points.append(len(frame.points_velo))
            stamps_s[index] = frame.stamp_s
        _inspect_truth(drive, index, notebook)
    distance_m = None
    if isinstance(drive, KittiSequence):
        notebook.add_oddities(time_oddities(stamps_s))
        distance_m = _inspect_ins(drive, stamps_s, notebook)
    _note_what_is_not_there(drive, notebook)
    seconds = max(stamps_s.values()) - min(stamps_s.values()) if stamps_s else 0.0
    summary = DriveSummary(
        name=drive.name,
        sensor=drive.sensor.name,
        frames=len(drive),
        seconds=seconds if drive.is_sequence else 0.0,
        distance_m=distance_m,
        mean_points=float(np.mean(points)) if points else 0.0,
        parts=tuple(_parts(drive)),
    )
    return DriveReport(summary, tuple(notebook.findings.values()))


def _inspect_frame(drive: KittiDrive, index: int, notebook: _Notebook) -> Frame | None:
    """Read scan and image apart, so that a fault of one does not hide a fault of the other."""
    frame = image = None
    try:
        image = drive.image(index)
    except PerceptionError as error:
        notebook.add_error(error)
    try:
        frame = _scans_of(drive)[index]
    except PerceptionError as error:
        notebook.add_error(error)
    if frame is None or frame.calibration is None or image is None:
        return frame
    size_px = (image.shape[1], image.shape[0])
    return replace(frame, calibration=replace(frame.calibration, image_size_px=size_px))


def _scans_of(drive: KittiDrive) -> KittiDrive:
    if isinstance(drive, KittiSequence):
        return replace(drive, images=None, ins=None)
    return replace(drive, images=None)


def _inspect_setup(frame: Frame, drive: KittiDrive, notebook: _Notebook) -> None:
    """Look at how LiDAR and camera are mounted, which one frame of a drive tells."""
    try:
        check_mounting(frame.points_velo, drive.sensor, frame.source)
    except MountingError as error:
        notebook.add_error(error)
    if frame.calibration is not None:
        notebook.add_oddities(calibration_oddities(frame.calibration))
        notebook.add_oddities(projection_oddities(frame))


def _inspect_truth(drive: KittiDrive, index: int, notebook: _Notebook) -> None:
    try:
        if drive.has_labels:
            size = drive.calibration.image_size_px if drive.calibration else None
            notebook.add_oddities(label_oddities(drive.labels(index), size, f"frame {index}"))
        if drive.point_labels is not None:
            drive.point_truth(index)
    except ScanError:
        pass  # said already where the frame was read
    except PerceptionError as error:
        notebook.add_error(error)


def _inspect_ins(
    drive: KittiSequence, stamps_s: dict[int, float], notebook: _Notebook
) -> float | None:
    """Read every packet, look for jumps, and return the distance driven."""
    if drive.ins is None:
        return None
    if drive.velo_SE3_imu is not None:
        notebook.add_oddities(rotation_oddities(drive.velo_SE3_imu, f"{drive.name} velo_SE3_imu"))
    packets = {}
    for index in range(len(drive)):
        try:
            packets[index] = drive.ins_packet(index)
        except PoseError as error:
            notebook.add_error(error)
    period_s = 1 / drive.sensor.rate_hz
    notebook.add_oddities(motion_oddities(packets, stamps_s, period_s))
    poses = [drive.world_SE3_velo(index) for index in packets]
    positions_m = [pose[:3, 3] for pose in poses if pose is not None]
    return float(sum(np.linalg.norm(b - a) for a, b in pairwise(positions_m)))


def _parts(drive: KittiDrive) -> Iterator[str]:
    there = {
        "images": drive.has_images,
        "INS": drive.has_poses,
        "labels": drive.has_labels,
        "point truth": drive.point_labels is not None,
    }
    return (part for part, is_there in there.items() if is_there)


def _note_what_is_not_there(drive: KittiDrive, notebook: _Notebook) -> None:
    consequences = {
        "images": (drive.has_images, "the stages that need a camera cannot run"),
        "INS": (drive.has_poses or not drive.is_sequence, "registration alone gives the poses"),
        "labels": (drive.has_labels, "nothing can be measured against labels"),
    }
    for part, (is_there, consequence) in consequences.items():
        if not is_there:
            notebook.add(f"no {part}", f"{drive.root}: {consequence}.", is_fault=False)
