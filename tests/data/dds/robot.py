"""A robot that knows neither this program nor ROS: drivers and a listener, by cyclonedds and its own message definitions.

    python robot.py DRIVE.npz TOPIC KIND ...

publishes the scans of a file as lines of its input ask for it, and prints what comes on the topics, encoded again, as
lines of JSON. Without a file (`-`), it prints what comes. It ends with its input.

The file has the parts of each frame, and what is odd about them: `tf_from`, `infos_from` and `poses_from` are the frames
before which transforms, calibrations and poses are not sent; `offsets_ns` are added to the stamps of the frames, and
`camera_offset_ns` to those of all images; `best_effort_from` is the frame before which the driver of the scans starts
again, which was reliable until then; with `follows`, the first one is 0.1 s after what was sent before. `image_rows` are the rows that are sent of each image. `left` has the images
of a second camera, which sends them compressed.
"""

import base64
import json
import os
import queue
import sys
import threading
import time
from dataclasses import dataclass, field

import numpy as np
from cyclonedds.core import Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import array, byte, float32, float64, int8, int32, sequence, uint8, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

CONFIG = """<CycloneDDS><Domain Id="any"><General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>
<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>
<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex><Peers><Peer address="localhost"/></Peers></Discovery>
</Domain></CycloneDDS>"""


@final
@dataclass
class Time(IdlStruct, typename="builtin_interfaces.msg.dds_.Time_"):
    sec: int32 = 0
    nanosec: uint32 = 0


@final
@dataclass
class Duration(IdlStruct, typename="builtin_interfaces.msg.dds_.Duration_"):
    sec: int32 = 0
    nanosec: uint32 = 0


@final
@dataclass
class Header(IdlStruct, typename="std_msgs.msg.dds_.Header_"):
    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


@final
@dataclass
class ColorRGBA(IdlStruct, typename="std_msgs.msg.dds_.ColorRGBA_"):
    r: float32
    g: float32
    b: float32
    a: float32


@final
@dataclass
class Point(IdlStruct, typename="geometry_msgs.msg.dds_.Point_"):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@final
@dataclass
class Vector3(IdlStruct, typename="geometry_msgs.msg.dds_.Vector3_"):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@final
@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs.msg.dds_.Quaternion_"):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 1.0


@final
@dataclass
class Pose(IdlStruct, typename="geometry_msgs.msg.dds_.Pose_"):
    position: Point = field(default_factory=Point)
    orientation: Quaternion = field(default_factory=Quaternion)


@final
@dataclass
class PoseWithCovariance(IdlStruct, typename="geometry_msgs.msg.dds_.PoseWithCovariance_"):
    pose: Pose = field(default_factory=Pose)
    covariance: array[float64, 36] = field(default_factory=lambda: [0.0] * 36)


@final
@dataclass
class Twist(IdlStruct, typename="geometry_msgs.msg.dds_.Twist_"):
    linear: Vector3 = field(default_factory=Vector3)
    angular: Vector3 = field(default_factory=Vector3)


@final
@dataclass
class TwistWithCovariance(IdlStruct, typename="geometry_msgs.msg.dds_.TwistWithCovariance_"):
    twist: Twist = field(default_factory=Twist)
    covariance: array[float64, 36] = field(default_factory=lambda: [0.0] * 36)


@final
@dataclass
class Transform(IdlStruct, typename="geometry_msgs.msg.dds_.Transform_"):
    translation: Vector3 = field(default_factory=Vector3)
    rotation: Quaternion = field(default_factory=Quaternion)


@final
@dataclass
class TransformStamped(IdlStruct, typename="geometry_msgs.msg.dds_.TransformStamped_"):
    header: Header
    child_frame_id: str
    transform: Transform


@final
@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs.msg.dds_.TFMessage_"):
    transforms: sequence[TransformStamped]


@final
@dataclass
class Odometry(IdlStruct, typename="nav_msgs.msg.dds_.Odometry_"):
    header: Header
    child_frame_id: str
    pose: PoseWithCovariance = field(default_factory=PoseWithCovariance)
    twist: TwistWithCovariance = field(default_factory=TwistWithCovariance)


@final
@dataclass
class MapMetaData(IdlStruct, typename="nav_msgs.msg.dds_.MapMetaData_"):
    map_load_time: Time
    resolution: float32
    width: uint32
    height: uint32
    origin: Pose


@final
@dataclass
class OccupancyGrid(IdlStruct, typename="nav_msgs.msg.dds_.OccupancyGrid_"):
    header: Header
    info: MapMetaData
    data: sequence[int8]


