"""What the view from above tells of objects beside a camera, fitted to labelled synthetic drives.

The constants of `bev_objects`, `bev_joining` and `class_names` are the rows of these tables. Real frames are not fitted to.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from data.recorded_drive import RecordedDrive
from perception.detection.bev.detector import BevDetector
from perception.detection.config import DetectionConfig
from perception.detection.detectors.multimodal import MultimodalDetector
from perception.detection.networks import open_bev, open_detectors, open_fusion
from perception.detection.vehicles.bev_joining import are_covered, find_pairs, spreads_m2
from perception.detection.vehicles.bev_objects import LEAST, bev_vehicles
from perception.detection.vehicles.locate import locate
from perception.evaluation.report import Metric, Metrics
from perception.geometry.box_overlap import center_distances_m, iou_3d
from perception.geometry.box_overlap_px import iou_px
from perception.tracking.vehicles.class_sizes import SizePriors
from perception.tracking.vehicles.evidence import log_odds
from perception.types import ArrayTable, Bool, Float64, Frame, Labels, Vehicles

_NEAR_M, _NEAR_PERSON_M = 2.0, 1.0  # maximum distance of an object from its label
_MIN_IOU_PX, _MIN_PERSON_IOU_PX = 0.7, 0.5  # minimum IoU of a rectangle that fits
_MIN_EXISTENCE = 0.2  # minimum existence of what is named, as of what may continue a track
_RATIOS = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0)  # of deviations, of which the best is taken


@dataclass(frozen=True)
class SeenFromAbove(ArrayTable):
    """M objects in the view of a camera that the bird's-eye view has found.

    Attributes:
        is_vehicle: (M,) whether they have sides; else people and cycles.
        scores: (M,) scores from above.
        is_object: (M,) whether a labelled object is there.
        is_unseen: (M,) whether the camera does not show them.
        camera_scores: (M,) scores of the camera's detections of the same, NaN without one.
        fits: (M,) whether the rectangle of the camera fits a label of its class.
        spread_ratios: (M,) ratio of the stated deviations of the camera's box to those from above.
        ious: (M, 2) IoU in space with a label, of the camera's box and of that from above.
    """

    is_vehicle: Bool
    scores: Float64
    is_object: Bool
    is_unseen: Bool
    camera_scores: Float64
    fits: Bool
    spread_ratios: Float64
    ious: Annotated[Float64, 2]


@dataclass(frozen=True)
class NamedObjects(ArrayTable):
    """N labelled objects that are found in an image or from above.

    Attributes:
        types: (N,) classes of their labels.
        in_image: (N,) names in an image, empty of what no image shows.
        above: (N,) names from above, empty of what is not found there.
    """

    types: NDArray[np.str_]
    in_image: NDArray[np.str_]
    above: NDArray[np.str_]


@dataclass(frozen=True)
class Names(Metrics):
    """Names of the objects of one class, the most frequent first, in percent of those that a source finds.

    Attributes:
        objects: Number of objects.
        in_image: Names in images.
        above: Names from above.
    """

    objects: Annotated[int, Metric("objects")]
    in_image: Annotated[str, Metric("in images [%]")]
    above: Annotated[str, Metric("from above [%]")]


@dataclass(frozen=True)
class Evidence(Metrics):
    """Constants for one kind of objects.

    Attributes:
        objects: Number of true objects from above.
        slope: Log-odds that there is an object for those of its score.
        offset: The same at even scores.
        unseen: Log-odds that it is there although the camera does not show it.
        share: Share of the log-odds from above that is added to those of a camera's score.
        constant: Log-odds that are added to these whatever the score from above.
        ratio: Ratio of deviations above which the box from above is taken.
    """

    objects: Annotated[int, Metric("objects")]
    slope: Annotated[float, Metric("slope", ".2f")]
    offset: Annotated[float, Metric("offset", ".2f")]
    unseen: Annotated[float, Metric("unseen", ".2f")]
    share: Annotated[float, Metric("share", ".2f")]
    constant: Annotated[float, Metric("constant", ".2f")]
    ratio: Annotated[float, Metric("ratio", ".1f")]


def measure_evidence(
    drives: Sequence[RecordedDrive], config: DetectionConfig
) -> tuple[Mapping[str, Evidence], Mapping[str, Names]]:
    """Return the constants of vehicles and of people, and the names of each class, by drives with labels and images."""
    camera = MultimodalDetector(open_detectors(config), open_fusion(config))
    found, named = zip(
        *(one for drive in drives for one in _seen(drive, camera, config)), strict=True
    )
    seen, names = SeenFromAbove.concatenate(found), NamedObjects.concatenate(named)
    evidence = {
        name: fit_evidence(seen[seen.is_vehicle == is_vehicle])
        for name, is_vehicle in (("vehicles", True), ("people and cycles", False))
    }
    return evidence, count_names(names)


def count_names(objects: NamedObjects) -> Mapping[str, Names]:
    """Return the names that each source gives to objects of each class; `class_names` states them."""
    rows = {str(name): objects[objects.types == name] for name in np.unique(objects.types)}
    return {
        name: Names(len(one), _percent(one.in_image), _percent(one.above))
        for name, one in rows.items()
    }


def _percent(names: NDArray[np.str_]) -> str:
    counts = Counter(names[names != ""].tolist())
    return ", ".join(
        f"{name} {100 * count / counts.total():.0f}" for name, count in counts.most_common()
    )


def fit_evidence(found: SeenFromAbove) -> Evidence:
    """Return the constants of objects of one kind."""
    odds = log_odds(found.scores, LEAST)
    slope, offset = _logistic(np.column_stack([odds, np.ones(len(odds))]), found.is_object)
    above, unseen = slope * odds + offset, found.is_unseen
    (missed,) = _logistic(np.ones((unseen.sum(), 1)), found.is_object[unseen], above[unseen])
    both = np.isfinite(found.camera_scores)
    own = log_odds(found.camera_scores[both], LEAST)
    share, constant = _logistic(
        np.column_stack([above[both], np.ones(both.sum())]), found.fits[both], own
    )
    ious = {
        ratio: np.where(found.spread_ratios > ratio, found.ious[:, 1], found.ious[:, 0])[
            both
        ].mean()
        for ratio in _RATIOS
    }
    best = max(ious, key=lambda ratio: ious[ratio])
    return Evidence(int(found.is_object.sum()), slope, offset, missed, share, constant, best)


def _logistic(inputs: Float64, is_true: Bool, known: Float64 | float = 0.0) -> list[float]:
    """Return the weights of inputs by which log-odds, beside known ones, fit what is true."""
    signs = 2.0 * is_true - 1

    def loss(weights: Float64) -> float:
        return float(np.logaddexp(0, -signs * (inputs @ weights + known)).mean())

    fitted: list[float] = minimize(loss, np.zeros(inputs.shape[1])).x.tolist()
    return fitted


def _seen(
    drive: RecordedDrive, camera: MultimodalDetector, config: DetectionConfig
) -> Iterator[tuple[SeenFromAbove, NamedObjects]]:
    above = open_bev(config, drive.sensor)
    assert above is not None  # a modality of the configuration
    for index in range(len(drive)):
        frame, labels = drive[index], drive.labels(index)
        if len(labels):
            yield _seen_in(frame, labels, camera, above)


def _seen_in(
    frame: Frame, labels: Labels, camera: MultimodalDetector, above: BevDetector
) -> tuple[SeenFromAbove, NamedObjects]:
    found = bev_vehicles(above.detect(frame.points_velo), above.class_names, frame)
    found = found.select(np.flatnonzero(found.cameras == 0))
    vehicles = locate(camera.detect(frame).fused, frame, None)
    named = NamedObjects(
        labels.types.astype(np.str_), _names(vehicles, labels), _names(found, labels)
    )
    columns, rows = find_pairs(vehicles, found, frame)
    count = len(found)
    is_vehicle = SizePriors.of(found.fused.detections.types).has_sides
    of_label = SizePriors.of(labels.types).has_sides
    away_m = center_distances_m(found.boxes, labels.boxes_velo)
    away_m[is_vehicle[:, None] != of_label] = np.inf
    is_unseen = ~are_covered(found, vehicles)
    is_unseen[rows] = False
    scores, ratios = np.full((2, count), np.nan)
    fits, ious = np.zeros(count, bool), np.zeros((count, 2))
    scores[rows] = vehicles.fused.detections.scores[columns]
    fits[rows] = _fit(vehicles, labels)[columns]
    own_m2, found_m2 = spreads_m2(vehicles), spreads_m2(found)
    ratios[rows] = np.sqrt(own_m2[columns] / found_m2[rows])
    ious[:, 1] = iou_3d(found.boxes, labels.boxes_velo).max(axis=1)
    ious[rows, 0] = np.nan_to_num(iou_3d(vehicles.boxes, labels.boxes_velo)).max(axis=1)[columns]
    seen = SeenFromAbove(
        is_vehicle=is_vehicle,
        scores=found.bev_scores,
        is_object=away_m.min(axis=1) <= np.where(is_vehicle, _NEAR_M, _NEAR_PERSON_M),
        is_unseen=is_unseen,
        camera_scores=scores,
        fits=fits,
        spread_ratios=ratios,
        ious=ious,
    )
    return seen, named[(named.in_image != "") | (named.above != "")]


def _names(vehicles: Vehicles, labels: Labels) -> NDArray[np.str_]:
    """Return (N,) names of the surest vehicles near labelled objects; empty without one."""
    detections, has_sides = vehicles.fused.detections, SizePriors.of(labels.types).has_sides
    away_m = center_distances_m(labels.boxes_velo, vehicles.boxes)
    is_near = away_m <= np.where(has_sides, _NEAR_M, _NEAR_PERSON_M)[:, None]
    is_near &= has_sides[:, None] == SizePriors.of(detections.types).has_sides
    existence = np.hstack(
        [np.full((len(labels), 1), _MIN_EXISTENCE), is_near * vehicles.fused.existence]
    )
    return np.asarray(np.append("", detections.types)[existence.argmax(axis=1)], np.str_)


def _fit(vehicles: Vehicles, labels: Labels) -> Bool:
    """Return (V,) whether the rectangle of each vehicle fits a label of its class."""
    detections = vehicles.fused.detections
    overlap = iou_px(detections.boxes_px, labels.boxes_px)
    overlap *= detections.types[:, None] == labels.types
    has_sides = SizePriors.of(detections.types).has_sides
    min_iou = np.where(has_sides, _MIN_IOU_PX, _MIN_PERSON_IOU_PX)
    return np.asarray(overlap.max(axis=1) >= min_iou)
