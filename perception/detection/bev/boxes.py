"""From what the network of the bird's-eye view predicts at each place to boxes on the ground.

A place is a square of `STRIDE` cells a side, and those of a block of the map lie side by side in the channels of the
network, S * S of them. A place has the logit of a score for each class, and states, in this order,

    offset    x and y of the centre from the low corner of the place, in sides of one
    bottom    height of the bottom above the ground in metres
    size      logarithms of length, width, height in metres
    heading   sine and cosine; short where front and rear look alike
    axis      sine and cosine of twice the heading, which front and rear share

and then the logarithms of the scales of the errors (of Laplace's distribution) of position, bottom, length, width, height
and axis.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from scipy.special import expit

from perception.detection.bev.bev_map import BLOCK, BevGrid
from perception.geometry.se3 import wrap
from perception.kernels.bev import peaks_of, unsuppressed
from perception.types import ArrayTable, Boxes3D, Float32, Float64, Int


class _Columns(NamedTuple):
    offset: slice = slice(0, 2)
    bottom: slice = slice(2, 3)
    size: slice = slice(3, 6)
    heading: slice = slice(6, 8)
    axis: slice = slice(8, 10)


BOX = _Columns()
BOXES, DEVIATIONS = 10, 6
STRIDE = 2  # cells along the side of a place
SPLIT = BLOCK // STRIDE  # places along the side of a block, S
MIN_SCORE = 0.07  # below which nothing is reported
MIN_LOGIT = math.log(MIN_SCORE / (1 - MIN_SCORE))
_MAX_LOG = 6.0
_NARROW_PLACES = 2.0  # width below which two objects may have their centres in neighbouring places
_APART_M = 0.4  # minimum distance between the centres of two objects of one group
_SQRT_2 = float(np.sqrt(2))  # standard deviation over the scale of Laplace's distribution


@dataclass(frozen=True)
class BevDetections(ArrayTable):
    """M detected objects, best first.

    Attributes:
        boxes: (M) boxes in the LiDAR frame, but for their bottoms, which are heights above the ground.
        classes: (M,) indices into the class names.
        scores: (M,) scores, 0..1.
        deviations: (M, 6) standard deviations of position along each axis, bottom, length, width, height in metres, and
            heading modulo pi in rad.
        reversals: (M,) probability that the front is the rear, 0 to 0.5.
    """

    boxes: Boxes3D
    classes: Int
    scores: Float64
    deviations: Annotated[Float64, 6]
    reversals: Float64


def decode_boxes(
    scores: Float32,
    boxes: Float32,
    grid: BevGrid,
    min_score: float = MIN_SCORE,
    most: int = 1000,
    blocks: Int | None = None,
) -> BevDetections:
    """Return the objects of one map.

    Args:
        scores: (K S S, H, W) logits of the scores of each class, of which peaks are objects.
        boxes: (16 S S, H, W) box and scales of its errors at each place, or (16 S S, 1, P) of P blocks.
        grid: Cells of the map.
        min_score: Score below which nothing is reported.
        most: Largest number of objects.
        blocks: (P,) numbers of the blocks with boxes, of the H W; None for all.
    """
    rows, columns = scores.shape[1:]
    place_m = 2 * grid.reach_m / (SPLIT * rows)
    logits = np.ascontiguousarray(scores).reshape(-1, SPLIT**2, rows, columns)
    stated = np.ascontiguousarray(boxes).reshape(BOXES + DEVIATIONS, SPLIT**2, -1)
    numbers: Int = np.arange(rows * columns) if blocks is None else blocks
    narrow = math.log(_NARROW_PLACES * place_m)
    min_logit = math.log(min_score / (1 - min_score))
    classes, part, block = peaks_of(logits, stated, numbers, min_logit, narrow).T
    values = logits.reshape(*logits.shape[:2], -1)[classes, part, numbers[block]]
    best = np.argsort(-values, kind="stable")[:most]
    part, block = part[best], block[best]
    cells = stated[:, part, block].astype(np.float64)
    in_map = np.stack(np.divmod(numbers[block], columns), axis=1)
    places = SPLIT * in_map + np.stack(np.divmod(part, SPLIT), axis=1)
    corners_m = places * place_m - grid.reach_m
    axis_rad = np.arctan2(*cells[BOX.axis]) / 2
    sizes, scales = (
        np.exp(np.clip(logs, -_MAX_LOG, _MAX_LOG)) for logs in (cells[BOX.size], cells[BOXES:])
    )
    # Along the axis, 1 where the network is sure of the front, -1 where that is the other end.
    forward = np.sin(axis_rad) * cells[BOX.heading][0] + np.cos(axis_rad) * cells[BOX.heading][1]
    return BevDetections(
        boxes=Boxes3D(
            np.column_stack([corners_m + place_m * cells[BOX.offset].T, cells[BOX.bottom].T]),
            sizes.T,
            np.asarray(wrap(np.where(forward >= 0, axis_rad, axis_rad + np.pi))),
        ),
        classes=classes[best],
        scores=expit(values[best].astype(np.float64)),
        deviations=_SQRT_2 * scales.T,
        reversals=(1 - np.minimum(np.abs(forward), 1)) / 2,
    )


def suppress(found: BevDetections, groups: Sequence[int]) -> BevDetections:
    """Return the objects that no better one of the same group is nearer to than half its width, or 0.4 m.

    Args:
        found: Objects, best first.
        groups: Group of each class; a car is no van beside.
    """
    group = np.asarray(groups, np.int64)[found.classes]
    radii_m = np.maximum(found.boxes.size_m[:, 1] / 2, _APART_M)
    return found[unsuppressed(np.ascontiguousarray(found.boxes.bottom_m), radii_m, group)]
