"""Whether the boxes of labels lie where the scans have objects, and if not, as which mistake in axes or order they would.

The fit of a box is the share of the returns above the ground near it that lie within it: it falls with a wrong place,
heading, height, unit or scan.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.spatial import cKDTree

from data.box_labels.boxes import (
    LabelForm,
    LabelledBox,
    Reading,
    along_y,
    as_stated,
    from_bottom,
    in_degrees,
)
from data.box_labels.label_types import label_type
from perception.errors import LabelError
from perception.geometry.boxes import points_inside, transform_boxes
from perception.geometry.se3 import wrap
from perception.types import Boxes3D, Float32, Float64, GroundModel

_ABOVE_M = (0.2, 4.0)  # returns of objects
_NEAR_M, _MARGIN_M = 0.7, 0.1
_FEWEST = 3  # boxes, from which axes can be told
# Of the fit of the boxes that a mistake changes: a change, and the mean gain and its deviations (95 %) that name the mistake.
_CHANGE, _GAIN, _SURE = 0.02, 0.08, 1.65
_MIN_SHARE = 0.3  # of boxes with a return
_MAX_BOTTOM_M = 1.0  # middle distance from the ground
_MAX_TURN_RAD = 2.5 * np.pi + 0.01  # a turn, and a quarter between axes
_LONG_TYPES = ("Car", "Van", "Truck", "Bus")
_ADVICE = "export them in metres and rad in the axes of the scans"
_ORDER_ADVICE = "compare the labels with the scans: frames may be shifted"


def _changed(
    *columns: int, signs: Sequence[int] = (1, 1, 1), turn: tuple[int, float] = (1, 0)
) -> Reading:
    """Return a reading whose centres have their columns in another order, and headings another sign and origin."""

    def boxes(numbers: Float64) -> Float64:
        centres = numbers[:, list(columns)] * signs
        return np.column_stack([centres, numbers[:, 3:6], wrap(turn[0] * numbers[:, 6] + turn[1])])

    return Reading("", boxes)


def _scaled(factor: float) -> Callable[[Float64], Float64]:
    return lambda numbers: np.column_stack([numbers[:, :6] * factor, numbers[:, 6]])


_QUARTER = np.pi / 2
_MISTAKES: Mapping[str, Callable[[Float64], Float64]] = {
    "x and y have changed places": _changed(1, 0, 2, turn=(-1, _QUARTER)).boxes,
    "x is right and y forward": _changed(1, 0, 2, signs=(1, -1, 1), turn=(1, -_QUARTER)).boxes,
    "x is left and y backward": _changed(1, 0, 2, signs=(-1, 1, 1), turn=(1, _QUARTER)).boxes,
    "x is backward": _changed(0, 1, 2, signs=(-1, 1, 1), turn=(-1, np.pi)).boxes,
    "y is right": _changed(0, 1, 2, signs=(1, -1, 1), turn=(-1, 0)).boxes,
    "x is backward and y right": _changed(0, 1, 2, signs=(-1, -1, 1), turn=(1, np.pi)).boxes,
    "they are in the axes of a camera": _changed(2, 0, 1, signs=(1, -1, -1), turn=(-1, -_QUARTER)).boxes,
    "headings are in degrees": in_degrees,
    "headings are clockwise": _changed(0, 1, 2, turn=(-1, 0)).boxes,
    "headings are off by a quarter turn": _changed(0, 1, 2, turn=(1, _QUARTER)).boxes,
    "length and width have changed places": along_y,
    "z is that of the bottom": from_bottom,
    "lengths are in millimetres": _scaled(0.001),
    "lengths are in centimetres": _scaled(0.01),
    "lengths are in feet": _scaled(0.3048),
}  # fmt: skip


@dataclass(frozen=True)
class LabelledSample:
    """Boxes with a scan.

    Attributes:
        boxes: M boxes.
        points_velo: (N, 3) returns at the heights of objects.
        tree: Their places on the ground.
        ground: Ground under the scan.
        velo_SE3_file: (4, 4) transform from the axes of the files.
    """

    boxes: Sequence[LabelledBox]
    points_velo: Float32
    tree: cKDTree
    ground: GroundModel
    velo_SE3_file: Float64

    @classmethod
    def of_scan(cls, points_velo: Float32, ground: GroundModel, velo_SE3_file: Float64) -> Self:
        """Return a scan of (N, 3+) returns without boxes."""
        heights_m = ground.distance_m(points_velo)
        is_object = (heights_m > _ABOVE_M[0]) & (heights_m < _ABOVE_M[1])
        objects = points_velo[is_object, :3]
        return cls((), objects, cKDTree(objects[:, :2]), ground, velo_SE3_file)

    def boxes_velo(self, change: Callable[[Float64], Float64]) -> Boxes3D:
        """Return the boxes by a reading."""
        return boxes_of(change(numbers_of_boxes(self.boxes)), self.velo_SE3_file)

    def fits(self, boxes_velo: Boxes3D) -> Float64:
        """Return the (M,) fits of boxes."""
        fits = np.zeros(len(boxes_velo))
        reach_m = np.hypot(*boxes_velo.size_m[:, :2].T) / 2 + _NEAR_M
        near = self.tree.query_ball_point(boxes_velo.bottom_m[:, :2], reach_m)
        for row in np.flatnonzero([bool(rows) for rows in near]):
            points = self.points_velo[near[row]]
            fits[row] = points_inside(boxes_velo[row : row + 1], points, _MARGIN_M).mean()
        return fits


def numbers_of_boxes(boxes: Sequence[LabelledBox]) -> Float64:
    """Return (M, 7) numbers of boxes."""
    return np.array([one.numbers for one in boxes], np.float64).reshape(-1, 7)


def boxes_of(numbers: Float64, velo_SE3_file: Float64) -> Boxes3D:
    """Return boxes in the LiDAR frame of (M, 7) numbers as `Reading` returns them."""
    bottoms_m = numbers[:, :3] - numbers[:, 5:6] * (0, 0, 0.5)
    return transform_boxes(velo_SE3_file, Boxes3D(bottoms_m, numbers[:, 3:6], wrap(numbers[:, 6])))


def choose_reading(
    form: LabelForm,
    samples: Sequence[LabelledSample],
    renamed: Mapping[str, str],
    reordered: Mapping[str, Sequence[LabelledSample]],
) -> Reading:
    """Return the reading of a form that fits the scans best.

    Args:
        form: Form of the labels.
        samples: Some labelled scans.
        renamed: Other names for classes.
        reordered: The same boxes with the scans that are theirs by each mistake in the order of frames.

    Raises:
        LabelError: Boxes lie where the scans have no objects, or as if a mistake had been made.
    """
    boxes = [box for one in samples for box in one.boxes]
    numbers = numbers_of_boxes(boxes)
    possible = [one for one in form.readings if _is_turn(one.boxes(numbers))]
    if not possible:
        row = int(np.abs(form.readings[0].boxes(numbers)[:, 6]).argmax())
        found = f"{boxes[row].numbers[6]:g}, as headings in degrees are"
        raise LabelError(boxes[row].where, expected="a heading in rad", found=found, advice=_ADVICE)
    is_long = np.array([label_type(box.kind, renamed) in _LONG_TYPES for box in boxes], bool)
    fits = [_fits(samples, one.boxes) for one in possible]
    are_wide = [_are_wide(one.boxes(numbers)[is_long]) for one in possible]
    scores = [of_one.sum() - len(boxes) * wide for of_one, wide in zip(fits, are_wide, strict=True)]
    best = int(np.argmax(scores))
    if len(boxes) >= _FEWEST:
        if are_wide[best]:
            expected, what = "vehicles longer than wide", "length and width have changed places"
            raise LabelError(
                boxes[0].where, expected=expected, found=f"boxes as if {what}", advice=_ADVICE
            )
        _require_fit(form, possible[best], samples, fits[best], reordered)
    return possible[best]


def _is_turn(numbers: Float64) -> bool:
    return bool((np.abs(numbers[:, 6]) <= _MAX_TURN_RAD).all())


def _are_wide(numbers: Float64) -> bool:
    """Return whether most of some boxes, of vehicles, are wider than long."""
    return len(numbers) >= _FEWEST and bool((numbers[:, 4] > numbers[:, 3]).mean() > 0.5)


def _fits(
    samples: Sequence[LabelledSample],
    reading: Callable[[Float64], Float64],
    change: Callable[[Float64], Float64] = as_stated,
) -> Float64:
    """Return the (M,) fits of all boxes by a reading, after which they are changed."""
    changed = [one.boxes_velo(lambda numbers: change(reading(numbers))) for one in samples]
    fits = (one.fits(boxes) for one, boxes in zip(samples, changed, strict=True))
    return np.concatenate([np.zeros(0), *fits])


def _require_fit(
    form: LabelForm,
    reading: Reading,
    samples: Sequence[LabelledSample],
    fits: Float64,
    reordered: Mapping[str, Sequence[LabelledSample]],
) -> None:
    """Validate the (M,) fits of the boxes of some scans by a reading."""
    boxes = [box for one in samples for box in one.boxes]
    better = {what: _fits(samples, reading.boxes, change) for what, change in _MISTAKES.items()}
    better |= {what: _fits(others, reading.boxes) for what, others in reordered.items()}
    what = max(better, key=lambda one: better[one].mean())
    gain = better[what] - fits
    is_changed, advice = np.abs(gain) > _CHANGE, _ORDER_ADVICE if what in reordered else _ADVICE
    expected = f"boxes of {form.name} around the returns of objects"
    if is_changed.any() and gain[is_changed].mean() > max(
        _GAIN, _SURE * np.sqrt((gain[is_changed] ** 2).sum()) / is_changed.sum()
    ):
        share, best = fits[is_changed].mean(), better[what][is_changed].mean()
        found = f"{share:.0%} of the returns near them inside, and {best:.0%} as if {what}"
        where = boxes[int(gain.argmax())].where
        raise LabelError(where, expected=expected, found=found, advice=advice)
    share, bottom_m = (fits > 0).mean(), _middle_bottom_m(samples, reading)
    if share < _MIN_SHARE:
        found = f"{share:.0%} of {len(boxes)} boxes with returns"
        where = boxes[int(fits.argmin())].where
        raise LabelError(where, expected=expected, found=found, advice=_ORDER_ADVICE)
    if abs(bottom_m) > _MAX_BOTTOM_M:
        found = f"bottoms {abs(bottom_m):.1f} m {'above' if bottom_m > 0 else 'below'} it"
        raise LabelError(
            boxes[0].where, expected="boxes on the ground", found=found, advice=_ADVICE
        )


def _middle_bottom_m(samples: Sequence[LabelledSample], reading: Reading) -> float:
    bottoms = [one.ground.distance_m(one.boxes_velo(reading.boxes).bottom_m) for one in samples]
    return float(np.median(np.concatenate(bottoms)))
