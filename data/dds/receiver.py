"""Keeps the latest messages of some topics, which a thread receives."""

import threading
import time
from collections import deque
from collections.abc import Collection, Mapping
from typing import Any

from data.bags.bag import RawMessage
from data.bags.transforms import TF_TOPICS
from data.dds.participant import DdsParticipant, Publication, QosProfile

_IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
POINTS = "sensor_msgs/msg/PointCloud2"
_LARGE = (POINTS, *_IMAGES)
_SMALL = (
    *("sensor_msgs/msg/CameraInfo", "sensor_msgs/msg/Imu", "sensor_msgs/msg/NavSatFix"),
    *("nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"),
)
KINDS = (*_LARGE, *_SMALL)
_FIXED_TRANSFORMS = TF_TOPICS[0]
# Messages that are kept of a topic: a second of a fast IMU, and of scans and images.
_KEPT_LARGE, _KEPT_SMALL = 10, 500
_QUEUED_LARGE = 5  # as sensor data has it in ROS 2
_WAIT_NS = 100_000_000


class TopicReceiver:
    """Receives messages in a thread; a topic may be added and dropped at any time."""

    def __init__(self, participant: DdsParticipant) -> None:
        """Start the thread."""
        from cyclonedds.core import WaitSet

        self._participant = participant
        self._readers: dict[str, tuple[Any, Any]] = {}
        self._waiting = WaitSet(participant.native)
        self.kinds: dict[str, str] = {}
        self._kept: dict[str, deque[RawMessage]] = {}
        self._is_closed = False
        self.changed = threading.Condition()
        """Notified at each message, and when the receiver is closed."""
        self._thread = threading.Thread(target=self._receive, name="topics", daemon=True)
        self._thread.start()

    def add(self, topic: Publication) -> None:
        """Receive a topic, as reliably as it is sent."""
        from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState

        if topic.name in self.kinds:
            return
        is_large = topic.kind in _LARGE
        profile: QosProfile = "default" if topic.is_reliable else "sensor_data"
        profile = "latched" if topic.name == _FIXED_TRANSFORMS else profile
        depth = _QUEUED_LARGE if is_large else _KEPT_SMALL
        reader = self._participant.reader(topic.name, topic.kind, profile, depth)
        news = ReadCondition(reader, ViewState.Any | InstanceState.Any | SampleState.NotRead)
        with self.changed:
            self.kinds[topic.name] = topic.kind
            self._kept[topic.name] = deque(maxlen=_KEPT_LARGE if is_large else _KEPT_SMALL)
            self._readers[topic.name] = reader, news
        self._waiting.attach(news)

    def keep(self, topics: Collection[str]) -> None:
        """Drop all topics but some."""
        with self.changed:
            dropped = [name for name in self._readers if name not in topics]
            for name in dropped:
                self._waiting.detach(self._readers.pop(name)[1])
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
                came = [self._take(name, reader) for name, (reader, _) in self._readers.items()]
                if any(came):
                    self.changed.notify_all()

    def _take(self, name: str, reader: Any) -> bool:  # noqa: ANN401
        """Take over what has come of a topic; what says that a publisher has left holds no message."""
        now_ns = time.time_ns()
        rows = [one for one in reader.take(_KEPT_SMALL) if hasattr(one, "binary")]
        self._kept[name].extend(RawMessage(name, now_ns, one.binary) for one in rows)
        return bool(rows)
