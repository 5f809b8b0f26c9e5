"""Topics of a robot as a live source: a frame for each scan, joined to what is nearest to it in time.

What a frame needs may come late, change, or go: the source goes on with what it has, says so, and takes up what comes.
"""

import logging
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import count

import numpy as np

from data.bags.bag import RawMessage
from data.bags.drive import BagDrive
from data.bags.opening import BagOpening
from data.bags.sweeps import SweepReader
from data.bags.transforms import TF_TOPICS, TransformTree
from data.dds.participant import DdsParticipant
from data.dds.receiver import (
    DESCRIPTIONS,
    IMAGES,
    KINDS,
    POINTS,
    POSES,
    TopicReceiver,
    stamp_ns,
)
from data.dds.recent_bag import RecentBag
from data.dds.result_publisher import PREFIX, RosFrames
from data.dds.ros_cameras import RosCameras
from data.layouts import OpenConfig
from data.live.source import LiveSource
from data.live.source_health import SourceHealth
from perception.errors import CalibrationError, PerceptionError
from perception.types import Frame, HealthLevel

log = logging.getLogger(__name__)

_FIRST_SCANS, _MAX_FIRST_S, _MIN_FIRST_S = 5, 5.0, 1.0  # what is seen before the topics are chosen
_DISCOVERY_STEP_S, _STEPS_TO_LOG = 0.05, 100
# Images and poses of the time of a scan come a little later than it.
_MAX_WAIT_S = 0.06
_SILENT_S, _SILENT_PERIODS = 0.3, 3.0
_CHECK_S = 0.5  # between two reports of the same silence, and two looks at what has come
_JUMP_SHOWN_S = 2.0
_OTHER_CLOCK_S = 1.0  # between stamp and arrival, beyond that of the scans
_NEWEST = 11  # messages that tell period and clock of a topic
_NEWEST_TRANSFORMS = 20  # of those that move, among which new frames are looked for
_FIXED_TO_EARTH = ("odom", "map", "earth", "world")  # REP 105
_ODOM, _MAP = _FIXED_TO_EARTH[:2]
_SILENT, _JUMP, _CLOCK, _SKIPPED = "silent", "stamps jumped", "other clock", "message left out"
_UNUSED, _AGAIN = "not used", "started again"


@dataclass(frozen=True)
class _Parts:
    """What the frames are made of.

    Attributes:
        opening: Scans, transforms and poses.
        drive: Frames without images.
        cameras: Cameras.
        known: What the topics had stated then; where they state more, it is opened again.
        frames: Frames of reference of the robot.
    """

    opening: BagOpening
    drive: BagDrive
    cameras: RosCameras
    known: object
    frames: RosFrames

    @property
    def topics(self) -> tuple[str, ...]:
        """Topics of scans, poses and images in use."""
        return tuple(dict.fromkeys((*self.opening.topics.timed, *self.cameras.topics)))

    @property
    def are_complete(self) -> bool:
        """Whether nothing is lacking that may still come."""
        has_base = self.opening.tree.has_parent(_frame_id(self.opening))
        return has_base and bool(self.cameras.topics) and self.drive.poses is not None

    def follows(self, other: "_Parts") -> bool:
        """Return whether frames go on as they were; else their axes, poses or cameras are others."""
        mine, before = (one.opening.lidar_SE3_velo(_frame_id(one.opening)) for one in (self, other))
        cameras, cameras_before = self.cameras.topics[1:], other.cameras.topics[1:]
        has_poses = [one.drive.poses is None for one in (self, other)]
        return np.array_equal(mine, before) and len({*has_poses}) == 1 and cameras == cameras_before


