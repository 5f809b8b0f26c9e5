"""The DATMO stage: a detector of moving objects, and a tracker behind it."""

from typing import Literal

from perception.datmo import grid_config as grid_rules
from perception.datmo.detector import ObjectDetector, SegmentedScan
from perception.datmo.grid_detector import MotionGridDetector
from perception.datmo.point_detector import PointDetector
from perception.geometry.grids import LocalArea
from perception.sensor import LidarModel
from perception.tracking.box_tracker import BoxTracker
from perception.tracking.config import AUTHOR_POINT_TRACKER, THESIS_POINT_TRACKER
from perception.tracking.point_tracker import PointTracker
from perception.tracking.tracker import MultiObjectTracker
from perception.types import Tracks

DatmoMethod = Literal["default", "thesis", "author", "none"]


class Datmo:
    """Detects and tracks moving objects, scan after scan."""

    def __init__(
        self, detector: ObjectDetector, tracker: MultiObjectTracker, *, uses_ins_poses: bool = False
    ) -> None:
        """Begin without a scan.

        Args:
            detector: finds what moves in a scan.
            tracker: follows it.
            uses_ins_poses: whether tracks lie in the world of the INS, as in the thesis, or of refined poses.
        """
        self._detector, self._tracker, self._uses_ins_poses = detector, tracker, uses_ins_poses

    def update(self, scan: SegmentedScan) -> Tracks:
        """Return every confirmed track at the moment of the scan."""
        if scan.is_reset:
            self._tracker.clear()
        found = self._detector.detect(scan)
        pose = scan.ins_world_SE3_velo if self._uses_ins_poses else scan.world_SE3_velo
        return self._tracker.update(scan.stamp_s, pose, found.moving, found.static)


def datmo_stage(
    method: DatmoMethod, sensor: LidarModel, area: LocalArea | None = None
) -> Datmo | None:
    """Make the stage of a method with its default values; `none` is no stage.

    Args:
        method: `thesis` is 5.2 with the values of Table 7.4, `author` the same with those of the released
            program; their grids know their own area.
        sensor: whose scans will come.
        area: that the scans' points were segmented in; the default ends tracks that leave it.
    """
    if method == "thesis":
        detector = MotionGridDetector(sensor, grid_rules.THESIS)
        return Datmo(detector, PointTracker(THESIS_POINT_TRACKER), uses_ins_poses=True)
    if method == "author":
        detector = MotionGridDetector(sensor, grid_rules.AUTHOR)
        return Datmo(detector, PointTracker(AUTHOR_POINT_TRACKER), uses_ins_poses=True)
    if method == "default":
        return Datmo(PointDetector(sensor), BoxTracker(area))
    return None
