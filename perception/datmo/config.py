"""Configuration of DATMO, the detection and tracking of moving objects (thesis 5.2, Table 7.4)."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from perception.errors import UsageError
from perception.geometry.grids import MOVING_OBJECT_AREA, LocalArea
from perception.tracking.config import (
    AUTHOR_POINT_TRACKER,
    THESIS_POINT_TRACKER,
    BoxTrackerConfig,
    PointTrackerConfig,
)

DatmoMethod = Literal["default", "thesis", "author", "none"]

# The thesis compares the mean height of a cell with T_μ (5.6), the author's code the highest point.
HeightStatistic = Literal["mean", "max"]

# Thesis and author know the mounting height of the LiDAR alone; the estimated ground follows hills and pitch.
HeightReference = Literal["level plane", "ground"]


@dataclass(frozen=True)
class ClusteringConfig:
    """Clustering of moving points over the ground plane.

    Attributes:
        cell_m: Edge of a cell in metres; its points are always in one cluster.
        lateral_gap_m: Largest gap in metres within a cluster, across the line of sight.
        min_depth_gap_m: Gap in metres always bridged along the line of sight, as from a bonnet to a windscreen.
        max_depth_gap_m: Largest gap in metres bridged along the line of sight, less than from one car to the next.
        min_surface_slope: Slope of the flattest surface that is bridged between two beams, as a ratio.
    """

    # 0.4 m are more than between a pedestrian's legs, and less than between two pedestrians side by side.
    cell_m: float = 0.15
    lateral_gap_m: float = 0.4
    min_depth_gap_m: float = 0.6
    max_depth_gap_m: float = 1.5
    min_surface_slope: float = 1 / 3


@dataclass(frozen=True)
class PointDetectorConfig:
    """Default detector: clusters of the points that the motion stage calls moving.

    Attributes:
        clustering: Clustering of moving points.
        min_points: Smallest number of points of a moving cluster.
        static_min_points: Smallest number of points of a static cluster.
        static_cell_m: Edge in metres of the cells in which static points are joined.
        static_max_length_m: Largest length in metres of a static cluster; a longer one is a wall or a hedge.
        max_attached_ratio: Largest share of a moving cluster's points that touch static points, 0 to 1.
        min_beams_across: Number of beams across a cluster from which on it may touch static points.
    """

    # What moves keeps clear of what is static; what comes to light between two beams of a parked car does not. In
    # drives with truth one in twenty moving clusters, and three in four false ones, touch with more than a tenth.
    # Between beams that are close together nothing comes to light by chance.
    clustering: ClusteringConfig = field(default_factory=ClusteringConfig)
    min_points: int = 3
    static_min_points: int = 5
    static_cell_m: float = 0.2
    static_max_length_m: float = 12.0
    max_attached_ratio: float = 0.4
    min_beams_across: float = 12.0


@dataclass(frozen=True)
class ElevationGridConfig:
    """Elevation grid (5.6).

    Attributes:
        ground_variance_m2: Largest variance of heights in m² of a ground cell (T_σ, Table 7.4).
        ground_height_m: Largest height in metres of a ground cell (T_μ, Table 7.4).
        ground_statistic: Height of a cell that is compared with T_μ.
        low_m: Lowest height in metres over the ground of a point that counts.
        high_m: Highest height in metres over the ground of a point that counts.
        min_range_m: Smallest horizontal distance in metres from the LiDAR of a point that counts.
    """

    ground_variance_m2: float
    ground_height_m: float
    ground_statistic: HeightStatistic
    low_m: float = -1.0
    high_m: float = 2.5
    min_range_m: float = 3.0


@dataclass(frozen=True)
class ShortTermMapConfig:
    """Short-term map (Algorithm 4).

    Attributes:
        scans: Number of elevation grids in the queue (n, Table 7.4).
        max_observations: Largest number of observations of a cell that are averaged, the latest (m, Table 7.4).
        min_observations: Smallest number of observations of a cell that has a value (k, Table 7.4).
        includes_newest: Whether the newest grid is averaged as well, as in Algorithm 4, or joins the queue afterwards.
    """

    scans: int
    max_observations: int
    min_observations: int
    includes_newest: bool = True

    def __post_init__(self) -> None:
        """Validate that the queue can fill a cell."""
        if not 1 <= self.min_observations <= min(self.max_observations, self.scans):
            raise UsageError(
                "short-term map",
                expected="1 <= min_observations <= max_observations and min_observations <= scans",
                found=f"min_observations {self.min_observations}, "
                f"max_observations {self.max_observations}, scans {self.scans}",
            )


@dataclass(frozen=True)
class MotionGridConfig:
    """Motion grid (5.7)-(5.8).

    Attributes:
        alpha: Share of its height by which a cell may differ from the map (α, Table 7.4).
        radius_cells: Radius in cells in which the map is searched for a similar height (ε, Table 7.4).
        max_height_m: Largest height in metres of a cell that may move; leaves out trees, signs and bridges.
    """

    alpha: float
    radius_cells: int
    max_height_m: float = 2.0


@dataclass(frozen=True)
class GridObjectsConfig:
    """Objects in the motion grid (5.9). Table 7.4 gives none of these values; they are those of the author's code.

    Attributes:
        long_cells: Long side in cells of the structuring elements s_x and s_y.
        short_cells: Short side in cells of the structuring elements.
        min_product_m2: Smallest product in m² of the two dilated heights of a cell in the core of an object.
        min_moving_area_m2: Smallest area in m² of the moving cells of an object.
        min_area_m2: Smallest area of an object in m².
        max_area_m2: Largest area of an object in m².
    """

    long_cells: int = 10
    short_cells: int = 2
    min_product_m2: float = 0.5
    min_moving_area_m2: float = 0.5
    min_area_m2: float = 1.2
    max_area_m2: float = 15.0


# The area that the author's code works on. The heights of a `LocalArea` are not used here: `ElevationGridConfig`
# says which points count.
_WORK_AREA = LocalArea(ahead_m=40.0, behind_m=20.0, side_m=12.0)


@dataclass(frozen=True)
class MotionGridDetectorConfig:
    """Grid detector of the thesis (5.2).

    Attributes:
        elevation: Elevation grid (5.6).
        background: Short-term map (Algorithm 4).
        motion: Motion grid (5.7)-(5.8).
        objects: Objects in the motion grid (5.9).
        cell_m: Edge of a cell in metres (υ, Table 7.4).
        height_reference: Surface that heights are measured from: a level plane below the LiDAR, or the estimated ground.
        area: Area of reported objects in the LiDAR frame (5.2.2).
        work_area: Area of the grids; larger, so that the map knows a place before it enters `area`.
    """

    elevation: ElevationGridConfig
    background: ShortTermMapConfig
    motion: MotionGridConfig
    objects: GridObjectsConfig = field(default_factory=GridObjectsConfig)
    cell_m: float = 0.2
    height_reference: HeightReference = "level plane"
    area: LocalArea = MOVING_OBJECT_AREA
    work_area: LocalArea = _WORK_AREA

    def __post_init__(self) -> None:
        """Validate that the grids cover the area by whole cells."""
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


# Table 7.4 prints υ = 20, T_σ = 2 and T_μ = 30 without units: read as 20 cm ("20 cm" in the text), 0.02 m² (as in
# the author's code) and 30 cm. Where it is silent, the values are those of the author's code.
THESIS = MotionGridDetectorConfig(
    ElevationGridConfig(ground_variance_m2=0.02, ground_height_m=0.30, ground_statistic="mean"),
    ShortTermMapConfig(scans=50, max_observations=30, min_observations=3),
    MotionGridConfig(alpha=0.2, radius_cells=5),
)
"""Values of Table 7.4."""

AUTHOR = MotionGridDetectorConfig(
    ElevationGridConfig(ground_variance_m2=0.02, ground_height_m=0.8, ground_statistic="max"),
    ShortTermMapConfig(scans=90, max_observations=60, min_observations=5),
    MotionGridConfig(alpha=0.3, radius_cells=10),
)
"""Values of the author's released code."""


@dataclass(frozen=True)
class DatmoConfig:
    """Detection and tracking of moving objects.

    Attributes:
        method: Detector and tracker: `default`, those of the `thesis` (5.2) with the values of its Table 7.4 or with
            those of the `author`'s code, or `none`.
        point_detector: Detector of the default method.
        box_tracker: Tracker of the default method.
        thesis: Detector of the method `thesis`.
        thesis_tracker: Tracker of the method `thesis`.
        author: Detector of the method `author`.
        author_tracker: Tracker of the method `author`.
    """

    method: DatmoMethod = "default"
    point_detector: PointDetectorConfig = field(default_factory=PointDetectorConfig)
    box_tracker: BoxTrackerConfig = field(default_factory=BoxTrackerConfig)
    thesis: MotionGridDetectorConfig = THESIS
    thesis_tracker: PointTrackerConfig = THESIS_POINT_TRACKER
    author: MotionGridDetectorConfig = AUTHOR
    author_tracker: PointTrackerConfig = AUTHOR_POINT_TRACKER
