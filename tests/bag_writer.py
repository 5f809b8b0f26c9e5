"""Bags that tests write: any of the formats, from plain arrays."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import cv2
import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

from data.recorded_drive import RecordedDrive
from perception.geometry.se3 import inverse

KINDS = {"mcap": "drive.mcap", "db3": "drive.db3", "ros1": "drive.bag"}
FIRST_NS = 1_700_000_000_000_000_000
_DATATYPES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}


class BagWriter:
    """Writes messages with stamps into a bag."""

    def __init__(self, folder: Path, kind: str = "mcap") -> None:
        self.is_ros1 = kind == "ros1"
        self._store = get_typestore(Stores.ROS1_NOETIC if self.is_ros1 else Stores.ROS2_HUMBLE)
        if self.is_ros1:
            tf = "tf2_msgs/msg/TFMessage"  # not among the messages that rosbags knows of ROS 1
            self._store.register(
                get_types_from_msg("geometry_msgs/TransformStamped[] transforms", tf)
            )
            folder.mkdir(parents=True, exist_ok=True)
            self.path = folder / "drive.bag"
            self._writer: Any = rosbag1.Writer(self.path)
        else:
            folder.parent.mkdir(parents=True, exist_ok=True)
            self.path = folder
            plugins = rosbag2.StoragePlugin
            plugin = plugins.MCAP if kind == "mcap" else plugins.SQLITE3
            self._writer = rosbag2.Writer(folder, version=9, storage_plugin=plugin)
        self._connections: dict[str, Any] = {}

    def __enter__(self) -> Self:
        self._writer.open()
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.close()

    def make(self, kind: str, **fields: Any) -> Any:
        """Return a message of a type such as sensor_msgs/Image; fields that are not given are empty."""
        package, name = kind.split("/")
        return self._store.types[f"{package}/msg/{name}"](**fields)

    def header(self, stamp_ns: int, frame: str) -> Any:
        stamp = self.make(
            "builtin_interfaces/Time", sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9
        )
        number = {"seq": 0} if self.is_ros1 else {}
        return self.make("std_msgs/Header", **number, stamp=stamp, frame_id=frame)

    def write(self, topic: str, message: Any, received_ns: int) -> None:
        kind = message.__msgtype__
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(
                topic, kind, typestore=self._store
            )
        encode = self._store.serialize_ros1 if self.is_ros1 else self._store.serialize_cdr
        self._writer.write(self._connections[topic], received_ns, encode(message, kind))

    def cloud(
        self, topic: str, stamp_ns: int, columns: Mapping[str, np.ndarray], **layout: Any
    ) -> None:
        self.write(topic, self.cloud_message(stamp_ns, columns, **layout), stamp_ns + 1_000_000)

    def cloud_message(
        self,
        stamp_ns: int,
        columns: Mapping[str, np.ndarray],
        *,
        frame: str = "velodyne",
        padding: int = 0,
        rows: int = 1,
        row_padding: int = 0,
        big_endian: bool = False,
    ) -> Any:
        """Return a PointCloud2 of named columns, with gaps between points and rows."""
        order = ">" if big_endian else "<"
        kinds = {name: np.asarray(values).dtype.str[1:] for name, values in columns.items()}
        offsets, step = {}, 0
        for name, kind in kinds.items():
            offsets[name] = step
            step += int(kind[1:]) + padding
        count = len(next(iter(columns.values())))
        record = np.dtype(
            {
                "names": list(kinds),
                "formats": [order + kind for kind in kinds.values()],
                "offsets": list(offsets.values()),
                "itemsize": step,
            }
        )
        points = np.zeros(count, record)
        for name, values in columns.items():
            points[name] = values
        width = count // rows
        data = np.frombuffer(points.tobytes(), np.uint8).reshape(rows, width * step)
        data = np.pad(data, ((0, 0), (0, row_padding)), constant_values=255)
        fields = [
            self.make(
                "sensor_msgs/PointField",
                name=name,
                offset=offsets[name],
                datatype=_DATATYPES[kind],
                count=1,
            )
            for name, kind in kinds.items()
        ]
        return self.make(
            "sensor_msgs/PointCloud2",
            header=self.header(stamp_ns, frame),
            height=rows,
            width=width,
            fields=fields,
            is_bigendian=big_endian,
            point_step=step,
            row_step=width * step + row_padding,
            data=data.ravel(),
            is_dense=False,
        )

    def image(self, topic: str, stamp_ns: int, image: np.ndarray, frame: str = "camera") -> None:
        """Write an (H, W, 3) RGB image."""
        height, width = image.shape[:2]
        message = self.make(
            "sensor_msgs/Image",
            header=self.header(stamp_ns, frame),
            height=height,
            width=width,
            encoding="rgb8",
            is_bigendian=0,
            step=3 * width,
            data=image.ravel(),
        )
        self.write(topic, message, stamp_ns + 2_000_000)

    def png(self, topic: str, stamp_ns: int, image: np.ndarray, frame: str = "camera") -> None:
        """Write an (H, W, 3) RGB image as a CompressedImage."""
        data = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))[1].ravel()
        message = self.make(
            "sensor_msgs/CompressedImage",
            header=self.header(stamp_ns, frame),
            format="png",
            data=data,
        )
        self.write(topic, message, stamp_ns + 2_000_000)

    def camera_info(
        self,
        topic: str,
        stamp_ns: int,
        matrix: np.ndarray,
        size_px: tuple[int, int],
        *,
        coefficients: Sequence[float] = (0, 0, 0, 0, 0),
        model: str = "plumb_bob",
        frame: str = "camera",
    ) -> None:
        names = "DKRP" if self.is_ros1 else "dkrp"
        arrays = (
            np.asarray(coefficients, float),
            matrix.ravel(),
            np.eye(3).ravel(),
            np.column_stack([matrix, np.zeros(3)]).ravel(),
        )
        region = self.make(
            "sensor_msgs/RegionOfInterest",
            x_offset=0, y_offset=0, height=0, width=0, do_rectify=False,
        )  # fmt: skip
        message = self.make(
            "sensor_msgs/CameraInfo",
            header=self.header(stamp_ns, frame),
            height=size_px[1],
            width=size_px[0],
            distortion_model=model,
            binning_x=0,
            binning_y=0,
            roi=region,
            **dict(zip(names, arrays, strict=True)),
        )
        self.write(topic, message, stamp_ns)

    def transforms(
        self,
        stamp_ns: int,
        edges: Mapping[tuple[str, str], np.ndarray],
        topic: str = "/tf_static",
    ) -> None:
        """Write (4, 4) parent_SE3_child by (parent, child)."""
        message = self.make(
            "tf2_msgs/TFMessage",
            transforms=[
                self.make(
                    "geometry_msgs/TransformStamped",
                    header=self.header(stamp_ns, parent),
                    child_frame_id=child,
                    transform=self.make(
                        "geometry_msgs/Transform",
                        translation=self._vector(pose[:3, 3]),
                        rotation=self.quaternion(pose),
                    ),
                )
                for (parent, child), pose in edges.items()
            ],
        )
        self.write(topic, message, stamp_ns)

    def odometry(
        self, topic: str, stamp_ns: int, pose: np.ndarray, frame: str = "base_link"
    ) -> None:
        place = self.make("geometry_msgs/Point", **dict(zip("xyz", pose[:3, 3], strict=True)))
        zero = self._vector(np.zeros(3))
        message = self.make(
            "nav_msgs/Odometry",
            header=self.header(stamp_ns, "odom"),
            child_frame_id=frame,
            pose=self.make(
                "geometry_msgs/PoseWithCovariance",
                pose=self.make(
                    "geometry_msgs/Pose", position=place, orientation=self.quaternion(pose)
                ),
                covariance=np.zeros(36),
            ),
            twist=self.make(
                "geometry_msgs/TwistWithCovariance",
                twist=self.make("geometry_msgs/Twist", linear=zero, angular=zero),
                covariance=np.zeros(36),
            ),
        )
        self.write(topic, message, stamp_ns)

    def fix(
        self, topic: str, stamp_ns: int, place: tuple[float, float, float],
        deviation_m: float = 0.02, frame: str = "imu",
    ) -> None:  # fmt: skip
        message = self.make(
            "sensor_msgs/NavSatFix",
            header=self.header(stamp_ns, frame),
            status=self.make("sensor_msgs/NavSatStatus", status=0, service=1),
            latitude=place[0],
            longitude=place[1],
            altitude=place[2],
            position_covariance=(np.eye(3) * deviation_m**2).ravel(),
            position_covariance_type=2,
        )
        self.write(topic, message, stamp_ns)

    def imu(
        self, topic: str, stamp_ns: int, rotation: np.ndarray, *, is_oriented: bool = True,
        frame: str = "imu",
    ) -> None:  # fmt: skip
        zero, pose = self._vector(np.zeros(3)), np.eye(4)
        pose[:3, :3] = rotation
        covariance = np.zeros(9)
        covariance[0] = 0.0 if is_oriented else -1.0
        message = self.make(
            "sensor_msgs/Imu",
            header=self.header(stamp_ns, frame),
            orientation=self.quaternion(pose),
            orientation_covariance=covariance,
            angular_velocity=zero,
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=zero,
            linear_acceleration_covariance=np.zeros(9),
        )
        self.write(topic, message, stamp_ns)

    def quaternion(self, pose: np.ndarray) -> Any:
        numbers = Rotation.from_matrix(pose[:3, :3]).as_quat()
        return self.make("geometry_msgs/Quaternion", **dict(zip("xyzw", numbers, strict=True)))

    def _vector(self, numbers: np.ndarray) -> Any:
        return self.make("geometry_msgs/Vector3", **dict(zip("xyz", numbers, strict=True)))


def columns_of(points: np.ndarray) -> dict[str, np.ndarray]:
    """Return the columns of (N, 4) points as most drivers name them."""
    return dict(zip(("x", "y", "z", "intensity"), points.T, strict=True))


def write_bag(drive: RecordedDrive, folder: Path, kind: str = "mcap") -> Path:
    """Write scans, images, calibration and poses of a drive as a robot would record them; return the bag."""
    calibration = drive.calibration
    with BagWriter(folder, kind) as bag:
        edges = {("base_link", "velodyne"): np.eye(4)}
        if calibration is not None:
            matrix = calibration.image_P_cam[:, :3]
            # The second camera of KITTI stands beside the reference camera.
            camera_SE3_reference = np.eye(4)
            camera_SE3_reference[:3, 3] = np.linalg.solve(matrix, calibration.image_P_cam[:, 3])
            camera_SE3_velo = camera_SE3_reference @ calibration.cam_SE3_velo
            edges["velodyne", "camera"] = inverse(camera_SE3_velo)
        bag.transforms(FIRST_NS, edges)
        for index in range(len(drive)):
            frame = drive[index]
            stamp_ns = FIRST_NS + round(frame.stamp_s * 1e9)
            if frame.world_SE3_velo is not None:
                bag.odometry("/odometry", stamp_ns, frame.world_SE3_velo)
            bag.cloud("/velodyne_points", stamp_ns, columns_of(frame.points_velo))
            if frame.image is not None and calibration is not None:
                bag.image("/camera/image_raw", stamp_ns + 3_000_000, frame.image)
                size_px = frame.image.shape[1], frame.image.shape[0]
                bag.camera_info("/camera/camera_info", stamp_ns, matrix, size_px)
    return bag.path
