"""Health of a frame: what monitors find wrong with sensors and stages, and how bad it is."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, Self

LIDAR: Final = "lidar"
CAMERA: Final = "camera"
INS: Final = "ins"
CALIBRATION: Final = "calibration"  # of LiDAR and camera
# Sensors, and what ties two of them together; every other part is a stage of the pipeline.
SENSOR_PARTS: Final = (LIDAR, CAMERA, INS, CALIBRATION)


class HealthLevel(IntEnum):
    """How bad a finding is; the numbers are those of ROS' DiagnosticStatus."""

    OK = 0
    WARN = 1  # the part is used, with less trust
    ERROR = 2  # the part is not used in this frame


@dataclass(frozen=True)
class HealthFinding:
    """One fault of a sensor or of a stage in one frame.

    Attributes:
        part: Sensor (`SENSOR_PARTS`) or name of the stage.
        level: Level, WARN or ERROR.
        fault: Name of the fault, the same in every frame, such as "camera dark".
        reason: What was found, and what was expected, in one sentence.
    """

    part: str
    level: HealthLevel
    fault: str
    reason: str

    def __str__(self) -> str:
        """Return level, fault and reason in one line."""
        return f"{self.level.name} {self.fault}: {self.reason}"


@dataclass(frozen=True)
class Health:
    """Health of one frame: OK where nothing was found.

    Attributes:
        findings: Findings, the worst first.
    """

    findings: tuple[HealthFinding, ...] = ()

    @classmethod
    def of(cls, findings: Iterable[HealthFinding]) -> Self:
        """Return the health with these findings, the worst first, else in their order."""
        return cls(tuple(sorted(findings, key=lambda one: -one.level)))

    def joined(self, findings: Iterable[HealthFinding]) -> "Health":
        """Return this health with more findings."""
        return Health.of((*self.findings, *findings))

    @property
    def level(self) -> HealthLevel:
        """Level of the worst part."""
        return max((one.level for one in self.findings), default=HealthLevel.OK)

    @property
    def levels(self) -> dict[str, HealthLevel]:
        """Level of each part that has a finding."""
        # The worst finding of a part comes first, and so is entered last.
        return {one.part: one.level for one in reversed(self.findings)}

    def level_of(self, part: str) -> HealthLevel:
        """Return the level of a sensor or of a stage."""
        return self.levels.get(part, HealthLevel.OK)

    @property
    def faults(self) -> tuple[str, ...]:
        """Names of the faults, of the worst first."""
        return tuple(dict.fromkeys(one.fault for one in self.findings))

    def __str__(self) -> str:
        """Return the findings in one line; OK without any."""
        return "; ".join(map(str, self.findings)) or "OK"
