"""What the tables of nuScenes say of one scene: its scans, images, poses and boxes."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from scipy.spatial.transform import Rotation

from data.nuscenes.json_tables import Record, read_records
from perception.errors import DriveError, PerceptionError, UsageError
from perception.geometry.se3 import from_rotation_translation
from perception.types import Float64

LIDAR, DEFAULT_CAMERA = "LIDAR_TOP", "CAM_FRONT"
_DATA_FIELDS = (
    "token", "sample_token", "ego_pose_token", "calibrated_sensor_token", "timestamp",
    "is_key_frame", "filename",
)  # fmt: skip
_BOX_FIELDS = (
    "sample_token",
    "instance_token",
    "attribute_tokens",
    "translation",
    "size",
    "rotation",
)


@dataclass(frozen=True)
class SensorData:
    """One scan or image.

    Attributes:
        token: Name of the record.
        sample: Name of the sample that it belongs to, or that follows.
        stamp_us: Time in microseconds.
        is_key_frame: Whether it is the scan or image of its sample.
        path: File.
        world_SE3_ego: (4, 4) pose of the vehicle at that time.
        size_px: (width, height) of an image, where the table states it.
    """

    token: str
    sample: str
    stamp_us: int
    is_key_frame: bool
    path: Path
    world_SE3_ego: Float64
    size_px: tuple[int, int] | None


@dataclass(frozen=True)
class SensorPlace:
    """Calibration of one sensor.

    Attributes:
        ego_SE3_sensor: (4, 4) place on the vehicle.
        camera_matrix: (3, 3) intrinsic matrix, or None of a LiDAR.
    """

    ego_SE3_sensor: Float64
    camera_matrix: Float64 | None


@dataclass(frozen=True)
class Annotation:
    """One box at the time of a sample.

    Attributes:
        instance: Name of the object.
        category: Category of the object.
        attributes: Attributes at that time.
        centre_m: (3,) centre in the world of the tables.
        size_m: (3,) length, width, height.
        world_R_box: Rotation of the box, whose x is its heading.
        points: Number of points of LiDAR and radar in the box; None where the table does not state it.
    """

    instance: str
    category: str
    attributes: tuple[str, ...]
    centre_m: Float64
    size_m: Float64
    world_R_box: Rotation
    points: int | None = None


@dataclass(frozen=True)
class SceneTables:
    """One scene.

    Attributes:
        folder: Folder of the tables.
        stamps_us: Time of each sample in microseconds, in order.
        data: Scans and images by channel, each in order of time.
        places: Calibration by channel.
        annotations: Boxes by sample.
        point_labels: File of point labels by the name of the scan.
        point_categories: Category of each number in these files.
    """

    folder: Path
    stamps_us: Mapping[str, int]
    data: Mapping[str, Sequence[SensorData]]
    places: Mapping[str, SensorPlace]
    annotations: Mapping[str, Sequence[Annotation]]
    point_labels: Mapping[str, Path]
    point_categories: Mapping[int, str]

    @classmethod
    def read(cls, folder: Path, scene: str, camera: str) -> Self:
        """Read what the tables of a folder say of a scene.

        Args:
            folder: Folder of the tables, such as v1.0-mini, beside samples and sweeps.
            scene: Name of the scene.
            camera: Channel of the camera.

        Raises:
            DriveError: A table is missing or damaged, or has no such scene.
            UsageError: There is no such camera among others.
        """
        tables = _Tables(folder)
        samples = tables.samples(scene)
        channels = tables.channels()
        cameras = sorted({name for name in channels.values() if name.startswith("CAM")})
        if cameras and camera not in cameras:  # a cut to the LiDAR has none
            raise UsageError(
                f"--camera {camera}", expected=f"one of {', '.join(cameras)}", found=camera
            )
        required = {token: name for token, name in channels.items() if name in (LIDAR, camera)}
        records = tables.sensor_data(samples, required)
        by_channel: dict[str, list[SensorData]] = {LIDAR: [], camera: []}
        poses = tables.poses({record["ego_pose_token"] for record in records})
        for record in records:
            one = tables.parse_data(record, poses)
            by_channel[required[record["calibrated_sensor_token"]]].append(one)
        used = {record["calibrated_sensor_token"] for record in records}
        return cls(
            folder=folder,
            stamps_us=samples,
            data={
                name: sorted(ones, key=lambda one: one.stamp_us)
                for name, ones in by_channel.items()
            },
            places={required[token]: place for token, place in tables.places(used).items()},
            annotations=tables.annotations(samples),
            point_labels=tables.point_labels({one.token for one in by_channel[LIDAR]}),
            point_categories=tables.point_categories(),
        )

    def image_size_px(self, camera: str) -> tuple[int, int] | None:
        """Return (width, height) of the images of a camera, where the tables state it."""
        return next((one.size_px for one in self.data[camera] if one.size_px), None)


def _image_size_px(record: Record) -> tuple[int, int] | None:
    width, height = record.get("width"), record.get("height")
    return (int(width), int(height)) if width and height else None


def _point_count(record: Record) -> int | None:
    counts = [record.get(f"num_{sensor}_pts") for sensor in ("lidar", "radar")]
    known = [one for one in counts if isinstance(one, int)]
    return sum(known) if known else None


@dataclass(frozen=True)
class _Tables:
    """Tables of a folder, each read where it is asked for."""

    folder: Path

    def read(self, name: str, fields: Sequence[str], is_required: Any = None) -> list[Record]:  # noqa: ANN401 - a condition or None
        return read_records(self.folder / f"{name}.json", fields, is_required)

    def has(self, name: str) -> bool:
        return (self.folder / f"{name}.json").is_file()

    def samples(self, scene: str) -> dict[str, int]:
        """Return the times of the samples of a scene."""
        scenes = {one["name"]: one["token"] for one in self.read("scene", ("name", "token"))}
        if scene not in scenes:
            raise DriveError(
                self.folder / "scene.json", expected=f"scene {scene}", found=", ".join(scenes)
            )
        token = scenes[scene]
        records = self.read(
            "sample", ("token", "scene_token", "timestamp"), lambda one: one["scene_token"] == token
        )
        stamps = {one["token"]: int(one["timestamp"]) for one in records}
        return dict(sorted(stamps.items(), key=lambda item: item[1]))

    def channels(self) -> dict[str, str]:
        """Return the channel of each calibrated sensor."""
        sensors = {
            one["token"]: one["channel"] for one in self.read("sensor", ("token", "channel"))
        }
        records = self.read("calibrated_sensor", ("token", "sensor_token"))
        return {one["token"]: sensors.get(one["sensor_token"], "") for one in records}

    def sensor_data(self, samples: Mapping[str, int], required: Mapping[str, str]) -> list[Record]:
        return self.read(
            "sample_data",
            _DATA_FIELDS,
            lambda one: (
                one["sample_token"] in samples and one["calibrated_sensor_token"] in required
            ),
        )

    def poses(self, tokens: Iterable[str]) -> dict[str, Float64]:
        """Return the (4, 4) poses of the vehicle."""
        known = {*tokens}
        records = self.read(
            "ego_pose", ("token", "translation", "rotation"), lambda one: one["token"] in known
        )
        return {one["token"]: self.transform("ego_pose", one) for one in records}

    def parse_data(self, record: Record, poses: Mapping[str, Float64]) -> SensorData:
        pose = poses.get(record["ego_pose_token"])
        if pose is None:
            raise DriveError(
                self.folder / "ego_pose.json",
                expected=f"the pose {record['ego_pose_token']} of {record['filename']}",
                found="none",
            )
        return SensorData(
            token=record["token"],
            sample=record["sample_token"],
            stamp_us=int(record["timestamp"]),
            is_key_frame=bool(record["is_key_frame"]),
            path=self.folder.parent / record["filename"],
            world_SE3_ego=pose,
            size_px=_image_size_px(record),
        )

    def places(self, tokens: Iterable[str]) -> dict[str, SensorPlace]:
        """Return the calibration of some sensors."""
        known = {*tokens}
        fields = ("token", "translation", "rotation", "camera_intrinsic")
        records = self.read("calibrated_sensor", fields, lambda one: one["token"] in known)
        return {one["token"]: self._place(one) for one in records}

    def _place(self, record: Record) -> SensorPlace:
        matrix = None
        if record["camera_intrinsic"]:
            matrix = self.numbers("calibrated_sensor", record, "camera_intrinsic", 9).reshape(3, 3)
        return SensorPlace(self.transform("calibrated_sensor", record), matrix)

    def annotations(self, samples: Mapping[str, int]) -> dict[str, list[Annotation]]:
        """Return the boxes of some samples; none where there is no table of them."""
        found: dict[str, list[Annotation]] = {}
        if not self.has("sample_annotation"):
            return found
        records = self.read(
            "sample_annotation", _BOX_FIELDS, lambda one: one["sample_token"] in samples
        )
        instances = {one["instance_token"] for one in records}
        rows = self.read(
            "instance", ("token", "category_token"), lambda one: one["token"] in instances
        )
        names = {one["token"]: one["name"] for one in self.read("category", ("token", "name"))}
        category_of = {one["token"]: names.get(one["category_token"], "") for one in rows}
        rows = self.read("attribute", ("token", "name")) if self.has("attribute") else []
        attributes = {one["token"]: one["name"] for one in rows}
        for one in records:
            pose = self.transform("sample_annotation", one)
            width_m, length_m, height_m = self.numbers("sample_annotation", one, "size", 3)
            box = Annotation(
                instance=one["instance_token"],
                category=category_of.get(one["instance_token"], ""),
                attributes=tuple(attributes.get(token, "") for token in one["attribute_tokens"]),
                centre_m=pose[:3, 3],
                size_m=np.array([length_m, width_m, height_m]),
                world_R_box=Rotation.from_matrix(pose[:3, :3]),
                points=_point_count(one),
            )
            found.setdefault(one["sample_token"], []).append(box)
        return found

    def point_labels(self, scans: set[str]) -> dict[str, Path]:
        """Return the files of point labels; none where there is no table of them."""
        if not self.has("lidarseg"):
            return {}
        fields = ("sample_data_token", "filename")
        records = self.read("lidarseg", fields, lambda one: one["sample_data_token"] in scans)
        return {one["sample_data_token"]: self.folder.parent / one["filename"] for one in records}

    def point_categories(self) -> dict[int, str]:
        """Return the category of each number that the table states."""
        records = self.read("category", ("token", "name"))
        return {int(one["index"]): one["name"] for one in records if "index" in one}

    def transform(self, table: str, record: Record) -> Float64:
        """Return a (4, 4) transform."""
        w, x, y, z = self.numbers(table, record, "rotation", 4)
        if np.linalg.norm((w, x, y, z)) < 0.5:
            raise self.error(
                table, record, "a rotation as a unit quaternion", str(record["rotation"])
            )
        rotation = Rotation.from_quat((x, y, z, w)).as_matrix()
        return from_rotation_translation(rotation, self.numbers(table, record, "translation", 3))

    def numbers(self, table: str, record: Record, field: str, count: int) -> Float64:
        """Return the numbers of a field."""
        try:
            numbers = np.array(record[field], np.float64).reshape(-1)
        except (ValueError, TypeError, OverflowError):
            numbers = np.zeros(0)
        if len(numbers) != count or not np.isfinite(numbers).all():
            raise self.error(
                table, record, f"{count} finite numbers as {field}", str(record[field])
            )
        return numbers

    def error(self, table: str, record: Record, expected: str, found: str) -> PerceptionError:
        """Return the error of a record."""
        where = f"{self.folder / table}.json {record.get('token', '')}".rstrip()
        return DriveError(where, expected=expected, found=found)
