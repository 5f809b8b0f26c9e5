"""Detections of a frame that are located in its scan as by `trifuse run`, without a memory of earlier frames."""

from dataclasses import dataclass

import numpy as np

from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.detector_fusion import DetectionFusion
from perception.detection.vehicles.locate import locate
from perception.evaluation.detection.box_rows import LocatedDetections
from perception.evaluation.detection.fusion_measure import LocatedScene
from perception.localization.scan_window import PosedScan, ScanWindow
from perception.maps.projection import camera_of
from perception.obstacles.ground import ground_estimator
from perception.pipeline import PipelineConfig
from perception.sensor import LidarModel
from perception.types import Frame, GroundModel


@dataclass(frozen=True)
class SceneLocator:
    """Fuses the detections of single frames and fits their 3D boxes to the scan and the ground.

    Attributes:
        fusion: Fusion of the modalities.
        sensor: LiDAR model of the scans.
        config: Pipeline configuration.
    """

    fusion: DetectionFusion
    sensor: LidarModel
    config: PipelineConfig

    def locate(self, scene: DetectedScene, frame: Frame) -> LocatedScene:
        """Return the detections of a frame with those of the fusion located in its scan."""
        fused = self.fusion.fuse(scene)
        vehicles = locate(fused, frame, self._ground(frame), self.config.vehicles)
        camera, _ = camera_of(frame)
        return LocatedScene(
            scene, LocatedDetections(vehicles.fused.detections, vehicles.boxes, camera)
        )

    def _ground(self, frame: Frame) -> GroundModel:
        """Return the ground of a drive that starts with this frame."""
        config, points_velo = self.config, frame.points_velo
        window = ScanWindow(previous_scans=0)
        window.push(PosedScan(points_velo[~config.ego_vehicle.contains_xy(points_velo)], np.eye(4)))
        method = config.method_of(config.ground)
        estimator = ground_estimator(config.ground, method, self.sensor, config.area, config.seed)
        return estimator.update(window)
