"""What can be seen of a folder of scans: sensor, mounting, scale, rate, and where its parts lie; with how sure it is."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from data.clouds.cloud import COLUMNS, Cloud
from data.clouds.lidar_estimate import LidarEstimate, estimate_lidar
from data.clouds.mounting_estimate import MountingEstimate, estimate_mounting, upward_axis
from data.clouds.pcd import read_viewpoint
from data.clouds.read_cloud import read_cloud
from data.clouds.rows_file import DEFAULT_COLUMNS, columns_in_rows
from data.folder.config import FolderConfig, LidarConfig, PosesConfig
from data.folder.discovery import (
    cloud_files,
    find_images,
    find_poses,
    find_scans,
    find_times,
    image_files,
)
from data.folder.label_discovery import find_labels
from data.folder.stamps import read_stamps, stamps_in_names
from data.kitti.sensor_files import FrameFiles, describe_folder, list_folder
from data.packets.recording import Recording
from data.reflectance import full_scale, sample_indices
from perception.errors import DriveError, ScanError
from perception.types import Int

Certainty = Literal["sure", "likely", "guess"]
_SAMPLES, _PAIRS = 6, 4
_SURE_SUPPORT = 0.2
_MIN_TILT_DEG = 0.3  # less is within the error of the estimate
_MAX_RINGS = 256
_USUAL_RATE_HZ = 10.0


@dataclass(frozen=True)
class Observation:
    """One property of a drive.

    Attributes:
        what: Name of the property.
        value: Value in a few words.
        certainty: Whether it is sure, likely, or a guess.
        reason: Data that it was seen in.
        field: Field of drive.yaml that states it.
    """

    what: str
    value: str
    certainty: Certainty
    reason: str
    field: str = ""


@dataclass(frozen=True)
class FolderObservation:
    """All that can be seen of a folder.

    Attributes:
        config: What drive.yaml states of it.
        observations: The same with reasons.
        images: Folder of the images of each camera below that of the drive, the likely main one first.
    """

    config: FolderConfig
    observations: tuple[Observation, ...]
    images: tuple[str, ...]

    @property
    def guesses(self) -> tuple[Observation, ...]:
        """What is no more than a guess."""
        return tuple(one for one in self.observations if one.certainty == "guess")


def observe_folder(root: Path, columns: Sequence[str] | None = None) -> FolderObservation:
    """Look at the files of a folder, and at some of its scans.

    Args:
        root: Folder of the drive.
        columns: Names of the columns of the scans, where they cannot be read off the files.

    Raises:
        DriveError: There is no scan.
        ScanError: No scan can be read.
    """
    folder = find_scans(root)
    if folder is None:
        raise DriveError(root, expected="scans of a LiDAR", found=describe_folder(root))
    files = cloud_files(folder)
    names, columns_seen = _columns(files, columns)
    clouds, seen = _read_samples(lambda index: read_cloud(files.paths[index], names), files)
    lidar = _estimate_lidar(clouds)
    stamps, stamps_file, times_seen = _times(root, files)
    rate_hz, rate_seen = _rate(stamps, clouds, lidar)
    found = [
        Observation("scans", f"{len(files)} {files.paths[0].suffix} files", "sure", folder.name, "scans"),
        columns_seen, *_sensor_observations(lidar), *seen.observations, times_seen, rate_seen,
    ]  # fmt: skip
    if (viewpoint := viewpoint_observation(files)) is not None:
        found.append(viewpoint)
    config = replace(
        seen.config.lidar,
        scans=_relative(folder, root),
        columns=None if names is None else tuple(names),
        rate_hz=rate_hz,
        timestamps=None if stamps_file is None else _relative(stamps_file, root),
        point_labels=_point_labels(root, folder),
        viewpoint=None if viewpoint is None else "ignored",
    )
    poses = find_poses(root)
    if poses is not None:
        found.append(Observation("poses", f"{poses[1]} format", "likely", poses[0].name, "file"))
    images = tuple(_relative(one, root) for one in find_images(root, len(files)))
    for one in images:
        count = len(image_files(root / one))
        found.append(Observation("images", f"{count} images", "likely", one, "images"))
    labels = find_labels(root, folder)
    if labels is not None:
        found.append(Observation("labels", labels[1].name, "likely", _relative(labels[0], root)))
    return FolderObservation(
        FolderConfig(
            lidar=_with_sensor(config, lidar),
            poses=None if poses is None else PosesConfig(_relative(poses[0], root), poses[1]),
            labels=None if labels is None else _relative(labels[0], root),
        ),
        tuple(found),
        images,
    )


def observe_recording(recording: Recording) -> FolderObservation:
    """Look at some sweeps of a recording of packets, which state sensor, times and rate.

    Raises:
        ScanError: No sweep can be read.
    """
    _, seen = _read_samples(recording.cloud, recording.files)
    sensor, root = recording.sensor, recording.path.parent
    low_deg, high_deg = np.degrees(sensor.elevations_rad[[-1, 0]])
    beams = f"{sensor.name}: {sensor.beams} beams from {low_deg:.1f} to {high_deg:.1f} degrees"
    count = f"{len(recording.sweeps)} sweeps"
    found = [
        Observation("scans", count, "sure", recording.path.name, "scans"),
        Observation("sensor", beams, "sure", f"packets from {recording.sender}", "sensor"),
        *seen.observations,
        Observation("rate", f"{sensor.rate_hz:g} Hz", "sure", "times of the packets", "rate_hz"),
    ]
    file = recording.beams_file
    config = replace(
        seen.config.lidar,
        scans=recording.path.name,
        address=str(recording.sender),
        sensor=None
        if file is None
        else str(file.relative_to(root) if root in file.parents else file),
    )
    return FolderObservation(FolderConfig(lidar=config), tuple(found), ())


def _read_samples(
    read: Callable[[int], Cloud], files: FrameFiles
) -> tuple[list[Cloud], FolderObservation]:
    """Read some scans; return them, and what is seen of mounting and reflectance."""
    clouds = _read_some(read, files)
    pairs = _read_pairs(read, len(files))
    mounting = estimate_mounting([cloud.xyz for cloud in clouds], pairs)
    scale, scale_seen = _reflectance_scale(clouds)
    config = LidarConfig(
        height_m=None if mounting.height_m is None else round(mounting.height_m, 3),
        axes=mounting.axes,  # type: ignore[arg-type]
        roll_deg=_tilt_deg(mounting.roll_rad),
        pitch_deg=_tilt_deg(mounting.pitch_rad),
        reflectance_scale=scale,
    )
    found = (*_mounting_observations(mounting), scale_seen)
    return clouds, FolderObservation(FolderConfig(lidar=config), found, ())


def _relative(path: Path, root: Path) -> str:
    return path.relative_to(root).as_posix()


def _columns(
    files: FrameFiles, columns: Sequence[str] | None
) -> tuple[Sequence[str] | None, Observation]:
    """Return the names of the columns where the files have none and they are not KITTI's."""
    path = files.paths[0]
    if columns is not None:
        return columns, Observation("columns", " ".join(columns), "sure", "as named", "columns")
    if path.suffix.lower() != ".bin":
        cloud = read_cloud(path)
        parts = {"intensity": cloud.intensity, "ring": cloud.ring, "t": cloud.times_s}
        words = " ".join(["x y z", *(name for name, values in parts.items() if values is not None)])
        return None, Observation("columns", words, "sure", f"read from {path.name}")
    count = columns_in_rows(path)
    names = list(COLUMNS[:count])
    if count == len(DEFAULT_COLUMNS) + 1 and not _is_ring(path, count):
        names[-1] = "t"
    seen = Observation(
        "columns", " ".join(names), "likely", "neighbouring rows are most alike", "columns"
    )
    return (None if count == len(DEFAULT_COLUMNS) else names), seen