@final
@dataclass
class PointField(IdlStruct, typename="sensor_msgs.msg.dds_.PointField_"):
    name: str
    offset: uint32
    datatype: uint8
    count: uint32


@final
@dataclass
class PointCloud2(IdlStruct, typename="sensor_msgs.msg.dds_.PointCloud2_"):
    header: Header
    height: uint32
    width: uint32
    fields: sequence[PointField]
    is_bigendian: bool
    point_step: uint32
    row_step: uint32
    data: sequence[uint8]
    is_dense: bool


@final
@dataclass
class RegionOfInterest(IdlStruct, typename="sensor_msgs.msg.dds_.RegionOfInterest_"):
    x_offset: uint32 = 0
    y_offset: uint32 = 0
    height: uint32 = 0
    width: uint32 = 0
    do_rectify: bool = False


@final
@dataclass
class CameraInfo(IdlStruct, typename="sensor_msgs.msg.dds_.CameraInfo_"):
    header: Header
    height: uint32
    width: uint32
    distortion_model: str
    d: sequence[float64]
    k: array[float64, 9]
    r: array[float64, 9]
    p: array[float64, 12]
    binning_x: uint32 = 0
    binning_y: uint32 = 0
    roi: RegionOfInterest = field(default_factory=RegionOfInterest)


@final
@dataclass
class Image(IdlStruct, typename="sensor_msgs.msg.dds_.Image_"):
    header: Header
    height: uint32
    width: uint32
    encoding: str
    is_bigendian: uint8
    step: uint32
    data: sequence[uint8]


@final
@dataclass
class CompressedImage(IdlStruct, typename="sensor_msgs.msg.dds_.CompressedImage_"):
    header: Header
    format: str
    data: sequence[uint8]


@final
@dataclass
class KeyValue(IdlStruct, typename="diagnostic_msgs.msg.dds_.KeyValue_"):
    key: str
    value: str


@final
@dataclass
class DiagnosticStatus(IdlStruct, typename="diagnostic_msgs.msg.dds_.DiagnosticStatus_"):
    level: byte
    name: str
    message: str
    hardware_id: str
    values: sequence[KeyValue]


@final
@dataclass
class DiagnosticArray(IdlStruct, typename="diagnostic_msgs.msg.dds_.DiagnosticArray_"):
    header: Header
    status: sequence[DiagnosticStatus]


@final
@dataclass
class ObjectHypothesis(IdlStruct, typename="vision_msgs.msg.dds_.ObjectHypothesis_"):
    class_id: str
    score: float64


@final
@dataclass
class ObjectHypothesisWithPose(
    IdlStruct, typename="vision_msgs.msg.dds_.ObjectHypothesisWithPose_"
):
    hypothesis: ObjectHypothesis
    pose: PoseWithCovariance


@final
@dataclass
class BoundingBox3D(IdlStruct, typename="vision_msgs.msg.dds_.BoundingBox3D_"):
    center: Pose
    size: Vector3


@final
@dataclass
class Detection3D(IdlStruct, typename="vision_msgs.msg.dds_.Detection3D_"):
    header: Header
    results: sequence[ObjectHypothesisWithPose]
    bbox: BoundingBox3D
    id: str


@final
@dataclass
class Detection3DArray(IdlStruct, typename="vision_msgs.msg.dds_.Detection3DArray_"):
    header: Header
    detections: sequence[Detection3D]


@final
@dataclass
class UVCoordinate(IdlStruct, typename="visualization_msgs.msg.dds_.UVCoordinate_"):
    u: float32
    v: float32


@final
@dataclass
class MeshFile(IdlStruct, typename="visualization_msgs.msg.dds_.MeshFile_"):
    filename: str
    data: sequence[uint8]


@final
@dataclass
class Marker(IdlStruct, typename="visualization_msgs.msg.dds_.Marker_"):
    header: Header
    ns: str
    id: int32
    type: int32
    action: int32
    pose: Pose
    scale: Vector3
    color: ColorRGBA
    lifetime: Duration
    frame_locked: bool
    points: sequence[Point]
    colors: sequence[ColorRGBA]
    texture_resource: str
    texture: CompressedImage
    uv_coordinates: sequence[UVCoordinate]
    text: str
    mesh_resource: str
    mesh_file: MeshFile
    mesh_use_embedded_materials: bool


@final
@dataclass
class MarkerArray(IdlStruct, typename="visualization_msgs.msg.dds_.MarkerArray_"):
    markers: sequence[Marker]


KINDS = {
    one.__name__: one
    for one in (
        CameraInfo, Image, Odometry, OccupancyGrid, PointCloud2, TFMessage, DiagnosticArray, Detection3DArray,
        MarkerArray,
    )
}  # fmt: skip

