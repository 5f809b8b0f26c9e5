"""All monitors of LiDAR and INS."""

from collections import deque
from collections.abc import Sequence
from statistics import median

from perception.health.ins_monitor import InsMonitor
from perception.health.lidar_monitors import LidarMonitors
from perception.health.scan_statistics import ScanMeter
from perception.types import LIDAR, Float64, Frame, Health, HealthFinding, HealthLevel

_MIN_STEPS = 3
_STEPS = 15  # of which the median is the usual one
_MAX_PERIODS = 1.6  # to the next scan; one that is missing makes 2
_JUMP_S, _JUMP_PERIODS = 1.0, 10.0  # no scan is so late
OUT_OF_ORDER, SAME_TIME = "scan out of order", "scan of the same time"
TIME_JUMP, LATE = "time jump", "scan late"


class ScanTimeMonitor:
    """Compares the stamp of each scan with that before, by the usual step of the drive."""

    def __init__(self) -> None:
        self._last_s: float | None = None
        self._rejected_s: float | None = None
        self._rejected = 0
        self._steps_s: deque[float] = deque(maxlen=_STEPS)

    def update(self, frame: Frame) -> Sequence[HealthFinding]:
        """Return the finding of a frame; after an ERROR it does not count as the last scan."""
        if self._last_s is None:
            self._last_s = frame.stamp_s
            return []
        step_s = frame.stamp_s - self._last_s
        if step_s == 0:
            reason = "the stamp is that of the scan before: its pose is repeated"
            return [HealthFinding(LIDAR, HealthLevel.WARN, SAME_TIME, reason)]
        if step_s < 0:
            return [self._not_rising(frame.stamp_s, step_s)]
        is_known = len(self._steps_s) >= _MIN_STEPS
        usual_s = median(self._steps_s) if self._steps_s else _JUMP_S
        expected_s = usual_s * (1 + self._rejected)
        self._last_s, self._rejected_s, self._rejected = frame.stamp_s, None, 0
        self._steps_s.append(step_s)
        is_jump = step_s > max(_JUMP_S, _JUMP_PERIODS * usual_s)
        is_late = is_known and step_s > (_MAX_PERIODS - 1) * usual_s + expected_s
        if not is_jump and not is_late:
            return []
        reason = f"{step_s:.3f} s after the scan before, expected {expected_s:.3f} s"
        return [HealthFinding(LIDAR, HealthLevel.WARN, TIME_JUMP if is_jump else LATE, reason)]

    def _not_rising(self, stamp_s: float, step_s: float) -> HealthFinding:
        """Return the finding of a stamp that is no later than the last: twice in a row, rising, the clock was set."""
        rejected_s, self._rejected_s = self._rejected_s, stamp_s
        if rejected_s is not None and stamp_s > rejected_s:
            self._last_s, self._rejected_s, self._rejected = stamp_s, None, 0
            reason = f"the clock was set back by {-step_s:.3f} s: the drive starts again here"
            return HealthFinding(LIDAR, HealthLevel.WARN, TIME_JUMP, reason)
        self._rejected += 1
        reason = f"{step_s:.3f} s after the scan before, expected a later stamp"
        return HealthFinding(LIDAR, HealthLevel.ERROR, OUT_OF_ORDER, reason)


class ScanAndInsMonitors:
    """The monitors of LiDAR and INS, before registration and after it."""

    def __init__(self, meter: ScanMeter) -> None:
        self._times, self._scans = ScanTimeMonitor(), LidarMonitors(meter)
        self._ins = InsMonitor()
        self._is_comparable = True

    def update(self, frame: Frame) -> Health:
        """Return the health of LiDAR and INS in a frame."""
        found: list[HealthFinding] = list(self._times.update(frame))
        if not any(one.fault in (OUT_OF_ORDER, SAME_TIME) for one in found):
            found += self._scans.update(frame)
        # Poses are compared over the time between scans, by the motion of scans.
        self._is_comparable = not any(
            one.level is HealthLevel.ERROR or one.fault in (TIME_JUMP, LATE, SAME_TIME)
            for one in found
        )
        if self._is_comparable:
            found += self._ins.update(frame)
        return Health.of(found)

    def register(self, frame: Frame, world_SE3_velo: Float64, *, is_reset: bool) -> None:
        """Remember the pose that a frame was given.

        Args:
            frame: Frame as it came from the sensors.
            world_SE3_velo: (4, 4) refined pose.
            is_reset: Whether earlier poses do not fit to it.
        """
        is_trusted = self._is_comparable and not is_reset
        self._ins.register(frame, world_SE3_velo, is_trusted=is_trusted)


def is_scan_usable(health: Health) -> bool:
    """Return whether the scan of a frame may be used."""
    return health.level_of(LIDAR) < HealthLevel.ERROR


def is_clock_set(health: Health) -> bool:
    """Return whether the stamps before a frame are of another time."""
    return any(one.fault == TIME_JUMP and "set back" in one.reason for one in health.findings)
