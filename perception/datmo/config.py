"""Configuration of DATMO, the detection and tracking of moving objects (thesis 5.2, Table 7.4)."""

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from perception.errors import UsageError
from perception.geometry.grids import MOVING_OBJECT_AREA, LocalArea
from perception.tracking.config import BoxTrackerConfig, PointTrackerConfig

DatmoMethod = Literal["default", "thesis", "author", "none"]

# The thesis compares the mean height of a cell with T_μ (5.6), the author's code the highest point.
HeightStatistic = Literal["mean", "max"]

# Thesis and author know the mounting height of the LiDAR alone; the estimated ground follows hills and pitch.
HeightReference = Literal["level plane", "ground"]

# The area that the author's code works on. Heights of areas are not used here: which points count is said where the
# elevation grid is built.
_WORK_AREA = LocalArea(ahead_m=40.0, behind_m=20.0, side_m=12.0)


@dataclass(frozen=True)
class MotionGridOverrides:
    """Grid detector of the thesis (5.2): its parameters; None for the value of the thesis or of the author, as the method is.

    Attributes:
        cell_m: Edge of a cell in metres (υ, Table 7.4).
        height_reference: Surface that heights are measured from: a level plane below the LiDAR, or the estimated ground.
        ground_variance_m2: Largest variance of heights in m² of a ground cell (T_σ, Table 7.4).
        ground_height_m: Largest height in metres of a ground cell (T_μ, Table 7.4: 0.3; author: 0.8).
        scans: Number of elevation grids in the queue of the short-term map (n, Table 7.4: 50; author: 90).
        max_observations: Largest number of observations of a cell that are averaged, the latest (m, Table 7.4: 30;
            author: 60).
        min_observations: Smallest number of observations of a cell that has a value (k, Table 7.4: 3; author: 5).
        alpha: Share of its height by which a cell may differ from the map (α, Table 7.4: 0.2; author: 0.3).
        radius_cells: Radius in cells in which the map is searched for a similar height (ε, Table 7.4: 5; author: 10).
        min_area_m2: Smallest area of an object in m².
        max_area_m2: Largest area of an object in m².
        area: Area of reported objects and tracks in the LiDAR frame (5.2.2: 10 m behind, 30 m ahead, 10 m to each side).
        work_area: Area of the grids; larger, so that the map knows a place before it enters `area`.
    """

    cell_m: float = 0.2
    height_reference: HeightReference = "level plane"
    ground_variance_m2: float = 0.02
    ground_height_m: float | None = None
    scans: int | None = None
    max_observations: int | None = None
    min_observations: int | None = None
    alpha: float | None = None
    radius_cells: int | None = None
    min_area_m2: float = 1.2
    max_area_m2: float = 15.0
    area: LocalArea = MOVING_OBJECT_AREA
    work_area: LocalArea = _WORK_AREA

    def over(self, config: "MotionGridConfig") -> "MotionGridConfig":
        """Return a configuration with the values that are given."""
        given = {name: value for name, value in vars(self).items() if value is not None}
        return replace(config, **given)


@dataclass(frozen=True)
class MotionGridConfig(MotionGridOverrides):
    """All parameters of the grid detector, by default those of Table 7.4.

    Attributes:
        ground_statistic: Height of a cell that is compared with T_μ.
    """

    # Table 7.4 prints υ = 20, T_σ = 2 and T_μ = 30 without units: read as 20 cm ("20 cm" in the text), 0.02 m² (as in
    # the author's code) and 30 cm. Where it is silent, the values are those of the author's code.
    ground_height_m: float = 0.30
    scans: int = 50
    max_observations: int = 30
    min_observations: int = 3
    alpha: float = 0.2
    radius_cells: int = 5
    ground_statistic: HeightStatistic = "mean"

    def __post_init__(self) -> None:
        """Validate that the queue can fill a cell, and that the grids cover the area by whole cells."""
        if not 1 <= self.min_observations <= min(self.max_observations, self.scans):
            raise UsageError(
                "short-term map",
                expected="1 <= min_observations <= max_observations and min_observations <= scans",
                found=f"min_observations {self.min_observations}, "
                f"max_observations {self.max_observations}, scans {self.scans}",
            )
        margins_m = np.array(
            [
                self.work_area.behind_m - self.area.behind_m,
                self.work_area.ahead_m - self.area.ahead_m,
                self.work_area.side_m - self.area.side_m,
            ]
        )
        cells = margins_m / self.cell_m
        if (margins_m < 0).any() or not np.allclose(cells, np.round(cells)):
            raise UsageError(
                "work area",
                expected=f"the area of objects and a margin of whole cells of {self.cell_m} m",
                found=f"margins of {margins_m} m behind, ahead and aside",
            )


THESIS = MotionGridConfig()
"""Values of Table 7.4."""

AUTHOR = MotionGridConfig(
    ground_height_m=0.8,
    scans=90,
    max_observations=60,
    min_observations=5,
    alpha=0.3,
    radius_cells=10,
    ground_statistic="max",
)
"""Values of the author's released code."""


@dataclass(frozen=True)
class DatmoConfig:
    """Detection and tracking of moving objects.

    Attributes:
        method: Detector and tracker: `default`, those of the `thesis` (5.2) with the values of its Table 7.4 or with
            those of the `author`'s code, or `none`.
        box_tracker: Tracker of the default method.
        grids: Detector of the methods `thesis` and `author`.
        point_tracker: Tracker of the methods `thesis` and `author`.
    """

    method: DatmoMethod = "default"
    box_tracker: BoxTrackerConfig = field(default_factory=BoxTrackerConfig)
    grids: MotionGridOverrides = field(default_factory=MotionGridOverrides)
    point_tracker: PointTrackerConfig = field(default_factory=PointTrackerConfig)

    def __post_init__(self) -> None:
        """Validate the grids that the method has."""
        self.grids_of_method()

    def grids_of_method(self) -> MotionGridConfig:
        """Return all parameters of the grid detector."""
        return self.grids.over(AUTHOR if self.method == "author" else THESIS)
