"""Interface of the static-moving segmentation: what both methods do, in the two steps that are timed."""

from abc import ABC, abstractmethod
from typing import Generic, TypeVar

from perception.localization.scan_window import ScanWindow
from perception.types import GroundModel, Obstacles

Voxelized = TypeVar("Voxelized")
"""What a method knows of the obstacle points and their voxels."""


class MotionSegmenter(ABC, Generic[Voxelized]):
    """Segments static and moving obstacles, scan after scan."""

    @abstractmethod
    def voxelize(self, window: ScanWindow, ground: GroundModel) -> Voxelized:
        """Separate the obstacles from the ground and put them into voxels; call `segment` with what this returns.

        Args:
            window: Scans with their poses, the newest last; a window of one scan starts a new drive.
            ground: Ground surface in the frame of the newest scan.
        """

    @abstractmethod
    def segment(self, voxelized: Voxelized) -> Obstacles:
        """Return the static and moving obstacles of the newest scan."""

    def update(self, window: ScanWindow, ground: GroundModel) -> Obstacles:
        """Segment the newest scan of the window; the ground is in its frame."""
        return self.segment(self.voxelize(window, ground))
