"""Monitors of the LiDAR: scans lost, repeated or full of scattered returns, sectors and beams that are gone.

Shares are learned over the drive, as streets, fields and tunnels differ, and a fault is what is gone at once: within
some frames, while the beams or the sectors beside it go on.
"""

from collections.abc import Sequence

import numpy as np

from perception.health.scan_statistics import COLUMNS, SECTORS, ScanMeter, ScanStatistics
from perception.types import LIDAR, Bool, Float32, Float64, Frame, HealthFinding, HealthLevel

_LEARNING_FRAMES = 5
_NEWEST = 0.1
# Share of the directions with a return, from which a sector or a beam is watched, and share of it below which it is lost.
# Other beams fall into the row of a beam now and then where the model's elevations are not quite the sensor's.
_MIN_LEARNED, _MIN_LEARNED_BEAM = 0.3, 0.55
_MAX_LOST, _MAX_LOST_BEAM = 0.1, 0.4
_MIN_ALIVE = 0.7  # of the beams beside a lost one
_BESIDE = 6  # beams to each side
_LOST_FRAMES = 3
_MIN_LOST_SECTORS = 2
# Scattered returns: a share of all directions, and how many times more than usual.
_MIN_ALONE, _MIN_ALONE_AT_START, _MIN_ALONE_RATIO = 0.02, 0.05, 4.0
_SCATTERED_FRAMES = 3
_SAMPLE_STEP = 101


class LidarMonitors:
    """All monitors of the contents of scans; `ScanTimeMonitor` is that of their times."""

    def __init__(self, meter: ScanMeter) -> None:
        self._meter = meter
        self._repeated = _RepeatedScan()
        self._share = _Learned()
        self._lost = (_LostSectors(), _LostBeams())
        self._scatter = _ScatteredReturns()

    def update(self, frame: Frame) -> Sequence[HealthFinding]:
        """Return the findings of a frame."""
        repeated = self._repeated.update(frame.points_velo)
        if repeated is not None:
            return [repeated]
        scan = self._meter.measure(frame.points_velo)
        usual = self._share.values
        if self._share.is_known and scan.returns < _MAX_LOST * float(usual[0]):
            reason = (
                f"returns in {scan.returns:.1%} of all directions, expected {float(usual[0]):.0%}"
            )
            return [HealthFinding(LIDAR, HealthLevel.ERROR, "scan lost", reason)]
        self._share.learn(np.array([scan.returns]))
        found = [monitor.update(scan) for monitor in (*self._lost, self._scatter)]
        return [one for one in found if one is not None]


class _Learned:
    """What values usually are, learned over a drive from the frames in which they are as usual."""

    def __init__(self) -> None:
        self._frames = 0
        self.values: Float64 = np.zeros(1)

    @property
    def is_known(self) -> bool:
        """Whether enough frames have been seen."""
        return self._frames >= _LEARNING_FRAMES

    def learn(self, values: Float64, is_usual: Bool | None = None) -> None:
        """Take over the values of a frame, of the entries that are as usual."""
        if self._frames == 0:
            self.values = np.asarray(values, np.float64).copy()
        step = max(_NEWEST, 1 / (self._frames + 1)) * (values - self.values)
        self.values = self.values + (step if is_usual is None else np.where(is_usual, step, 0))
        self._frames += 1


class _RepeatedScan:
    """Finds a scan with the points of the one before: of a scene that stands still, noise differs."""

    def __init__(self) -> None:
        self._points, self._sample = 0, np.empty((0, 4), np.float32)

    def update(self, points_velo: Float32) -> HealthFinding | None:
        """Return the finding of a scan."""
        points, sample = len(points_velo), points_velo[::_SAMPLE_STEP].copy()
        is_repeated = points == self._points and np.array_equal(sample, self._sample)
        self._points, self._sample = points, sample
        if not is_repeated:
            return None
        reason = f"all {points} points are those of the scan before"
        return HealthFinding(LIDAR, HealthLevel.ERROR, "scan repeated", reason)


