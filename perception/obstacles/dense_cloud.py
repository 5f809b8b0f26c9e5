"""The last few scans, each with its refined pose, and their union in the newest one's frame (5.1)."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from perception.types import Float32, Float64


@dataclass(frozen=True)
class PosedScan:
    """One scan and where it was taken.

    Attributes:
        points_velo: (N, 4) in the scan's own frame.
        world_SE3_velo: (4, 4) refined pose.
    """

    points_velo: Float32
    world_SE3_velo: Float64


class ScanWindow:
    """The newest scan and at most m before it, oldest first."""

    def __init__(self, previous_scans: int) -> None:
        self._scans: deque[PosedScan] = deque(maxlen=previous_scans + 1)

    def push(self, scan: PosedScan) -> None:
        """Add the newest scan; the oldest falls out of a full window."""
        self._scans.append(scan)

    def clear(self) -> None:
        """Forget all scans, as after a gap in the drive."""
        self._scans.clear()

    @property
    def newest(self) -> PosedScan:
        """The scan pushed last."""
        return self._scans[-1]

    def __len__(self) -> int:
        return len(self._scans)

    def __iter__(self) -> Iterator[PosedScan]:
        return iter(self._scans)