class RosSource(LiveSource):
    """Scans of one or several LiDARs with images and poses, by topics of ROS 2."""

    def __init__(self, participant: DdsParticipant, config: OpenConfig) -> None:
        """Wait for scans, and choose the topics among those that are there.

        Args:
            participant: Participant of the domain.
            config: How the topics are read: those of LiDARs and cameras, the sensor and the like.

        Raises:
            UsageError: A topic that was named is of another type.
        """
        self._participant, self._config = participant, config
        self._receiver = TopicReceiver(participant)
        self._source = f"ROS domain {participant.domain}"
        named = (config.lidar, config.camera, config.odometry)
        self._lidars, self._cameras, self._odometry = map(_topics_in, named)
        self.health = SourceHealth()
        self._lap = self._count = 0
        self._done_s: dict[str, float] = {}
        self.on_frames: Callable[[RosFrames], None] = lambda frames: None
        """Called with the frames of reference where they change."""
        try:
            self._await_scans()
            self._parts = self._open()
        except BaseException:
            self.close()
            raise
        drive = self._parts.drive
        self._lidar = self._parts.opening.topics.lidars[0]
        self._last: RawMessage | None = None
        for note in drive.notes:
            log.warning(note)
        super().__init__(
            self._source,
            drive.sensor,
            is_sequence=True,
            origin_ns=drive.origin_ns,
            health=self.health,
        )
        self.cameras = config.cameras[1:]

    @property
    def frames(self) -> RosFrames:
        """Frames of reference of the robot."""
        return self._parts.frames

    def laps(self) -> Iterator[Iterator[Frame]]:
        """Yield the frames until the source is closed; another lap where they do not follow those before."""
        self._last = self._receiver.newest(self._lidar)  # what came before is old
        while not self._receiver.is_closed:
            self._lap += 1
            self.on_frames(self.frames)
            yield self._frames(self._lap)

    def recovers_from(self, error: PerceptionError) -> bool:
        """Say what went wrong in the pipeline; on a robot frames go on."""
        self.health.report(self._lidar, _AGAIN, str(error), HealthLevel.ERROR)
        return True

    def close(self) -> None:
        """Receive nothing more."""
        self._receiver.close()

    def _await_scans(self) -> None:
        """Wait for enough messages of all topics, those that were named among them, and for transforms."""
        begin_s: float | None = None
        first = next(iter(self._lidars), None)
        for step in count():
            for topic in self._participant.publications():
                if topic.kind in KINDS and not topic.name.startswith(f"{PREFIX}/"):
                    self._receiver.add(topic)
            kept, kinds = self._receiver.messages(), self._receiver.kinds
            scans = [
                len(rows)
                for name, rows in kept.items()
                if kinds[name] == POINTS and first in (None, name)
            ]
            now_s = time.monotonic()
            if max(scans, default=0):
                begin_s = begin_s or now_s
            waited_s = 0.0 if begin_s is None else now_s - begin_s
            has_all = all(
                kept.get(name) for name in (*self._lidars, *self._cameras, *self._odometry)
            )
            has_all &= any(kept.get(name) for name in TF_TOPICS)
            is_enough = max(scans, default=0) >= _FIRST_SCANS and waited_s > _MIN_FIRST_S
            if (is_enough and has_all) or waited_s > _MAX_FIRST_S:
                return
            if step % _STEPS_TO_LOG == 1 and not scans:
                log.info(
                    "%s: waiting for scans on %s", self._source, first or "a topic of " + POINTS
                )
            time.sleep(_DISCOVERY_STEP_S)

    def _recent(self) -> RecentBag:
        """Return what is kept, of a calibration the newest message."""
        kinds, info = self._receiver.kinds, DESCRIPTIONS[0]
        rows = self._receiver.messages().items()
        kept = {name: one[-1:] if kinds[name] == info else one for name, one in rows if one}
        return RecentBag(self._source, kinds, kept)

    def _open(self) -> _Parts:
        """Choose the topics among those that have messages, and open what frames are made of."""
        recent = self._recent()
        has = {one.name for one in recent.topics}
        lidars, cameras, odometry = (
            ",".join(one for one in names if one in has) or None
            for names in (self._lidars, self._cameras, self._odometry)
        )
        config = replace(self._config, lidar=lidars, camera=cameras, odometry=odometry)
        opening = BagOpening.of(recent, config)
        if self._odometry and odometry is None:
            opening.topics = replace(opening.topics, odometry=None, fixes=None)
        chosen = opening.topics.camera
        opening.topics = replace(opening.topics, camera=None, camera_info=None)
        first, *others = self._lidars or opening.topics.lidars
        try:
            drive = opening.drive()
        except CalibrationError as error:
            if not others:
                raise
            # Scans of a LiDAR are merged from when its place is known.
            opening.topics = replace(opening.topics, lidars=(first,))
            drive = opening.drive()
            self.health.report(others[0], _UNUSED, str(error))
        else:
            self.health.clear(others, _UNUSED)
            for one in {*others} - {*opening.topics.lidars}:
                self.health.report(one, _UNUSED, "no message has come")
        names = self._cameras or ({chosen: Frame.camera} if chosen else {})
        opened = RosCameras(names, self.health)
        opened.open(opening, _frame_id(opening))
        self._report_poses(opening, drive)
        drive = replace(drive, deskew=self._config.deskew)
        frames = _frames_of_reference(opening, drive)
        parts = _Parts(opening, drive, opened, self._known(), frames)
        log.info("%s: %s", self._source, ", ".join(parts.topics))
        self._keep_topics(parts)
        return parts

    def _report_poses(self, opening: BagOpening, drive: BagDrive) -> None:
        """Say why the poses that a topic states are not used."""
        topics = opening.topics
        topic = topics.odometry or topics.fixes
        reason = next((note for note in drive.notes if "not used" in note), None)
        if topic is None:
            return
        if drive.poses is None and reason is not None:
            self.health.report(topic, _UNUSED, reason)
        else:
            self.health.clear([topic], _UNUSED)

    def _keep_topics(self, parts: _Parts) -> None:
        """Receive what is used, what describes it, and what may be used when it comes."""
        kept = self._receiver.messages()
        kinds = self._receiver.kinds
        usable = [
            name
            for name, rows in kept.items()
            if kinds[name] in DESCRIPTIONS
            or (not rows and self._is_usable(name, kinds[name], parts))
        ]
        self._receiver.keep({*parts.topics, *usable, *parts.cameras.names, *self._lidars})
        self.health.parts = parts.topics

    def _is_usable(self, name: str, kind: str, parts: _Parts) -> bool:
        """Return whether a topic would be used if it had messages."""
        if name.startswith(f"{PREFIX}/"):
            return False
        if kind in IMAGES and not parts.cameras.names:
            return True
        if kind in POSES and parts.drive.poses is None:
            return not self._odometry or name in self._odometry
        return kind in DESCRIPTIONS or name in self._lidars or name in self._cameras

    def _known(self) -> object:
        """Return what the topics state beside scans, images and poses: which have messages, calibrations, frames."""
        kept, kinds = self._receiver.messages(), self._receiver.kinds
        tree = TransformTree(self._source)
        recent = self._recent()
        for name in TF_TOPICS:
            rows = kept.get(name, [])
            for one in rows if name == TF_TOPICS[0] else rows[-_NEWEST_TRANSFORMS:]:
                tree.add(recent.decode(one))
        calibrations = [
            rows[-1].data[12:]
            for name, rows in kept.items()
            if rows and kinds[name] == DESCRIPTIONS[0]
        ]
        return {name for name, rows in kept.items() if rows}, calibrations, tree.frames

    def _take_up(self) -> bool:
        """Use what has come since the topics were chosen; return whether frames go on as they were."""
        parts = self._parts
        if parts.are_complete and self.health.is_ok:
            return True
        self._receive_usable()
        try:
            if self._known() == parts.known:
                return True
            self._parts = self._open()
        except PerceptionError as error:
            self.health.report(self._lidar, _UNUSED, str(error))
            return True
        self.health.clear([self._lidar], _UNUSED)
        self.on_frames(self.frames)
        return self._parts.follows(parts)

    def _receive_usable(self) -> None:
        """Receive what is new and may be used, and what is used where its driver has started again."""
        for topic in self._participant.publications():
            is_used = topic.name in self._parts.topics
            if is_used or self._is_usable(topic.name, topic.kind, self._parts):
                self._receiver.add(topic)

    def _frames(self, lap: int) -> Iterator[Frame]:
        while not self._receiver.is_closed and lap == self._lap:
            scan, last = self._next_scan(self._last), self._last
            if scan is None:
                self._check()
                is_silent = self.health.health.level_of(self._lidar) is HealthLevel.ERROR
                if is_silent and self._is_due("silence"):
                    self._receive_usable()
                    self.on_silence()
                continue
            self._await_others(scan)
            self._check()
            if self._is_due("take up") and not self._take_up():
                return  # the scan is the first one of another lap
            self.dropped += self._receiver.count_between(self._lidar, last, scan)
            self._last = scan
            try:
                frame = self._frame(scan)
            except PerceptionError as error:
                self.health.report(self._lidar, _SKIPPED, str(error), HealthLevel.ERROR)
                continue
            if frame is None:
                self.dropped += 1
                continue
            yield frame

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
        receiver, scan_ns = self._receiver, stamp_ns(scan)
        # What came with the scan before is alive, however long ago that was.
        alive_ns = (self._last or scan).received_ns - _SILENT_S * 1e9
        others = [name for name in self._parts.topics if name != self._lidar]
        kept = receiver.messages()
        shifts_ns = {name: _shift_ns(kept[name], kept[self._lidar]) for name in others}

        def are_there() -> bool:
            for name in others:
                newest = receiver.newest(name)
                is_alive = newest and newest.received_ns > alive_ns
                if newest and is_alive and stamp_ns(newest) + shifts_ns[name] < scan_ns:
                    return False
            return True

        with receiver.changed:
            receiver.changed.wait_for(lambda: are_there() or receiver.is_closed, _MAX_WAIT_S)

    def _is_due(self, task: str) -> bool:
        """Return whether it is time for a task that is not done at each scan."""
        now_s = time.monotonic()
        is_due = now_s - self._done_s.get(task, 0.0) >= _CHECK_S
        if is_due:
            self._done_s[task] = now_s
        return is_due

    def _check(self) -> None:
        """Report topics that are silent, or whose stamps are odd."""
        kept, now_ns = self._receiver.messages(), time.time_ns()
        for name in self._parts.topics:
            rows, report = kept.get(name), self.health.report
            if not rows:
                continue
            silent_s = (now_ns - rows[-1].received_ns) / 1e9
            level = HealthLevel.ERROR if name == self._lidar else HealthLevel.WARN
            faults = []
            if silent_s >= max(_SILENT_S, _SILENT_PERIODS * _period_s(rows)):
                report(name, _SILENT, f"nothing for {silent_s:.1f} s", level)
                faults.append(_SILENT)
            jump = self._receiver.jumps.get(name)
            if jump is not None and now_ns - jump.received_ns < _JUMP_SHOWN_S * 1e9:
                report(name, _JUMP, f"by {jump.step_ns / 1e9:+.3f} s")
                faults.append(_JUMP)
            others = None if name == self._lidar else kept[self._lidar]
            if shift_ns := _shift_ns(rows, others):
                clock = "this computer's clock" if others is None else "the clock of the scans"
                report(name, _CLOCK, f"stamps are {-shift_ns / 1e9:+.1f} s from {clock}")
                faults.append(_CLOCK)
            self.health.clear([name], *({_SILENT, _JUMP, _CLOCK} - {*faults}))

    def _frame(self, scan: RawMessage) -> Frame | None:
        """Return the frame of a scan, or None where stamps have jumped since it came, so that it is no longer kept."""
        parts, recent = self._parts, self._recent()
        if not any(one is scan for one in recent.messages((self._lidar,))):
            return None
        parts.opening.move_to(recent)
        drive = parts.cameras.joined(parts.opening.joined(parts.drive), recent)
        row = int(np.searchsorted(drive.stamps_ns, stamp_ns(scan)))
        frame = self._readable(drive, row)
        index, stamp_s = self._count, (stamp_ns(scan) - self.origin_ns) / 1e9
        self._count += 1
        return replace(frame, index=index, number=index, name=f"{index:06d}", stamp_s=stamp_s)

    def _readable(self, drive: BagDrive, row: int) -> Frame:
        """Return a frame, without poses or without further LiDARs where their messages are damaged."""
        topics, sweeps = self._parts.opening.topics, drive.sweeps
        alone = SweepReader(sweeps.lidars[:1], sweeps.rows[:, :1])
        attempts = [
            (topics.odometry or topics.fixes, replace(drive, poses=None)),
            (topics.lidars[-1], replace(drive, sweeps=alone)),
        ]
        try:
            frame = drive[row]
        except PerceptionError as error:
            for topic, rest in attempts:
                try:
                    frame = rest[row]
                except PerceptionError:
                    continue
                self.health.report(str(topic), _SKIPPED, str(error))
                return frame
            raise
        self.health.clear(self._parts.topics, _SKIPPED)
        return frame


