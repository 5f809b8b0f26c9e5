"""Topics of a robot as a live source: a frame for each scan, joined to what is nearest to it in time."""

import logging
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count

import numpy as np

from data.bags.bag import RawMessage
from data.bags.message_times import header_stamp_ns
from data.bags.opening import BagOpening
from data.dds.participant import DdsParticipant
from data.dds.receiver import KINDS, POINTS, TopicReceiver
from data.dds.recent_bag import RecentBag
from data.dds.result_publisher import PREFIX, RosFrames
from data.layouts import OpenConfig
from data.live.source import LiveSource
from perception.errors import PerceptionError
from perception.types import LIDAR, Frame

log = logging.getLogger(__name__)

_FIRST_SCANS, _MAX_FIRST_S, _MIN_FIRST_S = 5, 5.0, 1.0  # what is seen before the topics are chosen
_DISCOVERY_STEP_S = 0.05
# Images and poses of the time of a scan come a little later than it.
_MAX_WAIT_S = 0.06
_SILENT_S = 0.3
_REPORT_STEP_S = 0.5  # between two reports of the same silence
_FIXED_TO_EARTH = ("odom", "map", "earth", "world")  # REP 105
_ODOM, _MAP = _FIXED_TO_EARTH[:2]


class RosSource(LiveSource):
    """Scans of one or several LiDARs with images and poses, by topics of ROS 2."""

    def __init__(self, participant: DdsParticipant, config: OpenConfig) -> None:
        """Wait for scans, and choose the topics among those that are there.

        Args:
            participant: Participant of the domain.
            config: How the topics are read: those of LiDARs and camera, the sensor and the like.

        Raises:
            UsageError: A topic that was named is of another type.
            CalibrationError: A camera or LiDAR that was named has no transform to the others.
        """
        self._receiver = TopicReceiver(participant)
        self._source = f"ROS domain {participant.domain}"
        try:
            self._await_scans(participant, config)
            self._opening = BagOpening.of(self._recent(), config)
            self._drive = self._opening.drive()
        except BaseException:
            self.close()
            raise
        self._drive = replace(self._drive, deskew=config.deskew)
        topics = self._opening.topics
        self._lidar = topics.lidars[0]
        self._receiver.keep(topics.timed)
        self.frames = self._frames_of_reference()
        self.on_silence: Callable[[str, float], None] = lambda part, silent_s: None
        """Called with the sensor and the seconds since its last message, while nothing comes."""
        for note in self._drive.notes:
            log.warning(note)
        log.info("%s: %s", self._source, ", ".join(topics.timed))
        super().__init__(
            self._source, self._drive.sensor, is_sequence=True, origin_ns=self._drive.origin_ns
        )

    def laps(self) -> Iterator[Iterator[Frame]]:
        """Yield the frames until the source is closed."""
        yield self._frames()

    def close(self) -> None:
        """Receive nothing more."""
        self._receiver.close()

    def _await_scans(self, participant: DdsParticipant, config: OpenConfig) -> None:
        """Wait for enough messages of all topics, those that were named among them."""
        named = {
            f"/{name.strip().strip('/')}"
            for names in (config.lidar, config.camera)
            for name in (names or "").split(",")
            if name.strip()
        }
        begin_s: float | None = None
        for step in count():
            for topic in participant.publications():
                if topic.kind in KINDS and not topic.name.startswith(f"{PREFIX}/"):
                    self._receiver.add(topic)
            kept = self._receiver.messages()
            scans = [
                len(rows) for name, rows in kept.items() if self._receiver.kinds[name] == POINTS
            ]
            now_s = time.monotonic()
            if max(scans, default=0):
                begin_s = begin_s or now_s
            waited_s = 0.0 if begin_s is None else now_s - begin_s
            has_named = all(kept.get(name) for name in named)
            is_enough = max(scans, default=0) >= _FIRST_SCANS and waited_s > _MIN_FIRST_S
            if (is_enough and has_named) or waited_s > _MAX_FIRST_S:
                return
            if step * _DISCOVERY_STEP_S == 1:
                log.info("%s: waiting for scans on a topic of type %s", self._source, POINTS)
            time.sleep(_DISCOVERY_STEP_S)

    def _recent(self) -> RecentBag:
        return RecentBag(self._source, self._receiver.kinds, self._receiver.messages())

    def _frames_of_reference(self) -> RosFrames:
        """Return the frames of the robot by its transforms."""
        opening, poses = self._opening, self._opening.topics
        scan, tree = opening.streams[self._lidar].read(0), opening.tree
        lidar = str(scan.header.frame_id).lstrip("/")
        lidar_SE3_velo = opening.lidar_SE3_velo(lidar)
        base = tree.root_of(lidar, _FIXED_TO_EARTH)
        base_SE3_lidar = tree.require(base, lidar, "to publish the pose of the vehicle")
        base_SE3_velo = base_SE3_lidar @ lidar_SE3_velo
        is_turned = not np.array_equal(lidar_SE3_velo, np.eye(4))
        own = f"{lidar}_aligned" if is_turned else lidar
        world = _ODOM
        if poses.odometry is not None:
            world = str(opening.streams[poses.odometry].read(0).header.frame_id) or _ODOM
        elif self._drive.poses is not None:
            world = _MAP
        return RosFrames(
            world=world,
            lidar=own,
            base=base,
            base_SE3_velo=base_SE3_velo,
            # Odometry begins with the base, not the LiDAR, at the origin.
            world_SE3_drive=base_SE3_velo if self._drive.poses is None else np.eye(4),
            has_pose_transform=not tree.has_parent(base),
            static={(lidar, own): lidar_SE3_velo} if is_turned else {},
        )

    def _frames(self) -> Iterator[Frame]:
        last: RawMessage | None = self._receiver.newest(self._lidar)
        reported_s = 0.0
        for index in count():
            while (scan := self._next_scan(last)) is None:
                if self._receiver.is_closed:
                    return
                silent_s = 0.0 if last is None else time.time() - last.received_ns / 1e9
                if silent_s >= _SILENT_S and time.monotonic() - reported_s >= _REPORT_STEP_S:
                    reported_s = time.monotonic()
                    self.on_silence(LIDAR, silent_s)
            self.dropped += self._receiver.count_between(self._lidar, last, scan)
            last = scan
            self._await_others(scan)
            try:
                yield self._frame(index, scan)
            except PerceptionError as error:
                log.warning("skipped a scan: %s", error)

    def _next_scan(self, last: RawMessage | None) -> RawMessage | None:
        """Return the newest scan, or None where there is none within a moment."""
        receiver = self._receiver
        with receiver.changed:
            receiver.changed.wait_for(
                lambda: receiver.newest(self._lidar) is not last or receiver.is_closed,
                timeout=_SILENT_S / 3,
            )
            newest = receiver.newest(self._lidar)
            return None if newest is last or receiver.is_closed else newest

    def _await_others(self, scan: RawMessage) -> None:
        """Wait until all topics that are alive have a message of the time of a scan, or one later."""
        receiver, stamp_ns = self._receiver, _stamp_ns(scan)
        others = [name for name in self._opening.topics.timed if name != self._lidar]

        def are_there() -> bool:
            for name in others:
                newest = receiver.newest(name)
                is_alive = newest and scan.received_ns - newest.received_ns < _SILENT_S * 1e9
                if newest and is_alive and _stamp_ns(newest) < stamp_ns:
                    return False
            return True

        with receiver.changed:
            receiver.changed.wait_for(lambda: are_there() or receiver.is_closed, _MAX_WAIT_S)

    def _frame(self, index: int, scan: RawMessage) -> Frame:
        self._opening.move_to(self._recent())
        drive = self._opening.joined(self._drive)
        stamp_ns = _stamp_ns(scan)
        row = int(np.searchsorted(drive.stamps_ns, stamp_ns))
        try:
            frame = drive[row]
        except PerceptionError as error:
            log.warning("left out an image: %s", error)
            frame = replace(drive, images=None)[row]
        stamp_s = (stamp_ns - self.origin_ns) / 1e9
        return replace(frame, index=index, number=index, name=f"{index:06d}", stamp_s=stamp_s)


def _stamp_ns(message: RawMessage) -> int:
    """Return the stamp of a message, or when it came where it has none."""
    return header_stamp_ns(message, is_ros1=False) or message.received_ns
