"""Sizes of the classes of road users: what is known of an object before its points are seen."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from perception.types import ArrayTable, Bool, Float64, Int


class Normal(NamedTuple):
    """A normal distribution in metres."""

    mean_m: float
    deviation_m: float


@dataclass(frozen=True)
class ClassSize:
    """Size of the objects of a class.

    Attributes:
        length: Length along the heading.
        width: Width across it.
        height: Height above the ground.
        has_sides: Whether the LiDAR sees flat sides; the returns of people lie around their middle instead.
    """

    length: Normal
    width: Normal
    height: Normal
    has_sides: bool = True


# Mean and standard deviation of the 7,481 labelled training frames of KITTI's object benchmark; of the classes that it does
# not have, means of nuScenes, and trailers are as high as buses. Trucks are KITTI's of 3.25 m and the light ones of nuScenes.
CLASS_SIZES: Mapping[str, ClassSize] = {
    "car": ClassSize(Normal(3.88, 0.43), Normal(1.63, 0.10), Normal(1.53, 0.14)),
    "van": ClassSize(Normal(5.08, 0.83), Normal(1.90, 0.17), Normal(2.21, 0.32)),
    "truck": ClassSize(Normal(10.11, 2.86), Normal(2.59, 0.22), Normal(2.90, 0.60)),
    "tram": ClassSize(Normal(16.09, 7.85), Normal(2.54, 0.22), Normal(3.53, 0.18)),
    "pedestrian": ClassSize(Normal(0.84, 0.23), Normal(0.66, 0.14), Normal(1.76, 0.11), False),
    "person_sitting": ClassSize(Normal(0.80, 0.22), Normal(0.59, 0.08), Normal(1.27, 0.11), False),
    "cyclist": ClassSize(Normal(1.76, 0.18), Normal(0.60, 0.12), Normal(1.74, 0.09), False),
    "bus": ClassSize(Normal(11.10, 2.0), Normal(2.90, 0.25), Normal(3.25, 0.45)),
    "trailer": ClassSize(Normal(12.28, 3.0), Normal(2.92, 0.3), Normal(3.25, 0.45)),
    "motorcycle": ClassSize(Normal(2.10, 0.25), Normal(0.77, 0.15), Normal(1.47, 0.2), False),
    "bicycle": ClassSize(Normal(1.70, 0.2), Normal(0.61, 0.15), Normal(1.29, 0.2), False),
}
_ROW_OF = {name: row for row, name in enumerate(CLASS_SIZES)}
# Probability that a tracked object of a class is of another: about the shares of the boxes of 20 synthetic streets.
_MISTAKEN: Mapping[str, Mapping[str, float]] = {
    "car": {"van": 0.03, "truck": 0.001},
    "van": {"car": 0.03, "truck": 0.005},
    "truck": {"van": 0.1, "tram": 0.05},
    "tram": {"truck": 0.2},
    "pedestrian": {"cyclist": 0.3},
    "person_sitting": {"pedestrian": 0.3},
    "cyclist": {"pedestrian": 0.15},
    "bus": {"truck": 0.1},
    "trailer": {"truck": 0.1},
    "motorcycle": {"cyclist": 0.15},
    "bicycle": {"cyclist": 0.15},
}
_OTHERS = np.array(
    [[_MISTAKEN[name].get(other, 0.0) for other in CLASS_SIZES] for name in CLASS_SIZES]
)
_MAX_MISTAKEN = 0.5  # probability that an object is of another class than the reported one
# What a detector calls by another name is as large as a car.
_OTHER = _ROW_OF["car"]
_SIZES_M = np.array([(one.length, one.width, one.height) for one in CLASS_SIZES.values()])
_HAS_SIDES = np.array([one.has_sides for one in CLASS_SIZES.values()])


@dataclass(frozen=True)
class SizePriors(ArrayTable):
    """Sizes that M objects have by their classes.

    Attributes:
        length_m: (M, 2) mean and standard deviation of the length.
        width_m: (M, 2) the same of the width.
        height_m: (M, 2) the same of the height.
        has_sides: (M,) whether the LiDAR sees flat sides.
        rows: (M,) rows of the classes in `CLASS_SIZES`.
    """

    length_m: Annotated[Float64, 2]
    width_m: Annotated[Float64, 2]
    height_m: Annotated[Float64, 2]
    has_sides: Bool
    rows: Int

    @classmethod
    def of(cls, types: NDArray[np.str_]) -> Self:
        """Return the sizes of M class names, in capitals or not."""
        rows = np.array([_ROW_OF.get(name.lower(), _OTHER) for name in types.tolist()], np.int64)
        sizes_m = _SIZES_M[rows]
        return cls(sizes_m[:, 0], sizes_m[:, 1], sizes_m[:, 2], _HAS_SIDES[rows], rows)

    def deviations_m(self, found_m: Float64, hidden_share: Float64, mistakes: Float64) -> Float64:
        """Return (M, 3) standard deviations of the true sizes from reported ones, of an object that may be of another class.

        Args:
            found_m: (M, 3) reported length, width and height.
            hidden_share: (M,) Share of a class's standard deviation that observations leave.
            mistakes: (M,) Ratio of the probability of another class to that of an object that is tracked.
        """
        others = mistakes[:, None] * _OTHERS[self.rows]
        others *= np.minimum(1.0, _MAX_MISTAKEN / np.maximum(others.sum(axis=1), _MAX_MISTAKEN))[
            :, None
        ]
        probabilities = others
        probabilities[np.arange(len(self)), self.rows] = 1.0 - others.sum(axis=1)
        mean_m, deviation_m = np.moveaxis(_SIZES_M, -1, 0)
        spread_m2 = (hidden_share[:, None, None] * deviation_m) ** 2 + (
            mean_m - found_m[:, None]
        ) ** 2
        return np.asarray(np.sqrt((probabilities[..., None] * spread_m2).sum(axis=1)))