class _LostSectors:
    """Finds sectors without returns from the road, as behind a covered part of the housing."""

    def __init__(self) -> None:
        self._usual = _Learned()
        self._lasts = np.zeros(SECTORS)

    def update(self, scan: ScanStatistics) -> HealthFinding | None:
        """Return the finding of a scan."""
        usual = self._usual
        is_lost = np.zeros(SECTORS, bool)
        if usual.is_known:
            is_watched = usual.values >= _MIN_LEARNED
            is_lost = is_watched & (scan.sectors < _MAX_LOST * usual.values)
        usual.learn(scan.sectors, ~is_lost)
        self._lasts = np.where(is_lost, self._lasts + 1, 0)
        lost = self._lasts >= _LOST_FRAMES
        if not lost.any():
            return None
        lost &= np.roll(lost, 1) | np.roll(lost, -1)
        count = int(np.count_nonzero(lost))
        if count < _MIN_LOST_SECTORS:
            return None
        width_deg = 360 // SECTORS
        # Sectors turn from ahead to the left.
        first = int(np.flatnonzero(lost & ~np.roll(lost, 1))[0]) if count < SECTORS else 0
        reason = (
            f"no returns in {count * width_deg} degrees from {first * width_deg} degrees left of ahead on, "
            "which had returns before"
        )
        return HealthFinding(LIDAR, HealthLevel.WARN, "sector lost", reason)


class _LostBeams:
    """Finds beams without returns between beams that have them."""

    def __init__(self) -> None:
        self._usual = _Learned()
        self._lasts: Float64 | None = None

    def update(self, scan: ScanStatistics) -> HealthFinding | None:
        """Return the finding of a scan."""
        usual = self._usual
        is_lost: Bool = np.zeros(len(scan.beams), bool)
        if usual.is_known:
            ratio = scan.beams / np.maximum(usual.values, 1 / COLUMNS)
            is_watched = usual.values >= _MIN_LEARNED_BEAM
            is_lost = is_watched & (ratio < _MAX_LOST_BEAM)
            if is_lost.any():
                is_lost &= _is_between(is_watched & (ratio >= _MIN_ALIVE))
        usual.learn(scan.beams, ~is_lost)
        lasts = np.zeros(len(scan.beams)) if self._lasts is None else self._lasts
        self._lasts = np.where(is_lost, lasts + 1, 0)
        beams = np.flatnonzero(self._lasts >= _LOST_FRAMES)
        if len(beams) == 0:
            return None
        reason = (
            f"beams {', '.join(str(beam + 1) for beam in beams[:8])}{' ...' if len(beams) > 8 else ''} of "
            f"{len(scan.beams)} from above have lost their returns, those beside them have not"
        )
        return HealthFinding(LIDAR, HealthLevel.WARN, "beams lost", reason)


def _is_between(is_alive: Bool) -> Bool:
    """Return which beams have one that is alive above and one below, within some beams."""
    above, below = np.zeros_like(is_alive), np.zeros_like(is_alive)
    for step in range(1, min(_BESIDE, len(is_alive) - 1) + 1):
        above[step:] |= is_alive[:-step]
        below[:-step] |= is_alive[step:]
    between: Bool = above & below
    return between


class _ScatteredReturns:
    """Finds returns in the air, of fog, rain, spray or dust: near, and with nothing beside them."""

    def __init__(self) -> None:
        self._usual = _Learned()
        self._lasts = 0

    def update(self, scan: ScanStatistics) -> HealthFinding | None:
        """Return the finding of a scan."""
        usual = float(self._usual.values[0])
        limit = max(_MIN_ALONE, _MIN_ALONE_RATIO * usual)
        if not self._usual.is_known:
            limit = _MIN_ALONE_AT_START
        if scan.alone < limit:
            self._usual.learn(np.array([scan.alone]))
            self._lasts = 0
            return None
        self._lasts += 1
        # Poles and people that pass near look like it in one scan or two, to few beams.
        if self._lasts < _SCATTERED_FRAMES:
            return None
        reason = (
            f"{scan.alone:.1%} of all directions end at near returns with nothing beside them, "
            f"expected {usual:.1%}, as in fog, rain or spray"
        )
        return HealthFinding(LIDAR, HealthLevel.WARN, "scattered returns", reason)