def _topics_in(names: str | None) -> dict[str, str]:
    """Return names as they were given by topic."""
    given = [name.strip() for name in (names or "").split(",")]
    return {f"/{name.strip('/')}": name for name in given if name}


def _frame_id(opening: BagOpening) -> str:
    """Return the frame of reference of the scans."""
    scan = opening.streams[opening.topics.lidars[0]].read(0)
    return str(scan.header.frame_id).lstrip("/")


def _period_s(rows: list[RawMessage]) -> float:
    """Return the usual time between two messages; 0 of one."""
    received_ns = [one.received_ns for one in rows[-_NEWEST:]]
    return float(np.median(np.diff(received_ns))) / 1e9 if len(rows) > 1 else 0.0


def _shift_ns(rows: list[RawMessage], others: list[RawMessage] | None) -> int:
    """Return what turns the stamps of a topic into those of others, or of this computer; 0 by the same clock."""
    newest = rows[-_NEWEST:]
    if others:
        # Of the same time: delays change where what plays a recording halts.
        others = others[-_NEWEST:]
        newest = [one for one in rows if one.received_ns >= others[0].received_ns] or newest
    shift_ns = _delay_ns(newest) - (_delay_ns(others) if others else 0)
    return shift_ns if abs(shift_ns) >= _OTHER_CLOCK_S * 1e9 else 0


