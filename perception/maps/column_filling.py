"""Default filling: along the beams from return to return, between two beams along the column.

    o   o   o   .   o   o                  o  a return; its beam goes on in one of the columns to its right,
                            o   +          at most a row higher or lower
                                           .  a gap: between its two sides if they are one surface, else the closer side
                                           +  an end: goes on for a part of the way to the next beam

    row of a beam      o o . o o
                       | | | | |
                       . . . . .     between two rows: on the surface through both, if there can be one,
                       | | | | |     else the closer row
    row of a beam      o o o o o

Columns are about as wide as a beam's step, so that most of them hold a return of each beam. In inverse depth a plane
is linear in the rows of the image, so the road is filled as a plane. The LiDAR sees past an edge that hides it from
the camera: a return between two nearer ones of its column, as the teeth of two combs, is left out.
"""

from dataclasses import astuple, dataclass
from typing import cast

import numpy as np

from perception.kernels.map_filling import FillingNumbers, fill_beams, fill_between_beams
from perception.maps.filling import FilledMaps, first_rows
from perception.maps.projection import SparseMaps


@dataclass(frozen=True)
class ColumnFillingConfig:
    """Filling along beams and columns: what is one beam, and what is one surface.

    Attributes:
        column_width_px: Number of image columns that are filled as one, about the step of a beam.
        max_gap_px: Largest hole in pixels behind which a surface goes on.
        max_depth_ratio: Largest ratio of two inverse depths side by side on one surface.
        max_slope_per_m_px: Largest change of inverse depth (1/m) from row to row on one surface. A plane that passes
            the camera at d metres has 1 / (focal length * d): the default is one metre on KITTI.
        extension_ratio: Extension of a row past its end, as a share of the distance to the next beam.
    """

    column_width_px: int = 2
    max_gap_px: int = 16
    max_depth_ratio: float = 1.1
    max_slope_per_m_px: float = 1.4e-3
    extension_ratio: float = 0.25

    @property
    def max_steps(self) -> int:
        """Columns from a return to the next of its beam, at most."""
        return max(1, self.max_gap_px // self.column_width_px)


_CONFIG = ColumnFillingConfig()


def fill_columns(sparse: SparseMaps, config: ColumnFillingConfig = _CONFIG) -> FilledMaps:
    """Fill along rows, then along columns, below the highest returns; visible returns keep their values."""
    if not len(sparse):
        return FilledMaps.empty(sparse.size_px)
    width, height = sparse.size_px
    pixels = np.ascontiguousarray(sparse.pixels.T, np.int32)
    depths_m = np.ascontiguousarray(sparse.depth_m)
    bright = np.ascontiguousarray(sparse.reflectance)
    numbers = cast(FillingNumbers, astuple(config))
    top = int(pixels[1].min())
    beams = fill_beams(pixels, depths_m, bright, width, height, top, numbers)
    begins = np.arange(0, width, config.column_width_px)
    first = np.minimum.reduceat(first_rows(sparse), begins).astype(np.int64)
    depth_m, reflectance = fill_between_beams(beams, first, width, height, top, numbers)
    # Returns that the camera does not see are left out.
    at = depth_m.ravel()[sparse.flat_indices]
    seen = np.flatnonzero(sparse.depth_m <= config.max_depth_ratio * at)
    flat_indices = sparse.flat_indices[seen]
    depth_m.ravel()[flat_indices] = sparse.depth_m[seen]
    reflectance.ravel()[flat_indices] = sparse.reflectance[seen]
    return FilledMaps(depth_m, reflectance)
