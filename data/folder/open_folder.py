"""Open a folder of scans by its drive.yaml, or by what can be seen where it has none."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from data.box_labels.box_labels import BoxLabels
from data.box_labels.forms import is_in_view, require_form
from data.box_labels.image_labels import ImageLabels
from data.box_labels.kitti_rows import with_camera
from data.derived.instance_boxes import labelled_by_instances
from data.drive_images import ImageFiles
from data.folder.config import FILE_NAME, CameraConfig, FolderConfig, LidarConfig
from data.folder.discovery import cloud_files, find_scans, image_files
from data.folder.drive import FolderDrive, velo_to_body
from data.folder.labelled_drive import (
    LabelledFolderDrive,
    LabelledImagesDrive,
    LabelledPointsDrive,
)
from data.folder.observation import observe_folder, observe_recording, viewpoint_observation
from data.folder.pose_track import PoseTrack, read_pose_track
from data.folder.stamps import read_stamps, stamps_in_names
from data.folder.typed_document import read_document
from data.kitti.sensor_files import FrameFiles, ImageSize, no_scans, read_image
from data.layouts import OpenConfig
from data.nearest_time import half_period_s, nearest_in_time
from data.packets.recording import Recording, is_beams_file, is_recording, open_recording
from data.per_frame import FrameTuple
from perception.errors import DriveError, ImageError, UsageError
from perception.geometry.se3 import inverse
from perception.geometry.undistortion import Lens
from perception.sensor import HDL_64E, SENSORS, LidarModel, load_sensor
from perception.types import Calibration, Float64, Int

_MIN_RANGE_M, _MAX_RANGE_M, _RANGE_NOISE_M = (
    0.5,
    120.0,
    0.02,
)  # usual ones, of a sensor that is no known model


def open_folder(path: Path, config: OpenConfig) -> FolderDrive:
    """Open a folder, or a recording of packets; scans are read frame by frame.

    Raises:
        DriveError: There is no scan, or drive.yaml or a file that it names cannot be used.
        PoseError: The poses cannot be used.
    """
    root, recording = path.parent if path.is_file() else path, recording_at(path, config)
    described, notes = _description(root, config.columns, recording)
    files = _scan_files(root, described.lidar) if recording is None else recording.files
    if recording is None:
        sensor = _sensor(root, described.lidar, config.sensor)
    else:
        sensor = _recorded_sensor(root, described.lidar, config.sensor, recording)
    stamps_ns = _stamps_ns(root, described.lidar, files, sensor.rate_hz, recording)
    seen = None if described.lidar.viewpoint else viewpoint_observation(files)
    notes += () if seen is None else (f"{root}: {seen.what} {seen.value}: {seen.reason}",)
    velo_SE3_lidar = described.lidar.velo_SE3_lidar()
    calibration = images = None
    cameras = described.named_cameras
    name = config.camera_among(list(cameras)) if cameras or config.camera else None
    if name is not None:
        camera = cameras[name]
        camera_files = _image_files(root, camera)
        lens = _lens(root, camera, camera_files)
        calibration = _calibration(camera, lens, velo_SE3_lidar, root)
        paths = _join_images(root, camera, camera_files, files, stamps_ns)
        images = ImageFiles(paths, ImageSize(lens.size_px, lens.source), lens)
        notes += _image_notes(camera_files.folder, paths)
    poses, body_SE3_velo = _poses(root, described, len(files), velo_SE3_lidar)
    labels = described.lidar.point_labels
    label_file = _existing(root, described.labels, "labels")
    form = None if label_file is None else require_form(label_file)
    if label_file is not None and form is not None and is_in_view(form, label_file):
        form = None
        if calibration is None:
            notes += (
                f"{label_file}: labels are not used, as they need the calibration of a camera",
            )
        # They are of the main camera.
        label_file = label_file if name is not None and name == next(iter(cameras)) else None
    drive = FolderDrive(
        name=path.resolve().name if recording is None else recording.path.stem,
        root=path,
        sensor=sensor,
        calibration=calibration,
        notes=notes,
        deskew=config.deskew,
        scans=files,
        columns=described.lidar.columns,
        velo_SE3_lidar=velo_SE3_lidar,
        reflectance_scale=config.reflectance_scale or described.lidar.reflectance_scale,
        viewpoint=described.lidar.viewpoint or "ignored",
        stamps_ns=FrameTuple(stamps_ns.tolist()),
        origin_ns=int(stamps_ns[0]),
        rows=FrameTuple(range(len(files))),
        recording=recording,
        images=images if config.images else None,
        poses=poses,
        body_SE3_velo=body_SE3_velo,
        label_file=None if form is not None else label_file,
        point_labels=None
        if labels is None
        else FrameFiles.within(root / labels, (".label",)).joined(files),
    )
    if form is None or label_file is None:
        return labelled_by_instances(drive, LabelledPointsDrive, config.progress)
    parts = {one.name: getattr(drive, one.name) for one in fields(drive) if one.init}
    if form.is_of_image:
        if images is None or images.lens is None:
            expected = "a camera of these images, in a section camera"
            raise DriveError(
                root / FILE_NAME, expected=expected, found=f"labels of {form.name} alone"
            )
        of_images = ImageLabels(label_file, form, described.classes, drive, images, images.lens)
        return LabelledImagesDrive(**parts, image_labels=of_images)
    camera_pose = None if name is None else cameras[name].lidar_to_camera.dst_SE3_src()
    boxes = BoxLabels(label_file, with_camera(form, camera_pose), described.classes, drive)
    return LabelledFolderDrive(**parts, box_labels=boxes)


def recording_at(path: Path, config: OpenConfig) -> Recording | None:
    """Open the recording of packets at a path, or that which the drive.yaml of a folder names; None without one.

    Raises:
        PerceptionError: It cannot be used.
    """
    root = path.parent if path.is_file() else path
    stated = _stated(root, path if path.is_file() else None) or FolderConfig()
    file = path if path.is_file() else root / (stated.lidar.scans or "")
    if not is_recording(file):
        return None
    beams = (_beams_file(root, name) for name in (config.sensor, stated.lidar.sensor) if name)
    address = config.lidar or stated.lidar.address
    return open_recording(file, address, next((one for one in beams if one is not None), None))


def _stated(root: Path, file: Path | None) -> FolderConfig | None:
    """Return what drive.yaml states of a folder, or of a recording in it; None where there is none of it."""
    if not (root / FILE_NAME).is_file():
        return None
    stated = read_document(FolderConfig, root / FILE_NAME)
    return stated if file is None or root / (stated.lidar.scans or "") == file else None


def _beams_file(root: Path, name: str) -> Path | None:
    """Return the metadata or calibration that a name of a sensor stands for; None for a model."""
    return next((one for one in (root / name, Path(name)) if is_beams_file(one)), None)


def _recorded_sensor(
    root: Path, lidar: LidarConfig, asked: str | None, recording: Recording
) -> LidarModel:
    """Return the model that was asked for or is stated, else that of the packets, at its height and rate."""
    names = [None if name and _beams_file(root, name) else name for name in (asked, lidar.sensor)]
    if names[0] or names[1] or lidar.elevations_deg is not None:
        rate_hz = lidar.rate_hz or recording.sensor.rate_hz
        return _sensor(root, replace(lidar, sensor=names[1], rate_hz=rate_hz), names[0])
    model = recording.sensor
    return replace(
        model, height_m=lidar.height_m or model.height_m, rate_hz=lidar.rate_hz or model.rate_hz
    )


def _description(
    root: Path, columns: tuple[str, ...], recording: Recording | None
) -> tuple[FolderConfig, tuple[str, ...]]:
    """Return what drive.yaml states, or what can be seen with a note on each guess.

    Args:
        root: Folder of the drive.
        columns: Names of the columns of the scans; none for those that are stated or seen.
        recording: Recording of packets, or None for files.
    """
    stated = _stated(root, None if recording is None else recording.path)
    if recording is not None and stated is not None:
        return stated, recording.notes
    if stated is not None:
        if columns:
            stated = replace(stated, lidar=replace(stated.lidar, columns=columns))
        if stated.lidar.sensor is not None or stated.lidar.elevations_deg is not None:
            return stated, ()
        seen = observe_folder(root, stated.lidar.columns).config.lidar
        beams = {
            name: getattr(seen, name) for name in ("sensor", "elevations_deg", "azimuth_step_deg")
        }
        return replace(stated, lidar=replace(stated.lidar, **beams)), ()
    observed = (
        observe_folder(root, columns or None) if recording is None else observe_recording(recording)
    )
    place = root if recording is None else recording.path
    notes = [
        *(() if recording is None else recording.notes),
        f"{place}: no {FILE_NAME}, the sensors are as they were seen; trifuse adopt {place} writes it",
    ]
    notes += [
        f"{place}: {one.what} {one.value} is a guess: {one.reason}" for one in observed.guesses
    ]
    if observed.images:
        notes.append(
            f"{root / observed.images[0]}: images are not used, as no {FILE_NAME} has a camera"
        )
    lidar = observed.config.lidar
    # The headers have been read for a VIEWPOINT, which is among the guesses.
    lidar = replace(lidar, viewpoint=lidar.viewpoint or "ignored")
    return replace(observed.config, lidar=lidar), tuple(notes)


def _existing(root: Path, name: str | None, key: str) -> Path | None:
    """Return the path of a file that drive.yaml names.

    Raises:
        DriveError: It does not exist.
    """
    if name is None or (root / name).exists():
        return None if name is None else root / name
    raise DriveError(f"{root / FILE_NAME}: {key}", expected="a file or folder below it", found=name)


def _scan_files(root: Path, lidar: LidarConfig) -> FrameFiles:
    folder = _existing(root, lidar.scans, "scans") or find_scans(root)
    if folder is None or not len(files := cloud_files(folder)):
        raise no_scans(folder or root, "scans in any format")
    return files


def _sensor(root: Path, lidar: LidarConfig, asked: str | None) -> LidarModel:
    """Return the model that was asked for, else that which drive.yaml states, at its height and rate."""
    name = asked or lidar.sensor
    if asked is None and lidar.elevations_deg is not None:
        model = _own_model(lidar)
    elif name is None:
        model = HDL_64E
    else:
        own = root / name
        model = load_sensor(own if asked is None and own.is_file() else name)
        if name not in SENSORS and asked is not None:
            return model  # a file has its own height
    height_m, rate_hz = lidar.height_m or model.height_m, lidar.rate_hz or model.rate_hz
    return replace(model, height_m=height_m, rate_hz=rate_hz)


def _own_model(lidar: LidarConfig) -> LidarModel:
    try:
        return LidarModel(
            name=lidar.sensor or "LiDAR",
            elevations_rad=np.radians(lidar.elevations_deg or ()),
            azimuth_step_rad=float(np.radians(lidar.azimuth_step_deg)),
            rate_hz=lidar.rate_hz or HDL_64E.rate_hz,
            height_m=lidar.height_m or HDL_64E.height_m,
            min_range_m=_MIN_RANGE_M,
            max_range_m=_MAX_RANGE_M,
            range_noise_m=_RANGE_NOISE_M,
        )
    except UsageError as error:
        raise DriveError(
            f"{FILE_NAME}: elevations_deg", expected=error.expected, found=error.found
        ) from error


def _stamps_ns(
    root: Path, lidar: LidarConfig, files: FrameFiles, rate_hz: float, recording: Recording | None
) -> Int:
    path = _existing(root, lidar.timestamps, "timestamps")
    if path is not None:
        stamps: Int | None = read_stamps(path, len(files))
    else:
        stamps = stamps_in_names(files.paths) if recording is None else recording.stamps_ns
    if stamps is None:
        numbers = np.array(files.numbers) - files.numbers[0]
        stamps = np.round(numbers * (1e9 / rate_hz)).astype(np.int64)
    return np.asarray(stamps + round(lidar.time_offset_s * 1e9), np.int64)


def _image_files(root: Path, camera: CameraConfig) -> FrameFiles:
    folder = _existing(root, camera.images, "images")
    files = image_files(folder or root)
    if not len(files):
        raise DriveError(files.folder, expected="images", found="none")
    return files


def _lens(root: Path, camera: CameraConfig, images: FrameFiles) -> Lens:
    size = camera.size_px or _first_size(images)
    is_distorted = any(camera.distortion)
    return Lens(
        camera.camera_matrix,
        np.array(camera.distortion, np.float64),
        (size[0], size[1]),
        "equidistant" if camera.model == "fisheye" and is_distorted else "rational_polynomial",
        source=str(root / FILE_NAME),
    )


def _first_size(images: FrameFiles) -> tuple[int, int]:
    failure: ImageError | None = None
    for path in images.paths:
        try:
            height, width = read_image(path).shape[:2]
        except ImageError as error:
            failure = failure or error
        else:
            return width, height
    raise failure or ImageError(images.folder, expected="an image", found="none")


def _calibration(
    camera: CameraConfig, lens: Lens, velo_SE3_lidar: Float64, root: Path
) -> Calibration:
    return Calibration(
        image_P_cam=np.column_stack([lens.pinhole_matrix, np.zeros(3)]),
        cam_SE3_velo=camera.lidar_to_camera.dst_SE3_src() @ inverse(velo_SE3_lidar),
        image_size_px=lens.size_px,
        source=str(root / FILE_NAME),
    )


def _join_images(
    root: Path, camera: CameraConfig, images: FrameFiles, scans: FrameFiles, stamps_ns: Int
) -> tuple[Path | None, ...]:
    """Return the image of each scan: the nearest in time where both have times, else that of its name or place."""
    path = _existing(root, camera.timestamps, "timestamps")
    stamps = stamps_in_names(images.paths) if path is None else read_stamps(path, len(images))
    if stamps is None:
        joined = images.joined(scans)
        if joined is None:
            raise DriveError(
                images.folder,
                expected=f"images named as the scans are, such as {scans.paths[0].stem}, or as many of them",
                found=f"{len(images)} images such as {images.paths[0].name}, {len(scans)} scans",
                advice="state the times of both, with timestamps in the sections lidar and camera",
            )
        return joined.paths
    origin = int(stamps_ns[0])
    scans_s = (stamps_ns - origin) / 1e9
    images_s = (stamps - origin) / 1e9 + camera.time_offset_s
    gap_s = max(half_period_s(scans_s), half_period_s(images_s))
    nearest = nearest_in_time(scans_s, images_s, gap_s if np.isfinite(gap_s) else None)
    return tuple(None if place < 0 else images.paths[place] for place in nearest)


def _image_notes(folder: Path, paths: tuple[Path | None, ...]) -> tuple[str, ...]:
    missing = paths.count(None)
    if not missing:
        return ()
    advice = "correct the time_offset_s of the camera if this is not so"
    return (f"{folder}: {missing} of {len(paths)} scans have no image near in time; {advice}",)


def _poses(
    root: Path, config: FolderConfig, scans: int, velo_SE3_lidar: Float64
) -> tuple[PoseTrack | None, Float64 | None]:
    if config.poses is None:
        return None, None
    path = _existing(root, config.poses.file, "file") or root
    extrinsics = config.poses.body_to_lidar
    body_SE3_lidar = None if extrinsics is None else inverse(extrinsics.dst_SE3_src())
    track = read_pose_track(path, config.poses.format, scans)
    return track, velo_to_body(body_SE3_lidar, velo_SE3_lidar)
