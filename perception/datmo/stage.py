"""The DATMO stage: a detector of moving objects, and a tracker behind it."""

from typing import Literal

from perception.datmo.detector import ObjectDetector, SegmentedScan
from perception.geometry.grids import LocalArea
from perception.sensor import LidarModel
from perception.tracking.tracker import MultiObjectTracker
from perception.types import Tracks

DatmoMethod = Literal["default", "thesis", "author", "none"]


class Datmo:
    """Detects and tracks moving objects, scan after scan."""

    def __init__(self, detector: ObjectDetector, tracker: MultiObjectTracker) -> None:
        self._detector, self._tracker = detector, tracker

    def update(self, scan: SegmentedScan) -> Tracks:
        """Return every confirmed track at the moment of the scan."""
        if scan.is_reset:
            self._tracker.end_all()
        found = self._detector.detect(scan)
        return self._tracker.update(scan.stamp_s, scan.world_SE3_velo, found.moving, found.standing)


def datmo_stage(method: DatmoMethod, sensor: LidarModel, area: LocalArea) -> Datmo | None:
    """Make the stage of a method with its default values, or none."""
    return None
