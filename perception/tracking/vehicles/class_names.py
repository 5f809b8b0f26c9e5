"""What the names that sources give to an object say of its class: Bayes over classes.

A detector in an image and one that looks from above err each in its own way, always alike. What each calls an object is as
likely by each class as it is among labelled objects of that class; the logarithms are added.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perception.tracking.vehicles.class_sizes import SizePriors
from perception.tracking.vehicles.image_heights import top_deviations
from perception.types import Float64, Vehicles

# Share of objects that a source names at random: what synthetic drives do not show of real ones.
_RANDOM_SHARE = 0.1
_HEIGHTS_M = 4.0  # range of heights at random


class _Names(NamedTuple):
    """Names that a source gives to objects of a class in percent, and the others at random.

    Attributes:
        objects: Number of labelled objects.
        image: Percent of each name in an image.
        above: The same from above.
    """

    objects: int
    image: Mapping[str, int]
    above: Mapping[str, int]


# Measured on 180 frames of 36 synthetic streets, of six LiDARs of 16 to 64 beams; `study modalities --evidence` counts them.
_CLASSES = {
    "Car": _Names(2416, {"Car": 96, "Van": 3, "Truck": 1}, {"Car": 94, "Van": 6}),
    "Van": _Names(
        832, {"Car": 20, "Van": 76, "Truck": 4}, {"Car": 24, "Van": 71, "Truck": 4, "Trailer": 1}
    ),
    "Truck": _Names(
        501,
        {"Car": 21, "Van": 24, "Truck": 55},
        {"Car": 27, "Van": 22, "Truck": 43, "Bus": 4, "Trailer": 4},
    ),
    "Bus": _Names(132, {"Truck": 100}, {"Bus": 94, "Truck": 6}),
    "Trailer": _Names(
        182,
        {"Car": 32, "Van": 56, "Truck": 12},
        {"Car": 16, "Van": 38, "Truck": 15, "Bus": 2, "Trailer": 29},
    ),
    "Pedestrian": _Names(
        1425,
        {"Pedestrian": 98, "Cyclist": 2},
        {"Pedestrian": 78, "Cyclist": 18, "Motorcycle": 1, "Bicycle": 3},
    ),
    "Cyclist": _Names(
        635,
        {"Pedestrian": 64, "Cyclist": 36},
        {"Pedestrian": 63, "Cyclist": 34, "Motorcycle": 2, "Bicycle": 1},
    ),
    "Motorcycle": _Names(
        392,
        {"Pedestrian": 44, "Cyclist": 56},
        {"Pedestrian": 19, "Cyclist": 13, "Motorcycle": 22, "Bicycle": 46},
    ),
    "Bicycle": _Names(
        624, {"Cyclist": 100}, {"Pedestrian": 5, "Cyclist": 1, "Motorcycle": 8, "Bicycle": 86}
    ),
}
_OBJECTS = sum(one.objects for one in _CLASSES.values())
NAMED_CLASSES: NDArray[np.str_] = np.array(list(_CLASSES))


def log_shares(classes: NDArray[np.str_]) -> Float64:
    """Return (C,) logarithms of the shares of classes among all objects; of others the smallest."""
    counts = [one.objects for one in _CLASSES.values()]
    shares = [_CLASSES[name].objects if name in _CLASSES else min(counts) for name in classes]
    return np.log(np.array(shares, np.float64) / _OBJECTS)


def names_in_images(vehicles: Vehicles) -> NDArray[np.str_]:
    """Return (M,) names of untracked vehicles in images; empty of what was found from above, but not by a camera."""
    is_shown = (vehicles.bev_types == "") | (vehicles.fused.source_indices[:, 0] >= 0)
    return np.where(is_shown, vehicles.fused.detections.types, "")


def class_likelihoods(
    in_image: NDArray[np.str_],
    above: NDArray[np.str_],
    classes: NDArray[np.str_],
) -> Float64:
    """Return (D, C) logarithms of the likelihoods of D detections by each class.

    The sizes that a network states from above say no more than its names do: both err alike.

    Args:
        in_image: (D,) names in an image; empty of what no image shows.
        above: (D,) names from above; empty of what was not found there.
        classes: (C,) classes.
    """
    shown = _of_names(in_image, classes, {name: one.image for name, one in _CLASSES.items()})
    seen = _of_names(above, classes, {name: one.above for name, one in _CLASSES.items()})
    return np.asarray(shown + seen)


def height_likelihoods(heights_m: Float64, boxes_px: Float64, classes: NDArray[np.str_]) -> Float64:
    """Return (D, C) logarithms of the likelihoods of (D,) heights in an image by each class; 0 where they are NaN."""
    sizes = SizePriors.of(classes)
    mean_m, deviation_m = sizes.height_m.T
    variance_m2 = deviation_m**2 + (top_deviations(boxes_px)[:, None] * mean_m) ** 2
    off = np.square(heights_m[:, None] - mean_m) / variance_m2
    density = np.exp(-off / 2) / np.sqrt(2 * np.pi * variance_m2)
    by_height = np.log((1 - _RANDOM_SHARE) * density + _RANDOM_SHARE / _HEIGHTS_M)
    return np.where(sizes.has_sides & np.isfinite(heights_m)[:, None], by_height, 0.0)


def _of_names(
    names: NDArray[np.str_], classes: NDArray[np.str_], percent: Mapping[str, Mapping[str, int]]
) -> Float64:
    """Return (D, C) logarithms of the probabilities that a source gives (D,) names to objects of each class.

    A name that only other detectors give is that of its class.
    """
    given, rows = np.unique(names, return_inverse=True)
    known = {name for one in percent.values() for name in one}
    found = np.array(
        [
            [
                percent[kind].get(name, 0)
                if name in known and kind in percent
                else 100 * (name == kind)
                for kind in classes.tolist()
            ]
            for name in given.tolist()
        ],
        np.float64,
    ).reshape(len(given), len(classes))
    shares = (1 - _RANDOM_SHARE) * found / 100 + _RANDOM_SHARE / len(known)
    shares[given == ""] = 1.0
    return np.asarray(np.log(shares)[rows])
