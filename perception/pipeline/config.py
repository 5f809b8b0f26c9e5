"""Every choice of the pipeline, with its default."""

from dataclasses import dataclass, field
from typing import Self

from perception.datmo.stage import DatmoMethod
from perception.detection.config import NO_DETECTION, DetectionConfig
from perception.errors import UsageError
from perception.geometry.grids import MOVING_OBJECT_AREA, EgoVehicle, LocalArea
from perception.localization.registration import RegistrationConfig
from perception.types import Method


@dataclass(frozen=True)
class PipelineConfig:
    """Every choice of the pipeline, with its default.

    Attributes:
        method: our default for ground and obstacles, or the thesis' own.
        datmo: how moving objects are found and followed: our default, the thesis' grids with the values
            of its Table 7.4 or with those of the author's code, or not at all.
        detection: which detectors look at the frames that have a camera.
        previous_scans: m, how many scans before the newest are merged (Table 7.1).
        area: where ground, obstacles and moving objects are wanted.
        ego_vehicle: the vehicle's own outline; its returns are left out of every stage.
        registration: how scans are registered.
        seed: of the thesis' RANSAC.
        parallel: whether stages that do not wait for each other run side by side, on two workers and in
            two processes; what they find is the same.
    """

    method: Method = "default"
    datmo: DatmoMethod = "default"
    detection: DetectionConfig = field(default_factory=DetectionConfig)
    previous_scans: int = 6
    area: LocalArea = MOVING_OBJECT_AREA
    ego_vehicle: EgoVehicle = field(default_factory=EgoVehicle)
    registration: RegistrationConfig = field(default_factory=RegistrationConfig)
    seed: int = 0
    parallel: bool = True

    def __post_init__(self) -> None:
        """Refuse a window without history."""
        if self.previous_scans < 1:
            raise UsageError(
                "previous_scans", expected="at least 1", found=str(self.previous_scans)
            )

    @classmethod
    def for_obstacles(cls, method: Method = "default", previous_scans: int = 6) -> Self:
        """Return the choices of the thesis' study of obstacles (7.1.1): its area, and no objects."""
        return cls(
            method,
            datmo="none",
            detection=NO_DETECTION,
            previous_scans=previous_scans,
            area=LocalArea(),
        )

    @classmethod
    def for_motion(cls, datmo: DatmoMethod = "default") -> Self:
        """Return the choices for whoever asks what moves, and not what is seen to be a vehicle."""
        return cls(datmo=datmo, detection=NO_DETECTION)
