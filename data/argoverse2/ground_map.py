"""Height of the ground in the city, from the map of a log."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from data.kitti.reading import read_bytes, read_text
from perception.errors import LabelError
from perception.types import Bool, Float64

_HEIGHTS, _ALIGNMENT = "*_ground_height_surface____*.npy", "*___img_Sim2_city.json"
_NEAR_GROUND_M = (
    0.3  # the dataset's own: points up to this height over the surface, and all below, are ground
)


@dataclass(frozen=True)
class GroundMap:
    """Heights on a grid, NaN where they are not known.

    Attributes:
        heights_m: (H, W) height of the ground in the city; rows are y, columns x.
        grid_S_city: (2, 3) similarity from x and y in the city to column and row.
    """

    heights_m: Float64
    grid_S_city: Float64

    @classmethod
    def read(cls, folder: Path) -> Self | None:
        """Read the map of a log, or return None where it has none.

        Raises:
            LabelError: A file is damaged.
        """
        heights = sorted(folder.glob(_HEIGHTS))
        alignments = sorted(folder.glob(_ALIGNMENT))
        if not heights or not alignments:
            return None
        return cls(_read_heights(heights[0]), _read_similarity(alignments[0]))

    def is_ground(self, points_city: Float64) -> Bool:
        """Return which of (N, 3) points lie on the ground or below; none where its height is not known."""
        columns, rows = np.floor(
            self.grid_S_city[:, :2] @ points_city[:, :2].T + self.grid_S_city[:, 2:]
        )
        height, width = self.heights_m.shape
        is_known = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
        heights_m = np.full(len(points_city), np.nan)
        cells = rows[is_known].astype(np.int64), columns[is_known].astype(np.int64)
        heights_m[is_known] = self.heights_m[cells]
        with np.errstate(invalid="ignore"):
            return np.asarray(points_city[:, 2] - heights_m <= _NEAR_GROUND_M)


def _read_heights(path: Path) -> Float64:
    data = read_bytes(path, LabelError, "heights of the ground")
    try:
        from io import BytesIO

        heights = np.load(BytesIO(data), allow_pickle=False)
    except (ValueError, EOFError, OSError) as error:
        raise LabelError(path, expected="an array of heights", found=str(error)) from error
    if not isinstance(heights, np.ndarray) or heights.ndim != 2:
        raise LabelError(path, expected="one table of heights", found="something else")
    return heights.astype(np.float64)


def _read_similarity(path: Path) -> Float64:
    try:
        fields = json.loads(read_text(path, LabelError, "the place of the map in the city"))
        rotation = np.asarray(fields["R"], np.float64).reshape(2, 2)
        shift, scale = np.asarray(fields["t"], np.float64).reshape(2, 1), float(fields["s"])
    except (ValueError, KeyError, TypeError) as error:
        raise LabelError(
            path, expected="the rotation R, translation t and scale s of the map", found=repr(error)
        ) from error
    return np.hstack([rotation, shift]) * scale
