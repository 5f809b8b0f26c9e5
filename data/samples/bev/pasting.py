"""Objects of one scan put into another of the same sensor, with the shadows that they cast.

An object is turned about the sensor by whole columns, so that the same beams meet it at the same ranges, to a direction where
nothing stands. Returns of the scan behind it are removed, and its own behind what stands before it.
"""

from dataclasses import replace

import numpy as np

from data.samples.bev.labelled_scans import BevObjects, LabelledScan
from perception.geometry.se3 import wrap
from perception.kernels.box_owners import owners_in_boxes
from perception.obstacles.range_image import RangeImage, SphericalProjection, Visibility
from perception.types import Bool, Float, Float32, Float64, Int

# Cells by which returns are found on objects, the margin by which these are grown, and the height of the lowest that counts.
OWNERS_M = (0.1, 0.1, 0.1)
_STANDS_M = 0.3  # height from which a return is of something that stands
_ROOM_M = 0.3  # around an object in which nothing stands
MIN_RETURNS, _MAX_RANGE_M = 5, 45.0  # of an object that is put elsewhere
_MIN_SEEN = 0.6  # minimum share of its returns that nothing hides
_TRIES = 6
_MARGIN_M = 0.3  # along the ray
_ASIDE = 0.02  # rad to the sides of an object in which a return may be behind it


def owners_of_returns(scan: LabelledScan, boxes: Float) -> Int:
    """Return (N,) the first of (M, 7) boxes above the ground around each return, -1 without one."""
    above = np.column_stack([scan.points_velo[:, :2], scan.heights_m]).astype(np.float32)
    return owners_in_boxes(above, np.asarray(boxes, np.float64), *OWNERS_M)


def paste(
    scan: LabelledScan,
    donor: LabelledScan,
    rows: Int,
    projection: SphericalProjection,
    rng: np.random.Generator,
) -> LabelledScan:
    """Return a scan with objects of a donor; one for which no place is found is left out.

    Args:
        scan: Scan to put objects into.
        donor: Scan of the same sensor.
        rows: Rows of the objects in the labels of the donor.
        projection: Pixels of the sensor.
        rng: Random generator of the directions.
    """
    owners = owners_of_returns(donor, donor.labels.boxes[rows])
    image = RangeImage(scan.points_velo, projection)
    for number, row in enumerate(rows.tolist()):
        box, inside = donor.labels.boxes[row], np.flatnonzero(owners == number)
        room_m = np.hypot(*box[3:5]) / 2 + _ROOM_M
        stands_m = scan.points_velo[scan.heights_m > _STANDS_M, :2]
        if len(inside) < MIN_RETURNS:
            continue
        for turn in rng.integers(1, projection.columns, _TRIES) * projection.column_step_rad:
            placed = _turned(donor, row, inside, turn)
            away_m2 = ((stands_m - placed.labels.boxes[0, :2]) ** 2).sum(axis=1)
            if away_m2.min(initial=np.inf) <= room_m**2:
                continue
            seen = _are_seen(image, placed.points_velo)
            if seen.mean() >= _MIN_SEEN:
                scan = _with_object(scan, placed, seen, projection)
                image = RangeImage(scan.points_velo, projection)
                break
    return scan


def pastable_rows(labels: BevObjects) -> Int:
    """Return the rows of the objects that have enough returns, and are near enough, to be put elsewhere."""
    ranges_m = np.hypot(*labels.boxes[:, :2].T)
    return np.flatnonzero((labels.returns >= MIN_RETURNS) & (ranges_m <= _MAX_RANGE_M))


def _turned(donor: LabelledScan, row: int, inside: Int, turn_rad: float) -> LabelledScan:
    """Return one object of a scan alone, turned about the sensor."""
    cos, sin = np.cos(turn_rad), np.sin(turn_rad)
    rotation: Float64 = np.array([[cos, -sin], [sin, cos]])
    points, boxes = donor.points_velo[inside].copy(), donor.labels.boxes[row : row + 1].copy()
    points[:, :2], boxes[:, :2] = points[:, :2] @ rotation.T, boxes[:, :2] @ rotation.T
    boxes[:, 6] = wrap((boxes[:, 6] + turn_rad).astype(np.float64))
    labels = replace(donor.labels[row : row + 1], boxes=boxes)
    return LabelledScan(points, donor.heights_m[inside], labels)


def _are_seen(image: RangeImage, points_velo: Float32) -> Bool:
    states = image.visibility(points_velo, _MARGIN_M).states
    return np.asarray(states != Visibility.OCCLUDED)


def _in_direction(points_velo: Float32, object_velo: Float32) -> Int:
    """Return the rows of the points in the directions of an object, by its returns."""
    middle_m = object_velo[:, :2].mean(axis=0)
    ahead = middle_m / np.linalg.norm(middle_m)
    along_m, across_m = (object_velo[:, :2] @ axis for axis in (ahead, ahead[::-1] * (-1, 1)))
    slope = np.abs(across_m / along_m).max() + _ASIDE
    along_m, across_m = (points_velo[:, :2] @ axis for axis in (ahead, ahead[::-1] * (-1, 1)))
    return np.flatnonzero((along_m > 0) & (np.abs(across_m) < slope * along_m))


def _with_object(
    scan: LabelledScan, placed: LabelledScan, seen: Bool, projection: SphericalProjection
) -> LabelledScan:
    """Return a scan with one object more, and without the returns behind it."""
    points_velo, heights_m = placed.points_velo[seen], placed.heights_m[seen]
    behind = _in_direction(scan.points_velo, points_velo)
    is_hidden = ~_are_seen(RangeImage(points_velo, projection), scan.points_velo[behind])
    kept = np.ones(len(scan.points_velo), bool)
    kept[behind[is_hidden]] = False
    hidden = owners_of_returns(scan, scan.labels.boxes)[~kept]
    lost = np.bincount(hidden[hidden >= 0], minlength=len(scan.labels))
    left = replace(scan.labels, returns=np.maximum(scan.labels.returns - lost, 0))
    labels = BevObjects.concatenate(
        [left, replace(placed.labels, returns=np.array([len(points_velo)]))]
    )
    return LabelledScan(
        np.concatenate([scan.points_velo[kept], points_velo]),
        np.concatenate([scan.heights_m[kept], heights_m]),
        replace(labels, view_rad=scan.labels.view_rad),
    )