BEST_EFFORT = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(10))
RELIABLE = Qos(Policy.Reliability.Reliable(10**9), Policy.History.KeepLast(10))
LATCHED = Qos(
    Policy.Reliability.Reliable(10**9),
    Policy.Durability.TransientLocal,
    Policy.History.KeepLast(10),
)


def stamp_of(stamp_ns: int) -> Time:
    return Time(*divmod(int(stamp_ns), 10**9))


def rotation_of(pose: np.ndarray) -> Quaternion:
    """Return the quaternion of a rotation about z."""
    half_rad = np.arctan2(pose[1, 0], pose[0, 0]) / 2
    return Quaternion(z=float(np.sin(half_rad)), w=float(np.cos(half_rad)))


def quality_of(topic: str) -> Qos:
    """Return what a listener of ROS 2 asks for: reliable results, and what sensors send as it comes."""
    if topic == "/tf_static" or "occupancy" in topic:
        return LATCHED
    own = topic.startswith("/trifuse/") or topic in ("/tf", "/diagnostics")
    return RELIABLE if own else BEST_EFFORT


class Robot:
    """Drivers of the sensors, and a listener."""

    def __init__(self, domain: int, topics: dict[str, str]) -> None:
        self._domain = Domain(domain, CONFIG)
        self.participant = DomainParticipant(domain)
        self.readers = {
            name: self.reader(name, KINDS[kind], quality_of(name)) for name, kind in topics.items()
        }

    def reader(self, name: str, kind: type, qos: Qos) -> DataReader:
        return DataReader(self.participant, Topic(self.participant, f"rt{name}", kind), qos=qos)

    def writer(self, name: str, kind: type, qos: Qos) -> DataWriter:
        return DataWriter(self.participant, Topic(self.participant, f"rt{name}", kind), qos=qos)

    def print_new(self) -> list[str]:
        """Print the messages that have come; return their topics."""
        found = []
        for name, reader in self.readers.items():
            for one in reader.take(100):
                if not hasattr(one, "serialize"):
                    continue  # says that a publisher has left
                found.append(name)
                line = {"topic": name, "cdr": base64.b64encode(one.serialize()).decode()}
                print(json.dumps(line), flush=True)
        return found


