"""Configuration of the pipeline: one section for each stage."""

from dataclasses import dataclass, field
from typing import Self

from perception.datmo.config import DatmoConfig, DatmoMethod
from perception.detection.config import NO_DETECTION, DetectionConfig
from perception.detection.vehicles.config import VehicleConfig
from perception.errors import UsageError
from perception.geometry.grids import (
    MOVING_OBJECT_AREA,
    SURROUNDINGS,
    AreaOverrides,
    EgoVehicle,
    LocalArea,
)
from perception.localization.config import RegistrationConfig
from perception.obstacles.config import GroundConfig, MotionConfig, OccupancyConfig
from perception.pipeline.skipped_stages import BEV_DETECTOR, DEPTHCN, SkippableStage
from perception.sensor import LidarModel
from perception.types import Method


@dataclass(frozen=True)
class PipelineConfig:
    """Configuration of the pipeline.

    Attributes:
        method: Method of registration, ground and static-moving segmentation, where the stage has none of its own.
        registration: Registration of scans.
        ground: Ground estimation.
        motion: Static-moving segmentation of the points above the ground.
        occupancy: Occupancy grid, where an output shows it.
        datmo: Detection and tracking of moving objects.
        detection: Detection of vehicles in frames with a camera.
        vehicles: Location of detected vehicles in the scan, and their tracks.
        budget_ms: Time from the arrival of a frame to its result in milliseconds, for live use: a frame that would
            be late skips some stages. None runs every stage.
        budget_skips: Stages that a late frame skips, in this order and as few as necessary; one of the detectors
            always runs.
        area: Area around the vehicle in which ground, obstacles and moving objects are found; by default 50 m all round,
            from 64 beams on and by the thesis' method 30 m ahead, 10 m behind and to each side.
        ego_vehicle: Outline of the vehicle itself; its returns are left out of every stage.
        seed: Seed of RANSAC.
        parallel: Whether independent stages run side by side, in two threads; the results are the same.
    """

    method: Method = "default"
    registration: RegistrationConfig = field(default_factory=RegistrationConfig)
    ground: GroundConfig = field(default_factory=GroundConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    occupancy: OccupancyConfig = field(default_factory=OccupancyConfig)
    datmo: DatmoConfig = field(default_factory=DatmoConfig)
    detection: DetectionConfig = field(default_factory=DetectionConfig)
    vehicles: VehicleConfig = field(default_factory=VehicleConfig)
    budget_ms: float | None = None
    budget_skips: tuple[SkippableStage, ...] = (DEPTHCN, BEV_DETECTOR)
    area: AreaOverrides = field(default_factory=AreaOverrides)
    ego_vehicle: EgoVehicle = field(default_factory=EgoVehicle)
    seed: int = 0
    parallel: bool = True

    def __post_init__(self) -> None:
        """Validate the budget."""
        if self.budget_ms is not None and not self.budget_ms > 0:
            raise UsageError("budget_ms", expected="a positive time", found=f"{self.budget_ms:g}")

    def method_of(self, stage: RegistrationConfig | GroundConfig | MotionConfig) -> Method:
        """Return the method of a stage: its own, else that of the pipeline."""
        return stage.method or self.method

    def area_of(self, sensor: LidarModel) -> LocalArea:
        """Return the area for the scans of a sensor: of dense ones, all around would take too long."""
        is_near = self.method == "thesis" or sensor.is_dense
        return self.area.over(MOVING_OBJECT_AREA if is_near else SURROUNDINGS)

    @classmethod
    def for_obstacles(cls, method: Method = "default", previous_scans: int = 6) -> Self:
        """Return the configuration of the thesis' study of obstacles (7.1.1): its area, and no objects."""
        return cls(
            method,
            motion=MotionConfig(previous_scans=previous_scans),
            datmo=DatmoConfig(method="none"),
            detection=NO_DETECTION,
            area=LocalArea(),
        )

    @classmethod
    def for_motion(cls, datmo: DatmoMethod = "default") -> Self:
        """Return the configuration that finds moving objects, without detectors of vehicles."""
        return cls(datmo=DatmoConfig(method=datmo), detection=NO_DETECTION)
