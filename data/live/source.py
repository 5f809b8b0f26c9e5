"""What a live source is, and a drive as one: its frames come at their own rate, whether anybody is ready or not."""

import logging
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count

from data.frames import clock_origin_ns, further_camera_names
from data.live.source_health import SourceHealth
from data.recorded_drive import RecordedDrive
from perception.errors import PerceptionError
from perception.sensor import LidarModel
from perception.types import Frame

log = logging.getLogger(__name__)

# Longer gaps between two scans are breaks of the recording, which nobody wants to wait for.
_MAX_GAP_S = 1.0


class LiveSource(ABC):
    """Frames that do not wait."""

    cameras: tuple[str, ...] = ()
    """Names of the further cameras."""

    def __init__(
        self,
        name: str,
        sensor: LidarModel,
        *,
        is_sequence: bool,
        origin_ns: int = 0,
        health: SourceHealth | None = None,
    ) -> None:
        """Keep what viewers and the pipeline need.

        Args:
            name: Name for viewers.
            sensor: LiDAR model of the scans.
            is_sequence: Whether frames follow each other in time.
            origin_ns: Time in nanoseconds since 1970 at which stamps are 0.
            health: What has been found wrong with the source so far.
        """
        self.name, self.sensor, self.is_sequence = name, sensor, is_sequence
        self.origin_ns = origin_ns
        self.dropped = 0
        """Number of frames that were left out, as they came too late."""
        self.health = health or SourceHealth()
        self.on_silence: Callable[[], None] = lambda: None
        """Called now and then while no scan comes."""

    @abstractmethod
    def laps(self) -> Iterator[Iterator[Frame]]:
        """Yield frames that follow each other; where another lap begins, all before is forgotten."""

    def recovers_from(self, error: PerceptionError) -> bool:
        """Return whether another lap begins after an error of the pipeline, rather than the end."""
        return False

    @abstractmethod
    def close(self) -> None:
        """Stop; an iterator that waits ends."""


class PacedDrive(LiveSource):
    """A drive whose frames come at the times of their stamps; those whose time is over are not read."""

    def __init__(
        self, drive: RecordedDrive, *, rate: float = 1.0, is_endless: bool = False
    ) -> None:
        """Read nothing yet.

        Args:
            drive: Drive.
            rate: Speed of time, 2 for twice as fast.
            is_endless: Whether the drive begins again at its end; stamps go on rising then.
        """
        super().__init__(
            drive.name,
            drive.sensor,
            is_sequence=drive.is_sequence,
            origin_ns=clock_origin_ns(drive),
        )
        self.cameras = further_camera_names(drive)
        self._drive, self._rate, self._is_endless = drive, rate, is_endless
        self._closed = threading.Event()

    def laps(self) -> Iterator[Iterator[Frame]]:
        """Yield the frames of the drive, once or again and again."""
        offset_s = 0.0
        for lap in count():
            if lap and not (self._is_endless and not self._closed.is_set()):
                return
            yield self._frames(offset_s)
            last = len(self._drive) - 1
            offset_s += self._drive.stamp_s(last) - self._drive.stamp_s(0)
            offset_s += 1 / self.sensor.rate_hz

    def close(self) -> None:
        """End the lap."""
        self._closed.set()

    def _frames(self, offset_s: float) -> Iterator[Frame]:
        due_s = time.perf_counter()
        for index in range(len(self._drive)):
            due_s += self._gap_s(index) / self._rate if index else 0.0
            next_s = due_s + self._gap_s(index + 1) / self._rate
            if self._closed.is_set():
                return
            if next_s < time.perf_counter():
                self.dropped += 1
                continue
            try:
                frame = self._drive[index]
            except PerceptionError as error:
                log.warning("skipped frame %d: %s", index, error)
                continue
            self._closed.wait(max(due_s - time.perf_counter(), 0))
            yield replace(frame, stamp_s=frame.stamp_s + offset_s) if offset_s else frame

    def _gap_s(self, index: int) -> float:
        """Return the time between a frame and the one before it."""
        period_s = 1 / self.sensor.rate_hz
        if index >= len(self._drive):
            return period_s
        gap_s = self._drive.stamp_s(index) - self._drive.stamp_s(index - 1)
        return gap_s if 0 < gap_s <= _MAX_GAP_S else period_s