class Drivers:
    """Publish the parts of a drive in a file."""

    def __init__(self, robot: Robot, path: str) -> None:
        self._drive = np.load(path)
        self._robot, self._shift_ns = robot, 0
        self._start_lidar(RELIABLE if "best_effort_from" in self._drive else BEST_EFFORT)
        self._images = robot.writer("/camera/image_raw", Image, BEST_EFFORT)
        self._infos = robot.writer("/camera/camera_info", CameraInfo, RELIABLE)
        if "left" in self._drive:
            self._left = robot.writer("/left/image_raw/compressed", CompressedImage, BEST_EFFORT)
            self._left_infos = robot.writer("/left/camera_info", CameraInfo, RELIABLE)
        self._odometry: DataWriter | None = None
        self._static: DataWriter | None = None

    def _start_lidar(self, qos: Qos) -> None:
        self._clouds = None  # the one before leaves first
        self._clouds = self._robot.writer("/velodyne_points", PointCloud2, qos)

    def __len__(self) -> int:
        return len(self._drive["stamps_ns"])

    def pause_s(self, index: int) -> float:
        """Return how long nothing is sent before a frame."""
        return float(self._drive["pauses_s"][index]) if "pauses_s" in self._drive else 0.0

    @property
    def first_ns(self) -> int:
        return int(self._drive["stamps_ns"][0])

    def follow(self, before_ns: int) -> None:
        """Let the drive follow what was sent before it, unless its stamps are to be kept."""
        if "follows" in self._drive:
            self._shift_ns = before_ns + 10**8 - self.first_ns

    def has(self, name: str, index: int) -> bool:
        """Return whether a part is sent with a frame; -1 is the time before the drive."""
        return index >= (int(self._drive[f"{name}_from"]) if f"{name}_from" in self._drive else -1)

    def send(self, index: int, stamp_ns: int | None = None) -> None:
        """Publish a frame, or the first one before the drive at another time; the scan after all else."""
        drive, row = self._drive, max(index, 0)
        time_ns = int(drive["stamps_ns"][row]) + self._shift_ns if stamp_ns is None else stamp_ns
        time_ns += int(drive["offsets_ns"][row]) if "offsets_ns" in drive and index >= 0 else 0
        stamp = stamp_of(time_ns)
        if "best_effort_from" in drive and index == int(drive["best_effort_from"]):
            self._start_lidar(BEST_EFFORT)
        if self._static is None and self.has("tf", index):
            self._static = self._robot.writer("/tf_static", TFMessage, LATCHED)
            edges = zip(drive["tf_names"], drive["tf_poses"], strict=True)
            self._static.write(TFMessage([self._edge(*one) for one in edges]))
        if "poses" in drive and self.has("poses", index):
            if self._odometry is None:
                self._odometry = self._robot.writer("/odometry", Odometry, RELIABLE)
            pose = drive["poses"][row]
            at = Pose(Point(*map(float, pose[:3, 3])), rotation_of(pose))
            header = Header(stamp, "odom")
            self._odometry.write(Odometry(header, "base_link", PoseWithCovariance(at)))
        if "images" in drive:
            offset_ns = int(drive["camera_offset_ns"]) if "camera_offset_ns" in drive else 0
            self._send_images(stamp_of(time_ns + offset_ns), index)
        points = np.ascontiguousarray(drive[f"points_{row}"], np.float32)
        fields = [
            PointField(name, 4 * at, 7, 1) for at, name in enumerate(("x", "y", "z", "intensity"))
        ]
        size, data = 16 * len(points), points.tobytes()
        self._clouds.write(
            PointCloud2(
                Header(stamp, "velodyne"), 1, len(points), fields, False, 16, size, data, True
            )
        )

    def _send_images(self, stamp: Time, index: int) -> None:
        drive, row = self._drive, max(index, 0)
        whole = drive["images"][row]
        height, width = whole.shape[:2]
        matrix = drive["camera_matrix"]
        k = matrix.ravel().tolist()
        p = np.column_stack([matrix, np.zeros(3)]).ravel().tolist()
        flat = [0.0] * 5, k, np.eye(3).ravel().tolist(), p
        header = Header(stamp, "camera")
        if self.has("infos", index):
            self._infos.write(CameraInfo(header, height, width, "plumb_bob", *flat))
        rows = drive["image_rows"][row] if "image_rows" in drive else height
        data = whole[:rows].tobytes()
        self._images.write(Image(header, int(rows), width, "rgb8", 0, 3 * width, data))
        if "left" in drive:
            header = Header(stamp, "left")
            self._left_infos.write(CameraInfo(header, height, width, "plumb_bob", *flat))
            png = drive[f"left_{row}"].tobytes()
            self._left.write(CompressedImage(header, "rgb8; png compressed bgr8", png))

    @staticmethod
    def _edge(names: str, pose: np.ndarray) -> TransformStamped:
        parent, child = str(names).split()
        x, y, z, w = map(float, pose[3:])
        return TransformStamped(
            Header(frame_id=parent),
            child,
            Transform(Vector3(*map(float, pose[:3])), Quaternion(x, y, z, w)),
        )


def play(robot: Robot, drivers: Drivers) -> None:
    """Send the first scan until a line comes; after another one, each frame after the results of the one before.

    Where it listens to no results, each frame needs a line.
    """
    orders = queue.Queue()
    threading.Thread(target=obey, args=(orders,), daemon=True).start()
    before_ns = drivers.first_ns - 1000 * 10**8
    while orders.empty():
        before_ns += 10**8
        drivers.send(-1, before_ns)
        time.sleep(0.1)
    drivers.follow(before_ns)
    orders.get()
    last = base64.b64encode(str(before_ns).encode()).decode()
    print(json.dumps({"topic": "stopped", "cdr": last}), flush=True)
    orders.get()
    quiet_s = time.monotonic() + 0.5
    while time.monotonic() < quiet_s:  # until the results of what was sent before have come
        if robot.print_new():
            quiet_s = time.monotonic() + 0.5
        time.sleep(0.005)
    for index in range(len(drivers)):
        time.sleep(drivers.pause_s(index))
        drivers.send(index)
        deadline_s = time.monotonic() + 10
        missing = set(robot.readers) - {"/tf_static", "/diagnostics"}
        if not missing:
            orders.get()
        while missing and time.monotonic() < deadline_s:
            missing -= set(robot.print_new())
            time.sleep(0.005)


def obey(orders: queue.Queue) -> None:
    """Take orders; end with the tests that give them."""
    for line in sys.stdin:
        orders.put(line)
    os._exit(0)


def main() -> None:
    domain, path, *topics = sys.argv[1:]
    robot = Robot(int(domain), dict(zip(topics[::2], topics[1::2], strict=True)))
    if path == "-":
        threading.Thread(target=obey, args=(queue.Queue(),), daemon=True).start()
        while True:  # until it is ended
            robot.print_new()
            time.sleep(0.005)
    else:
        play(robot, Drivers(robot, path))


if __name__ == "__main__":
    main()
