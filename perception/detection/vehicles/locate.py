"""Location of detections in the scan: the points, the distance and the box of each object."""

from dataclasses import dataclass, replace
from typing import Annotated, Self

import numpy as np

from perception.detection.vehicles.box_heights import classes_by_height, fit_heights
from perception.detection.vehicles.config import VehicleConfig
from perception.detection.vehicles.l_shape_fit import ImageSpans, Rectangles, fit_rectangles
from perception.detection.vehicles.vehicle_points import ImageObjects, VehiclePoints, find_points
from perception.geometry.se3 import wrap
from perception.maps.projection import camera_of
from perception.tracking.vehicles.box_uncertainty import box_deviations, located_covariances
from perception.tracking.vehicles.class_sizes import SizePriors
from perception.types import (
    ArrayTable,
    BoxDeviations,
    Boxes3D,
    Calibration,
    Detections,
    Float64,
    Frame,
    FusedDetections,
    GroundModel,
    Int,
    Vehicles,
)

_HIDDEN_DEPTH_M = 0.1  # distance of the middle behind the median of the returns
_DIRECTIONS = 18  # number of directions within half a turn
_SPREAD_SHARE = 0.25  # standard deviation of returns along length and width, as a share of these
_MAX_DEVIATIONS = 3.0  # number of standard deviations beyond which a point costs no more
_WEIGHT = 6.0  # number of independent observations that all returns together are worth
_ROAD_DEVIATION_RAD = 0.6  # standard deviation of headings from the vehicle's
_SAMPLES = 64  # number of points of each object that its box is fitted to


def fit_bodies(samples_m: Float64, sizes: SizePriors) -> Rectangles:
    """Return the rectangle around each of F people, of the size of their class.

    Args:
        samples_m: (F, P, 2) points of each around a sensor at the origin.
        sizes: (F) sizes of their classes.
    """
    medians_m = np.median(samples_m, axis=1)
    away_m = np.maximum(np.hypot(*medians_m.T), 1e-6)[:, None]
    centers_m = medians_m * (1 + _HIDDEN_DEPTH_M / away_m)
    sizes_m = np.column_stack([sizes.length_m[:, 0], sizes.width_m[:, 0]])
    yaw_rad = np.arange(_DIRECTIONS) * np.pi / _DIRECTIONS
    offsets_m = samples_m - medians_m[:, None]
    costs = np.zeros((len(samples_m), _DIRECTIONS))
    for turn_rad, size_m in zip((0, np.pi / 2), sizes_m.T, strict=True):
        axes = np.stack([np.cos(yaw_rad + turn_rad), np.sin(yaw_rad + turn_rad)])
        off = (offsets_m @ axes) / (_SPREAD_SHARE * size_m[:, None, None])  # (F, P, D)
        costs += _WEIGHT * np.minimum(off**2, _MAX_DEVIATIONS**2).mean(axis=1)
    costs += (np.sin(yaw_rad) / np.sin(_ROAD_DEVIATION_RAD)) ** 2
    return Rectangles(centers_m, sizes_m, yaw_rad[costs.argmin(axis=1)])


def locate(
    fused: FusedDetections,
    frame: Frame,
    ground: GroundModel | None,
    config: VehicleConfig | None = None,
    *,
    uses_scan: bool = True,
) -> Vehicles:
    """Locate each detection in the scan.

    Headings are known except for their sign, which is that of the traffic there; a tracker adds ids and velocities.
    Heights tell the classes of vehicles apart.
    Detections below the minimum score are not located: a detector may report a hundred of them a frame, and their
    time would be lost for the others.

    Args:
        fused: M detections.
        frame: Frame of the detections.
        ground: Ground model; None takes the lowest points around an object for its ground.
        config: Depth and points of objects, traffic, and minimum existence.
        uses_scan: Whether the returns are of the frame's time; else each detection stays without a place.
    """
    config, camera, count = config or VehicleConfig(), camera_of(frame), len(fused)
    detections, sizes = fused.detections, SizePriors.of(fused.detections.types)
    likely = np.flatnonzero(fused.existence >= config.min_existence)
    objects = ImageObjects(detections.boxes_px, fused.existence, sizes)[likely]
    leaders = objects.leaders()
    leading = np.flatnonzero(leaders == np.arange(len(leaders)))
    points_velo = frame.points_velo if uses_scan else frame.points_velo[:0]
    found = find_points(points_velo, objects[leading], camera, ground, config.max_depth_m)
    owners = np.full(len(frame.points_velo), -1)
    owners[found.rows] = likely[leading[found.owners]]
    found = found.shared(np.searchsorted(leading, leaders))
    found = replace(found, owners=likely[found.owners])
    distances_m = np.full(count, np.inf)
    x_m, y_m, z_m = found.xyz_m.T
    np.minimum.at(distances_m, found.owners, np.sqrt(x_m**2 + y_m**2 + z_m**2))
    observed = _Observed.of(found, detections, sizes, config.min_points)
    unknown = Boxes3D(*(np.full((count, *row), np.nan) for row in ((3,), (3,), ())))
    boxes = unknown.replaced(observed.rows, _fit_boxes(observed, camera, config))
    places = np.arange(count)
    places[likely] = likely[leaders]
    types = classes_by_height(detections, boxes.size_m[:, 2], places)
    renamed = np.flatnonzero(types[observed.rows] != detections.types[observed.rows])
    if len(renamed):
        other = observed[renamed]
        other = replace(other, sizes=SizePriors.of(types[other.rows]))
        boxes = boxes.replaced(other.rows, _fit_boxes(other, camera, config))
    sizes, counts = SizePriors.of(types), np.bincount(found.owners, minlength=count)
    rows = np.flatnonzero(np.isfinite(boxes.yaw_rad))
    deviations = box_deviations(boxes[rows], counts[rows], sizes[rows])
    return Vehicles(
        fused=replace(fused, detections=replace(detections, types=types)),
        ids=np.full(count, -1),
        boxes=boxes,
        distances_m=np.where(np.isfinite(distances_m), distances_m, np.nan),
        velocities_m_s=np.full((count, 2), np.nan),
        covariances=located_covariances(boxes, counts, sizes),
        box_deviations=BoxDeviations.unknown(count).replaced(rows, deviations),
        owners=owners,
    )