def _delay_ns(rows: list[RawMessage]) -> int:
    delays_ns = sorted(one.received_ns - stamp_ns(one) for one in rows)
    return delays_ns[len(delays_ns) // 2] if delays_ns else 0


def _frames_of_reference(opening: BagOpening, drive: BagDrive) -> RosFrames:
    """Return the frames of the robot by its transforms."""
    poses, tree, lidar = opening.topics, opening.tree, _frame_id(opening)
    lidar_SE3_velo = opening.lidar_SE3_velo(lidar)
    base = tree.root_of(lidar, _FIXED_TO_EARTH)
    base_SE3_lidar = tree.require(base, lidar, "to publish the pose of the vehicle")
    base_SE3_velo = base_SE3_lidar @ lidar_SE3_velo
    is_turned = not np.array_equal(lidar_SE3_velo, np.eye(4))
    own = f"{lidar}_aligned" if is_turned else lidar
    world = _ODOM if drive.poses is None else _MAP
    if poses.odometry is not None and drive.poses is not None:
        world = str(opening.streams[poses.odometry].read(0).header.frame_id) or _ODOM
    return RosFrames(
        world=world,
        lidar=own,
        base=base,
        base_SE3_velo=base_SE3_velo,
        # Odometry begins with the base, not the LiDAR, at the origin.
        world_SE3_drive=base_SE3_velo if drive.poses is None else np.eye(4),
        has_pose_transform=not tree.has_parent(base),
        static={(lidar, own): lidar_SE3_velo} if is_turned else {},
    )
