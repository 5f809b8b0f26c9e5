"""Results on topics of ROS 2: frames of reference as REP 105 names them, stamps exactly those of the sensor."""

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from data.dds.participant import DdsParticipant, QosProfile
from data.live.source_health import SourceHealth
from data.messages.definitions import encoded, message
from data.messages.geometry import LIDAR, WORLD, time_of
from data.messages.motion import transform
from data.messages.occupancy import occupancy
from data.messages.topics import MessageFunction, Topic, part_statuses, topics
from perception.geometry.se3 import inverse
from perception.obstacles.config import OccupancyConfig
from perception.obstacles.occupancy import OccupancyEvidence
from perception.types import Float64, Result

PREFIX = "/trifuse"
_GRIDS = {"/occupancy": True, "/occupancy/static": False}  # with what moves, and without
_GRID_KIND = "nav_msgs/msg/OccupancyGrid"
_STAMP_JITTER_S = 0.02
_TF, _ODOMETRY = _OF_BASE = ("/tf", "/ego/odometry")
_SHARED = (_TF, "/diagnostics")  # one topic each for all nodes
_KINDS = {
    "tf2_msgs/msg/TFMessage",
    "nav_msgs/msg/Odometry",
    "sensor_msgs/msg/PointCloud2",
    "vision_msgs/msg/Detection3DArray",
    "visualization_msgs/msg/MarkerArray",
    "diagnostic_msgs/msg/DiagnosticArray",
}
_TF_DEPTH = 100
_MAX_AGE_S = 3600.0  # of a stamp; an older one is of a recording


@dataclass(frozen=True)
class RosFrames:
    """Frames of reference of a robot.

    Attributes:
        world: Frame that poses are in: odom, or that of the poses which the robot states.
        lidar: Frame of points and objects.
        base: Frame whose pose is published, such as base_link.
        base_SE3_velo: (4, 4) transform from the LiDAR frame of the drive to it.
        world_SE3_drive: (4, 4) transform from the world of results to that frame.
        has_pose_transform: Whether the pose is also a transform: a robot that states its own has one.
        static: (4, 4) parent_SE3_child by (parent, child) of the frames that the robot does not state itself.
    """

    world: str = "odom"
    lidar: str = LIDAR
    base: str = LIDAR
    base_SE3_velo: Float64 = field(default_factory=lambda: np.eye(4))
    world_SE3_drive: Float64 = field(default_factory=lambda: np.eye(4))
    has_pose_transform: bool = True
    static: Mapping[tuple[str, str], Float64] = field(default_factory=dict)

    def in_world(self, result: Result) -> Result:
        """Return a result with the pose of the LiDAR in that frame."""
        return replace(result, world_SE3_velo=self.world_SE3_drive @ result.world_SE3_velo)

    def of_base(self, result: Result) -> Result:
        """Return a result with the pose of the base, and its covariance, in place of the LiDAR's."""
        velo_SE3_base, world_SE3_drive = inverse(self.base_SE3_velo), self.world_SE3_drive
        lever_m = result.world_SE3_velo[:3, :3] @ velo_SE3_base[:3, 3]
        # A rotation of the LiDAR moves the base by its cross product with the lever.
        x, y, z = lever_m
        jacobian = np.eye(6)
        jacobian[:3, 3:] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
        jacobian = np.kron(np.eye(2), world_SE3_drive[:3, :3]) @ jacobian
        return replace(
            result,
            world_SE3_velo=world_SE3_drive @ result.world_SE3_velo @ velo_SE3_base,
            pose_covariance=jacobian @ result.pose_covariance @ jacobian.T,
        )