@dataclass(frozen=True)
class _Observed(ArrayTable):
    """F objects with enough points for a box.

    Attributes:
        rows: (F,) rows of their detections.
        boxes_px: (F, 4) boxes in the image.
        sizes: (F) sizes of their classes.
        samples_m: (F, P, 2) evenly sampled points of each from above, with repetition where there are fewer.
        ground_m: (F,) z of the ground below.
        top_m: (F,) z of the highest point.
    """

    rows: Int
    boxes_px: Annotated[Float64, 4]
    sizes: SizePriors
    samples_m: Annotated[Float64, ...]
    ground_m: Float64
    top_m: Float64

    @classmethod
    def of(
        cls, found: VehiclePoints, detections: Detections, sizes: SizePriors, min_points: int
    ) -> Self:
        """Return the objects that have enough points."""
        count = len(detections)
        counts = np.bincount(found.owners, minlength=count)
        rows = np.flatnonzero(counts >= min_points)
        order = np.argsort(found.owners, kind="stable")
        starts = (counts.cumsum() - counts)[rows]
        picked = (np.arange(_SAMPLES) + 0.5) / _SAMPLES * counts[rows, None]
        samples_m = found.xyz_m[order[starts[:, None] + picked.astype(np.int64)]]
        ground_m = np.bincount(found.owners, found.ground_m, count)[rows] / counts[rows]
        top_m = np.full(count, -np.inf)
        np.maximum.at(top_m, found.owners, found.xyz_m[:, 2])
        boxes_px = detections.boxes_px[rows]
        return cls(rows, boxes_px, sizes[rows], samples_m[..., :2], ground_m, top_m[rows])


def _fit_boxes(
    observed: _Observed, camera: tuple[Calibration, tuple[int, int]], config: VehicleConfig
) -> Boxes3D:
    """Return (F) boxes: what has sides by these, people by their middle, all of a height that the image shows."""
    (calibration, size_px), mean_m = camera, observed.sizes.height_m[:, 0]
    middles_m, columns_px = observed.ground_m + mean_m / 2, observed.boxes_px[:, [0, 2]]
    spans = ImageSpans(columns_px, calibration.image_P_velo, size_px[0], middles_m)
    outlines = fit_outlines(observed.samples_m, observed.sizes, spans)
    boxes = Boxes3D(
        np.column_stack([outlines.centers_m, observed.ground_m]),
        np.column_stack([outlines.sizes_m, mean_m]),
        likely_headings_rad(outlines, config),
    )
    heights_m = fit_heights(boxes, observed.boxes_px, observed.sizes, calibration)
    heights_m = np.maximum(heights_m, observed.top_m - observed.ground_m)
    return replace(boxes, size_m=np.column_stack([outlines.sizes_m, heights_m]))


def likely_headings_rad(outlines: Rectangles, config: VehicleConfig) -> Float64:
    """Return (F,) headings: ahead, and towards the sensor beyond the own lane on the side of the oncoming traffic."""
    to_oncoming_m = outlines.centers_m[:, 1] * (1 if config.traffic_side == "right" else -1)
    turn_rad = np.where(to_oncoming_m > config.lane_width_m / 2, np.pi, 0.0)
    return np.asarray(wrap(wrap(outlines.yaw_rad, np.pi) + turn_rad))


def fit_outlines(samples_m: Float64, sizes: SizePriors, spans: ImageSpans) -> Rectangles:
    """Return (F) outlines from above.

    Args:
        samples_m: (F, P, 2) points of each object around a sensor at the origin.
        sizes: (F) sizes of their classes.
        spans: Their columns in the image.
    """
    vehicles, people = np.flatnonzero(sizes.has_sides), np.flatnonzero(~sizes.has_sides)
    outlines = fit_rectangles(samples_m[vehicles], sizes[vehicles], spans[vehicles])
    if not len(people):
        return outlines
    bodies = fit_bodies(samples_m[people], sizes[people])
    return outlines.joined(bodies)[np.argsort(np.concatenate([vehicles, people]))]
