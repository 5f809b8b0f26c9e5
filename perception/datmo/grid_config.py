"""The values of the thesis' grid detector, as its Table 7.4 and as the author's released code have them."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from perception.datmo.elevation import ElevationGridConfig
from perception.datmo.grid_objects import GridObjectsConfig
from perception.datmo.short_term_map import ShortTermMapConfig
from perception.errors import UsageError
from perception.geometry.grids import MOVING_OBJECT_AREA, LocalArea

# Over what heights are measured: thesis and author know the LiDAR's mounting height alone; the ground
# that the stage before has found follows hills and pitch.
HeightReference = Literal["level plane", "ground"]


@dataclass(frozen=True)
class MotionGridConfig:
    """When a cell moves.

    Attributes:
        alpha: α, by which share of its height a cell may differ from the map.
        radius_cells: ε, how far the map is searched for its like.
        max_height_m: higher cells are left out: crowns of trees, signs, bridges.
    """

    alpha: float
    radius_cells: int
    max_height_m: float


@dataclass(frozen=True)
class MotionGridDetectorConfig:
    """Every value of the detector.

    Attributes:
        area: where objects are wanted.
        work_area: over which the grids are kept, so that the map knows a place before it enters `area`.
        cell_m: υ, edge of a cell.
        height_reference: over what heights are measured.
        elevation: of the elevation grid (5.6).
        background: of the short-term map (Algorithm 4).
        motion: of the motion grid (5.7)-(5.8).
        objects: of the things (5.9).
    """

    area: LocalArea
    work_area: LocalArea
    cell_m: float
    height_reference: HeightReference
    elevation: ElevationGridConfig
    background: ShortTermMapConfig
    motion: MotionGridConfig
    objects: GridObjectsConfig = field(default_factory=GridObjectsConfig)

    def __post_init__(self) -> None:
        """Refuse an area that the grids do not cover by whole cells."""
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


# On which the author's code works. The heights of a `LocalArea` are not asked here; `ElevationGridConfig` says
# which points count.
_WORK_AREA = LocalArea(ahead_m=40.0, behind_m=20.0, side_m=12.0)

THESIS = MotionGridDetectorConfig(
    area=MOVING_OBJECT_AREA,
    work_area=_WORK_AREA,  # from the code: 5.2.2 says only what is kept
    cell_m=0.2,  # υ = 20 (Table 7.4), "20 cm" in the text
    height_reference="level plane",  # code
    elevation=ElevationGridConfig(
        # Table 7.4 prints T_σ = 2 and T_μ = 30 without units. Read as 0.02 m², which the code has too,
        # and as 30 cm, in the centimetres of its υ = 20.
        ground_variance_m2=0.02,
        ground_height_m=0.30,
        ground_statistic="mean",  # (5.6)
        low_m=-1.0,  # code
        high_m=2.5,  # code
        min_range_m=3.0,  # code
    ),
    # n, m, k: Table 7.4; the newest grid joins before the mean is taken: Algorithm 4.
    background=ShortTermMapConfig(
        scans=50, max_observations=30, min_observations=3, includes_newest=True
    ),
    motion=MotionGridConfig(
        alpha=0.2,  # Table 7.4
        radius_cells=5,  # Table 7.4
        max_height_m=2.0,  # code
    ),
)
"""The values of the thesis: Table 7.4, and the author's code where it is silent."""

AUTHOR = MotionGridDetectorConfig(
    area=MOVING_OBJECT_AREA,
    work_area=_WORK_AREA,
    cell_m=0.2,
    height_reference="level plane",
    elevation=ElevationGridConfig(
        ground_variance_m2=0.02,
        ground_height_m=0.8,
        ground_statistic="max",
        low_m=-1.0,
        high_m=2.5,
        min_range_m=3.0,
    ),
    background=ShortTermMapConfig(
        scans=90, max_observations=60, min_observations=5, includes_newest=True
    ),
    motion=MotionGridConfig(alpha=0.3, radius_cells=10, max_height_m=2.0),
)
"""The values of the author's released code throughout."""
