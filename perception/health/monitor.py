"""Interfaces of monitors.

A monitor sees every frame of a drive in turn and remembers what it needs of the earlier ones; a new drive has new
monitors. It returns findings, none where all is well, and never raises. All monitors of a frame together take at most
3 ms.
"""

from collections.abc import Sequence
from typing import Protocol

from perception.types import Frame, HealthFinding, Result


class FrameMonitor(Protocol):
    """Monitor of a sensor, which runs before the stages: a part with an ERROR is not used in this frame."""

    def update(self, frame: Frame) -> Sequence[HealthFinding]:
        """Return the findings of a frame as it came from the sensors."""
        ...


class ResultMonitor(Protocol):
    """Monitor that compares the frame with what the stages made of it; its findings are of the same frame."""

    def update(self, frame: Frame, result: Result) -> Sequence[HealthFinding]:
        """Return the findings of a frame.

        Args:
            frame: Frame as it came from the sensors, with the parts that were not used.
            result: Result of the frame, whose `health` holds the findings so far.
        """
        ...