def _is_ring(path: Path, count: int) -> bool:
    rows = np.frombuffer(path.read_bytes(), np.float32).reshape(-1, count)
    last = rows[:, -1]
    return bool((last == np.round(last)).all() and last.min() >= 0 and last.max() < _MAX_RINGS)


def _read_some(read: Callable[[int], Cloud], files: FrameFiles) -> list[Cloud]:
    """Read some scans throughout the drive; damaged ones are met when the drive is checked."""
    clouds, failure = [], None
    for index in sample_indices(len(files), _SAMPLES):
        try:
            clouds.append(read(index))
        except ScanError as error:
            failure = failure or error
    clouds = [_finite(cloud) for cloud in clouds if len(cloud)]
    if not clouds:
        raise failure or ScanError(files.folder, expected="at least one return", found="none")
    return clouds


def _read_pairs(read: Callable[[int], Cloud], count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    pairs = []
    for index in sample_indices(count - 1, _PAIRS):
        try:
            pair = [_finite(read(one)).xyz for one in (index, index + 1)]
        except ScanError:
            continue
        pairs.append((pair[0], pair[1]))
    return pairs


def _finite(cloud: Cloud) -> Cloud:
    """Leave out points that are no measurement."""
    with np.errstate(invalid="ignore"):
        kept = (np.abs(cloud.xyz) < 1e4).all(axis=1) & (np.abs(cloud.xyz) > 0).any(axis=1)
    return Cloud(
        cloud.xyz[kept],
        None if cloud.intensity is None else cloud.intensity[kept],
        None if cloud.ring is None else cloud.ring[kept],
        None if cloud.times_s is None else cloud.times_s[kept],
    )


def _estimate_lidar(clouds: Sequence[Cloud]) -> LidarEstimate | None:
    scans = [cloud.xyz for cloud in clouds]
    up, sign = upward_axis(scans)
    return estimate_lidar(scans, [cloud.ring for cloud in clouds], sign * np.eye(3)[up])


def _with_sensor(config: LidarConfig, lidar: LidarEstimate | None) -> LidarConfig:
    if lidar is None:
        return config
    if lidar.model is not None:
        return replace(config, sensor=lidar.model.name)
    step_rad = lidar.azimuth_step_rad
    elevations_deg = np.degrees(lidar.elevations_rad).round(3)
    return replace(
        config,
        sensor=f"LiDAR with {len(elevations_deg)} beams",
        elevations_deg=tuple(elevations_deg.tolist()),
        azimuth_step_deg=config.azimuth_step_deg
        if step_rad is None
        else round(float(np.degrees(step_rad)), 4),
    )


def viewpoint_observation(files: FrameFiles) -> Observation | None:
    """Return what is to be said of scans with a pose of the sensor; None where the scans that are looked at have none."""
    some = [files.paths[index] for index in sample_indices(len(files), _SAMPLES)]
    stated = [(path.name, pose) for path in some if (pose := read_viewpoint(path)) is not None]
    if not stated:
        return None
    name, pose = stated[0]
    turn_deg = np.degrees(Rotation.from_matrix(pose[:3, :3]).magnitude())
    reason = (
        f"{name} states a pose of {np.linalg.norm(pose[:3, 3]):.2f} m and {turn_deg:.1f} degrees; "
        "trifuse adopt --viewpoint applied moves points by it, --viewpoint undone by its inverse"
    )
    return Observation("VIEWPOINT", "ignored", "guess", reason, "viewpoint")


def _sensor_observations(lidar: LidarEstimate | None) -> list[Observation]:
    if lidar is None:
        return [Observation("sensor", "unknown", "guess", "too few returns to see beams", "sensor")]
    low_deg, high_deg = np.degrees(lidar.elevations_rad[[-1, 0]])
    beams = f"{len(lidar.elevations_rad)} beams from {low_deg:.1f} to {high_deg:.1f} degrees"
    source = "rings of the files" if lidar.has_rings else "elevations of the returns"
    if not lidar.is_about_lidar:
        reason = f"beams scatter by {np.degrees(lidar.scatter_rad):.1f} degrees: points are not about the origin of one LiDAR"
        return [Observation("sensor", beams, "guess", reason, "sensor")]
    if not lidar.is_on_beams:
        reason = f"returns from {low_deg:.1f} to {high_deg:.1f} degrees follow no rings"
        model = lidar.model.name if lidar.model else f"no known model: {beams}"
        return [
            Observation("sensor", model, "likely" if lidar.model else "guess", reason, "sensor")
        ]
    if lidar.model is None:
        certainty: Certainty = "sure" if lidar.has_rings else "likely"
        return [Observation("sensor", f"no known model: {beams}", certainty, source, "sensor")]
    share = lidar.fitting[0][1]
    others = ", ".join(name for name, other in lidar.fitting[1:] if other > share - 0.05)
    reason = f"{source}: {beams}, {share:.0%} agree" + (f"; {others} fits, too" if others else "")
    return [
        Observation(
            "sensor",
            lidar.model.name,
            "likely" if others or share < 0.97 else "sure",
            reason,
            "sensor",
        )
    ]


def _mounting_observations(mounting: MountingEstimate) -> list[Observation]:
    is_moving = mounting.is_forward_known
    axes = Observation(
        "axes",
        ", ".join(f"{axis} {way}" for axis, way in zip("xyz", mounting.axes, strict=True)),
        "sure" if is_moving and mounting.height_m else "guess",
        f"ground, and {mounting.moved_m:.1f} m driven"
        if is_moving
        else "no motion shows which way is forward",
        "axes",
    )
    if mounting.height_m is None:
        return [axes, Observation("height", "unknown", "guess", "no ground was found", "height_m")]
    is_sure = mounting.ground_support >= _SURE_SUPPORT
    seen: Certainty = "sure" if is_sure else "likely"
    share = f"{mounting.ground_support:.0%} of the near points are ground"
    tilt = f"roll {_tilt_deg(mounting.roll_rad):.1f}, pitch {_tilt_deg(mounting.pitch_rad):.1f} degrees"
    return [
        axes,
        Observation("height", f"{mounting.height_m:.2f} m", seen, share, "height_m"),
        Observation("tilt", tilt, seen if is_moving else "guess", share, "pitch_deg"),
    ]


def _tilt_deg(angle_rad: float) -> float:
    angle_deg = round(float(np.degrees(angle_rad)), 2)
    return angle_deg if abs(angle_deg) >= _MIN_TILT_DEG else 0.0


def _reflectance_scale(clouds: Sequence[Cloud]) -> tuple[float, Observation]:
    values = [cloud.intensity for cloud in clouds if cloud.intensity is not None]
    largest = max((float(one[np.isfinite(one)].max(initial=0.0)) for one in values), default=0.0)
    if largest == 0:
        reason = "all values are 0" if values else "no column of it"
        return 1.0, Observation("reflectance", "none", "sure", reason, "reflectance_scale")
    scale = full_scale(largest)
    is_full = largest > 0.9 * scale
    reason = f"largest value {largest:g}"
    certainty: Certainty = "sure" if scale == 1 or is_full else "likely"
    return scale, Observation(
        "reflectance", f"0 to {scale:g}", certainty, reason, "reflectance_scale"
    )


def _times(root: Path, files: FrameFiles) -> tuple[Int | None, Path | None, Observation]:
    path = find_times(root, files.folder)
    if path is not None:
        try:
            stamps = read_stamps(path, len(files))
            return stamps, path, Observation("times", "a file", "sure", path.name, "timestamps")
        except DriveError:
            pass  # times of something else, such as the images
    named = stamps_in_names(files.paths)
    if named is not None:
        return named, None, Observation("times", "names of the scans", "sure", files.paths[0].name)
    return (
        None,
        None,
        Observation("times", "a steady rate", "guess", "no times in names or a file", "timestamps"),
    )


def _rate(
    stamps: Int | None, clouds: Sequence[Cloud], lidar: LidarEstimate | None
) -> tuple[float, Observation]:
    if stamps is not None and len(stamps) > 1:
        period_s = float(np.median(np.diff(np.sort(stamps)))) * 1e-9
        if period_s > 0:
            rate = round(1 / period_s, 2)
            return rate, Observation(
                "rate", f"{rate:g} Hz", "sure", "times of the scans", "rate_hz"
            )
    spans = [np.ptp(cloud.times_s) for cloud in clouds if cloud.times_s is not None and len(cloud)]
    if spans and 0.01 < (span := float(np.median(spans))) < 1:
        rate = float(round(1 / span))
        return rate, Observation("rate", f"{rate:g} Hz", "likely", "times of the points", "rate_hz")
    model = lidar.model if lidar is not None else None
    rate = model.rate_hz if model is not None else _USUAL_RATE_HZ
    return rate, Observation("rate", f"{rate:g} Hz", "guess", "the usual one", "rate_hz")


def _point_labels(root: Path, scans: Path) -> str | None:
    folders = (path for base in (scans.parent, root) for path in sorted(list_folder(base)))
    with_labels = (
        f for f in folders if f.is_dir() and f.is_relative_to(root) and any(f.glob("*.label"))
    )
    found = next(with_labels, None)
    return None if found is None else _relative(found, root)
