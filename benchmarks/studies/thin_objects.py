"""Find a pole in a merged cloud, and measure how far its scans disagree on where it stands."""

from dataclasses import dataclass

import cv2
import numpy as np

from perception.errors import DriveError
from perception.geometry.grids import LocalArea
from perception.obstacles.dense_cloud import DenseCloud
from perception.types import Bool, Float32, Float64, GroundModel, UInt8

_CELL_M = 0.1
_LOWEST_M, _HIGHEST_M = 0.3, 2.0
_LEVEL_M = 0.1
# A pole fills half a metre across, and nothing else stands within a metre and a half.
_INNER_CELLS, _OUTER_CELLS = 5, 15
_MIN_LEVELS, _MIN_POINTS, _MIN_SHARE = 12, 60, 0.8


@dataclass(frozen=True)
class _Columns:
    """What stands in each column of the ground plane, (X, Y) each."""

    points: Float64
    levels: Float64
    scans: Float64


def find_pole(cloud: DenseCloud, ground: GroundModel, area: LocalArea) -> Float64:
    """Return (2,) x and y of the most isolated tall thin thing that every scan of the cloud saw.

    Raises:
        DriveError: there is none.
    """
    columns = _columns(cloud, ground, area)
    inner = cv2.boxFilter(columns.points, -1, (_INNER_CELLS,) * 2, normalize=False)
    outer = cv2.boxFilter(columns.points, -1, (_OUTER_CELLS,) * 2, normalize=False)
    is_observed = columns.scans >= int(cloud.age.max()) + 1
    is_pole = is_observed & (columns.levels >= _MIN_LEVELS) & (inner >= _MIN_POINTS)
    is_pole &= inner >= _MIN_SHARE * outer
    is_pole &= _is_uncropped(is_pole.shape)
    if not is_pole.any():
        raise DriveError(
            "study dense-cloud",
            expected="a pole near the vehicle in this frame",
            found="none",
            advice="name another --frame, or a place with --at",
        )
    # Of equally isolated cells, the one with most points is the pole's middle.
    score = np.where(is_pole, np.round(1 - inner / np.maximum(outer, 1), 2) - 1e-6 * inner, np.inf)
    cell = np.array(np.unravel_index(np.argmin(score), score.shape))
    return np.asarray((cell + 0.5) * _CELL_M - (area.behind_m, area.side_m))


def _is_uncropped(across: tuple[int, ...]) -> Bool:
    """Tell which cells are so far within the area that nothing around them was cropped."""
    whole = np.zeros(across, bool)
    whole[_OUTER_CELLS:-_OUTER_CELLS, _OUTER_CELLS:-_OUTER_CELLS] = True
    return whole


def _columns(cloud: DenseCloud, ground: GroundModel, area: LocalArea) -> _Columns:
    height_m = ground.distance_m(cloud.points_velo)
    rows = (height_m > _LOWEST_M) & (height_m < _HIGHEST_M)
    points, height_m, age = cloud.points_velo[rows], height_m[rows], cloud.age[rows]
    across = (
        int((area.behind_m + area.ahead_m) / _CELL_M) + 1,
        int(2 * area.side_m / _CELL_M) + 1,
    )
    x, y = ((points[:, :2] + (area.behind_m, area.side_m)) / _CELL_M).astype(int).T
    cell = x * across[1] + y
    count = np.bincount(cell, minlength=across[0] * across[1]).astype(np.float64)
    level = (height_m / _LEVEL_M).astype(int)
    return _Columns(
        points=count.reshape(across),
        levels=_distinct_values_around(cell, level, across),
        scans=_distinct_values_around(cell, age, across),
    )


def _distinct_values_around(
    cell: Float64, kind: Float64 | UInt8, across: tuple[int, int]
) -> Float64:
    """Count how many different kinds lie within the inner square around each cell."""
    total = np.zeros(across)
    for value in np.unique(kind):
        layer = np.zeros(across[0] * across[1], np.uint8)
        layer[cell[kind == value]] = 1
        total += cv2.dilate(layer.reshape(across), np.ones((_INNER_CELLS, _INNER_CELLS), np.uint8))
    return total


@dataclass(frozen=True)
class Cutout:
    """The points of a merged cloud around one place.

    Attributes:
        points_m: (P, 3) from the place on the ground below it.
        age: (P,) scans before the newest.
    """

    points_m: Float32
    age: UInt8

    @property
    def disagreement_m(self) -> float:
        """How far apart the scans see the object: RMS of their centres from the newest scan's."""
        centers = self._centers_m()
        return float(np.sqrt(np.mean(np.sum((centers[1:] - centers[0]) ** 2, axis=1))))

    def _centers_m(self) -> Float64:
        """Return (S, 2) the median position of each scan's points, the newest first."""
        ages = np.unique(self.age)
        return np.array([np.median(self.points_m[self.age == a, :2], axis=0) for a in ages])


def cut_out(
    cloud: DenseCloud, ground: GroundModel, place_m: Float64, radius_m: float = 0.5
) -> Cutout:
    """Take what stands within a radius of (2,) a place."""
    offset = cloud.points_velo[:, :2] - place_m
    height_m = ground.distance_m(cloud.points_velo)
    inside: Bool = (np.hypot(*offset.T) < radius_m) & (height_m > _LOWEST_M)
    inside &= height_m < _HIGHEST_M
    points = np.column_stack([offset, height_m])[inside]
    return Cutout(points.astype(np.float32), cloud.age[inside])