class RosPublisher:
    """Publishes results as a node of ROS 2 does."""

    def __init__(
        self,
        participant: DdsParticipant,
        frames: RosFrames,
        *,
        min_score: float,
        origin_ns: int = 0,
        health: SourceHealth | None = None,
        grid: OccupancyConfig | None = None,
    ) -> None:
        """Open the topics.

        Args:
            participant: Participant of the domain.
            frames: Frames of reference.
            min_score: Score from which vehicles are published.
            origin_ns: Time in nanoseconds at which stamps are 0.
            health: Health of the source that the frames come from.
            grid: Rate and size of the occupancy grids.
        """
        self._origin_ns, self._health = origin_ns, health or SourceHealth()
        self._grid = grid or OccupancyConfig()
        own: dict[str, MessageFunction] = {_TF: self._pose_transform}
        chosen = [
            replace(one, message_of=own.get(one.name, one.message_of))
            for one in topics(min_score)
            if one.kind in _KINDS
        ]
        self._writers = [
            (one, participant.writer(ros_name(one.name), one.kind, *_quality(one)))
            for one in chosen
        ]
        # Planners keep the last grid, and ask for it when they start.
        self._grids = [
            (participant.writer(ros_name(name), _GRID_KIND, "latched"), with_moving)
            for name, with_moving in _GRIDS.items()
        ]
        self._grid_s = -np.inf
        self._diagnostics = next(two for one, two in self._writers if one.name == "/diagnostics")
        self._last: Result | None = None
        self.dropped = 0
        """Number of messages that were not sent, as a reader was too slow."""
        self._static = participant.writer("/tf_static", "tf2_msgs/msg/TFMessage", "latched")
        self.use_frames(frames)

    def use_frames(self, frames: RosFrames) -> None:
        """Publish in other frames of reference from now on."""
        self._frames = frames
        if frames.static:
            tree = [transform(0.0, *edge, pose) for edge, pose in frames.static.items()]
            self._static.write(encoded(message("tf2_msgs/TFMessage", transforms=tree)))

    def publish(self, result: Result) -> None:
        """Send a result to those who have subscribed; messages that nobody takes are not made."""
        stamp_ns = self._origin_ns + round(1e9 * result.frame.stamp_s)
        of_base = self._frames.of_base(result)
        for topic, writer in self._writers:
            if not writer.has_readers:
                continue
            about = of_base if topic.name in _OF_BASE else result
            value = topic.message_of(about, self._last)
            if value is not None:
                self.dropped += not writer.write(encoded(self._as_ros(topic, value, stamp_ns)))
        self._publish_grids(result, stamp_ns)
        self._last = of_base

    def _publish_grids(self, result: Result, stamp_ns: int) -> None:
        """Send the occupancy grids, not at each frame; a clock that was set back starts again."""
        if 0 <= result.frame.stamp_s - self._grid_s < 1 / self._grid.rate_hz - _STAMP_JITTER_S:
            return
        self._grid_s = result.frame.stamp_s
        taken = [(writer, moving) for writer, moving in self._grids if writer.has_readers]
        if not taken:
            return
        evidence = OccupancyEvidence.of(self._frames.in_world(result), self._grid)
        for writer, with_moving in taken:
            value = occupancy(result.frame.stamp_s, evidence.grid(with_moving=with_moving))
            stamped = _readdressed(value, self._names, time_of(stamp_ns))
            stamped.info.map_load_time = time_of(stamp_ns)
            self.dropped += not writer.write(encoded(stamped))

    def publish_health(self) -> None:
        """Publish the health of the source alone, as while no scan comes."""
        now = message("std_msgs/Header", stamp=time_of(time.time_ns()))
        value = message("diagnostic_msgs/DiagnosticArray", header=now, status=self._statuses())
        self._diagnostics.write(encoded(value))

    def _statuses(self) -> list[Any]:
        return part_statuses(self._health.health, self._health.parts)

    def _pose_transform(self, of_base: Result, last: Result | None) -> Any:  # noqa: ANN401 - a message
        """Return the pose alone: where its sensors are the robot states itself."""
        del last
        if not self._frames.has_pose_transform:
            return None
        pose = transform(0.0, WORLD, self._frames.base, of_base.world_SE3_velo)
        return message("tf2_msgs/TFMessage", transforms=[pose])

    @property
    def _names(self) -> Mapping[str, str]:
        return {WORLD: self._frames.world, LIDAR: self._frames.lidar}

    def _as_ros(self, topic: Topic, value: Any, stamp_ns: int) -> Any:  # noqa: ANN401 - messages
        stamped = _readdressed(value, self._names, time_of(stamp_ns))
        if topic.name == _ODOMETRY:
            stamped.child_frame_id = self._frames.base
        if topic.name == "/diagnostics":
            age_s = (time.time_ns() - stamp_ns) / 1e9
            if 0 <= age_s < _MAX_AGE_S:
                row = message("diagnostic_msgs/KeyValue", key="stamp to publish [ms]")
                row.value = f"{1e3 * age_s:.2f}"
                stamped.status[0].values.append(row)
            stamped.status += self._statuses()
        return stamped


def ros_name(name: str) -> str:
    """Return the name of a topic of results in ROS."""
    return name if name in _SHARED else f"{PREFIX}{name}"


def _quality(topic: Topic) -> tuple[QosProfile, int]:
    return ("default", _TF_DEPTH) if topic.name == _TF else ("default", 1)


def _readdressed(value: Any, names: Mapping[str, str], stamp: Any) -> Any:  # noqa: ANN401
    """Give a message, which nobody else has, other names of its frames, and one stamp in all of its headers."""
    headers = {id(one): one for one in _headers(value)}
    for header in headers.values():
        header.stamp, header.frame_id = stamp, names.get(header.frame_id, header.frame_id)
    if hasattr(value, "child_frame_id"):
        value.child_frame_id = names.get(value.child_frame_id, value.child_frame_id)
    return value


def _headers(value: Any) -> Iterator[Any]:  # noqa: ANN401
    """Yield the headers of a message and of those in it, as often as they are used."""
    for name, part in vars(value).items():
        if name == "header":
            yield part
        elif isinstance(part, list) and part and hasattr(part[0], "header"):
            yield from (one.header for one in part)
