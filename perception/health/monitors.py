"""All monitors of LiDAR and INS."""

from perception.health.ins_monitor import InsMonitor
from perception.health.lidar_monitors import LidarMonitors
from perception.health.scan_statistics import ScanMeter
from perception.health.scan_times import LATE, OUT_OF_ORDER, SAME_TIME, TIME_JUMP, ScanTimeMonitor
from perception.types import LIDAR, Float64, Frame, Health, HealthFinding, HealthLevel


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
