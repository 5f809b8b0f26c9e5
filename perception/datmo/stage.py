"""DATMO stage: a detector and a tracker of moving objects."""

from perception.datmo.config import DatmoConfig
from perception.datmo.detector import ObjectDetector, SegmentedScan
from perception.datmo.grid_detector import MotionGridDetector
from perception.datmo.point_detector import PointDetector
from perception.geometry.grids import LocalArea
from perception.sensor import LidarModel
from perception.tracking.box_tracker import BoxTracker
from perception.tracking.point_tracker import PointTracker
from perception.tracking.tracker import MultiObjectTracker
from perception.types import Tracks


class Datmo:
    """Detects and tracks moving objects, scan after scan."""

    def __init__(
        self, detector: ObjectDetector, tracker: MultiObjectTracker, *, uses_ins_poses: bool = False
    ) -> None:
        """Start without a scan.

        Args:
            detector: Detector of moving objects.
            tracker: Tracker of moving objects.
            uses_ins_poses: Whether tracks are in the world of the INS, as in the thesis, or of refined poses.
        """
        self._detector, self._tracker, self._uses_ins_poses = detector, tracker, uses_ins_poses

    def update(self, scan: SegmentedScan) -> Tracks:
        """Return every confirmed track at the moment of the scan."""
        if scan.is_reset:
            self._tracker.clear()
        found = self._detector.detect(scan)
        pose, covariance = scan.world_SE3_velo, scan.covariance
        if self._uses_ins_poses:
            pose, covariance = scan.ins_world_SE3_velo, None
        return self._tracker.update(scan.stamp_s, pose, found.moving, found.static, covariance)


def datmo_stage(
    config: DatmoConfig, sensor: LidarModel, area: LocalArea | None = None
) -> Datmo | None:
    """Make the stage of the configured method; `none` is no stage.

    Args:
        config: DATMO configuration.
        sensor: LiDAR model of the scans.
        area: Area in which the scans were segmented; the default method ends tracks that leave it, the grids have
            an area of their own.
    """
    if config.method == "none":
        return None
    if config.method == "default":
        return Datmo(PointDetector(sensor), BoxTracker(area, config.box_tracker))
    grids = config.grids_of_method()
    tracker = PointTracker(config.method, config.point_tracker, grids.area)
    return Datmo(MotionGridDetector(sensor, grids), tracker, uses_ins_poses=True)
