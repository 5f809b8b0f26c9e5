"""Keeps the latest messages of some topics, which a thread receives."""

import threading
import time
from collections import deque
from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

from data.bags.bag import RawMessage
from data.bags.message_times import header_stamp_ns
from data.bags.transforms import TF_TOPICS
from data.dds.participant import DdsParticipant, Publication, QosProfile

IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
POINTS = "sensor_msgs/msg/PointCloud2"
_LARGE = (POINTS, *IMAGES)
_TRANSFORMS = "tf2_msgs/msg/TFMessage"
POSES = ("nav_msgs/msg/Odometry", "sensor_msgs/msg/Imu", "sensor_msgs/msg/NavSatFix")
# What says how the parts of a frame belong together; it may come, and change, at any time.
DESCRIPTIONS = ("sensor_msgs/msg/CameraInfo", _TRANSFORMS)
KINDS = (*_LARGE, *POSES, *DESCRIPTIONS)
_FIXED_TRANSFORMS = TF_TOPICS[0]
# Messages that are kept of a topic: a second of a fast IMU, and of scans and images.
_KEPT_LARGE, _KEPT_SMALL = 10, 500
_QUEUED_LARGE = 5  # as sensor data has it in ROS 2
_WAIT_NS = 100_000_000
_MIN_BYTES = 12  # of a message with a header
_JUMP_NS = 500_000_000  # of a stamp back, or ahead of the time that passed


class StampJump(NamedTuple):
    """A stamp that does not follow the one before it.

    Attributes:
        received_ns: When its message came.
        step_ns: Step of the stamp beyond the time that passed.
    """

    received_ns: int
    step_ns: int


class _Reader(NamedTuple):
    """A reader of a topic, and the condition that there is news."""

    reader: Any
    news: Any
    is_reliable: bool


class TopicReceiver:
    """Receives messages in a thread; a topic may be added and dropped at any time."""

    def __init__(self, participant: DdsParticipant) -> None:
        """Start the thread."""
        from cyclonedds.core import WaitSet

        self._participant = participant
        self._readers: dict[str, _Reader] = {}
        self._waiting = WaitSet(participant.native)
        self.kinds: dict[str, str] = {}
        self._kept: dict[str, deque[RawMessage]] = {}
        self.jumps: dict[str, StampJump] = {}
        """Last jump of the stamps of each topic that had one."""
        self._is_closed = False
        self.changed = threading.Condition()
        """Notified at each message, and when the receiver is closed."""
        self._thread = threading.Thread(target=self._receive, name="topics", daemon=True)
        self._thread.start()

    def add(self, topic: Publication) -> None:
        """Receive a topic as reliably as it is sent, which a driver that starts again may change; what came stays."""
        from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState

        before = self._readers.get(topic.name)
        if before is not None and before.is_reliable == topic.is_reliable:
            return
        is_large = topic.kind in _LARGE
        profile: QosProfile = "default" if topic.is_reliable else "sensor_data"
        profile = "latched" if topic.name == _FIXED_TRANSFORMS else profile
        depth = _QUEUED_LARGE if is_large else _KEPT_SMALL
        reader = self._participant.reader(topic.name, topic.kind, profile, depth)
        news = ReadCondition(reader, ViewState.Any | InstanceState.Any | SampleState.NotRead)
        with self.changed:
            self.kinds[topic.name] = topic.kind
            kept = deque[RawMessage](maxlen=_KEPT_LARGE if is_large else _KEPT_SMALL)
            self._kept.setdefault(topic.name, kept)
            self._readers[topic.name] = _Reader(reader, news, topic.is_reliable)
        self._waiting.attach(news)
        if before is not None:
            self._waiting.detach(before.news)

    def keep(self, topics: Collection[str]) -> None:
        """Drop all topics but some."""
        with self.changed:
            dropped = [name for name in self._readers if name not in topics]
            for name in dropped:
                self._waiting.detach(self._readers.pop(name).news)
                del self._kept[name]

    def messages(self) -> Mapping[str, list[RawMessage]]:
        """Return what is kept of each topic, in the order in which it came."""
        with self.changed:
            return {name: list(rows) for name, rows in self._kept.items()}

    def newest(self, topic: str) -> RawMessage | None:
        """Return the last message of a topic, or None."""
        rows = self._kept[topic]
        return rows[-1] if rows else None

    def count_between(self, topic: str, first: RawMessage | None, last: RawMessage) -> int:
        """Return how many messages of a topic came between two of them, as far as they are kept."""
        with self.changed:
            rows = list(self._kept[topic])
        places = [place for place, one in enumerate(rows) if one is first or one is last]
        return places[1] - places[0] - 1 if len(places) == 2 else 0

    @property
    def is_closed(self) -> bool:
        """Whether nothing comes any more."""
        return self._is_closed

    def close(self) -> None:
        """End the thread."""
        with self.changed:
            self._is_closed = True
            self.changed.notify_all()
        self._thread.join()

    def _receive(self) -> None:
        while not self._is_closed:
            self._waiting.wait(_WAIT_NS)
            with self.changed:
                came = [self._take(name, one.reader) for name, one in self._readers.items()]
                if any(came):
                    self.changed.notify_all()

    def _take(self, name: str, reader: Any) -> bool:  # noqa: ANN401
        """Take over what has come of a topic; what says that a publisher has left holds no message."""
        now_ns = time.time_ns()
        rows = [one for one in reader.take(_KEPT_SMALL) if hasattr(one, "binary")]
        for one in rows:
            self._keep(RawMessage(name, now_ns, one.binary))
        return bool(rows)

    def _keep(self, message: RawMessage) -> None:
        """Keep a message; where stamps jump, those before are of another time."""
        name, kept = message.topic, self._kept[message.topic]
        if self.kinds[name] != _TRANSFORMS:
            if len(message.data) < _MIN_BYTES:
                return
            if kept:
                step_ns = stamp_ns(message) - stamp_ns(kept[-1])
                passed_ns = message.received_ns - kept[-1].received_ns
                if step_ns < -_JUMP_NS or step_ns - passed_ns > _JUMP_NS:
                    self.jumps[name] = StampJump(message.received_ns, step_ns - passed_ns)
                    kept.clear()
        kept.append(message)


def stamp_ns(message: RawMessage) -> int:
    """Return the stamp of a message, or when it came where it has none."""
    return header_stamp_ns(message, is_ros1=False) or message.received_ns
