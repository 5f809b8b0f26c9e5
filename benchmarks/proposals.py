"""Clustering and proposals: Trifuse, the reference implementation and scikit-learn on the same points."""

from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks.measure import Comparison, Contender, add_peer, compare, metric
from benchmarks.reference.proposals import boxes_by_loop, cluster_by_definition
from benchmarks.stages import PreparedDrive
from perception.detection.clustering import cluster
from perception.detection.config import ProposalConfig
from perception.detection.depthcn.above_ground import find_above_ground
from perception.detection.depthcn.proposals import propose
from perception.detection.height_cells import HeightCells
from perception.errors import optional_package
from perception.evaluation.detection.proposal_recall import count_recalled
from perception.maps.projection import camera_of
from perception.types import Bool, Float64, Int, Labels, Method

_CONFIG = ProposalConfig()
_OVERLAPS = (0.5, 0.7)


def compare_clusters(prepared: PreparedDrive) -> Comparison:
    """Cluster the points above ground in the camera's view by DBSCAN (6.1.2); compare the labels."""
    places_m = []
    for frame in prepared.frames:
        cells = _CONFIG.cell_m, _CONFIG.min_variance_m2
        above_ground = find_above_ground(frame.points_velo, *camera_of(frame), *cells, "thesis")
        places_m.append(above_ground.xy_m)
    reference = Contender("reference: by definition", _clustering(cluster_by_definition, places_m))
    return _compare_clusters("clusters in view", places_m, [reference])


def compare_clusters_full_scan(prepared: PreparedDrive) -> Comparison:
    """Cluster the points above ground of a whole scan, for which the reference takes minutes."""
    places_m = []
    for frame in prepared.frames:
        cells = HeightCells.of(frame.points_velo, _CONFIG.cell_m)
        above_ground = frame.points_velo[cells.has_variance(_CONFIG.min_variance_m2)]
        places_m.append(above_ground[:, :2].astype(np.float64))
    return _compare_clusters("clusters of a full scan", places_m, [])


def compare_proposals(prepared: PreparedDrive) -> Comparison:
    """Propose boxes from the scan, and measure the share of the cars in view that they reach."""
    views = [(frame.points_velo, *camera_of(frame)) for frame in prepared.frames]

    def proposals(method: Method) -> Callable[[int], Float64]:
        return lambda i: propose(*views[i], _CONFIG, method).boxes_px

    contenders = [
        Contender("Trifuse", proposals("default")),
        Contender("thesis: cells that vary", proposals("thesis")),
        Contender("reference: loop", lambda i: boxes_by_loop(*views[i], _CONFIG)),
    ]
    title = "proposals"
    metrics = [metric("boxes", lambda boxes_px: float(np.mean([*map(len, boxes_px)])), ".1f")]
    if prepared.drive.has_labels:
        cars_px = [_cars_px(prepared.drive.labels(i)) for i in range(len(views))]
        title = f"proposals, {sum(map(len, cars_px))} cars"
        metrics += [
            metric(f"cars at IoU {iou:g} [%]", partial(_reached_percent, cars_px, iou), ".1f")
            for iou in _OVERLAPS
        ]
    return compare(title, contenders, len(views), *metrics)


def _compare_clusters(title: str, places_m: list[Float64], others: list[Contender]) -> Comparison:
    contenders = [Contender("Trifuse", _clustering(cluster, places_m)), *others]
    add_peer(contenders, lambda: Contender("scikit-learn", _clustering(_scikit_learn(), places_m)))
    expected = [contenders[0].run(i) for i in range(len(places_m))]

    def equal_frames(labels: list[Int]) -> str:
        return f"{sum(map(np.array_equal, labels, expected))} of {len(labels)}"

    return compare(title, contenders, len(places_m), metric("equal frames", equal_frames, ""))


def _clustering(
    method: Callable[[Float64, float, int], Int], places_m: list[Float64]
) -> Callable[[int], Int]:
    return lambda i: method(places_m[i], _CONFIG.radius_m, _CONFIG.min_points)


def _scikit_learn() -> Callable[[Float64, float, int], Int]:
    with optional_package("scikit-learn", needed_for="the DBSCAN peer", extra="bench"):
        from sklearn.cluster import DBSCAN

    def fit(xy_m: Float64, radius_m: float, min_points: int) -> Int:
        if len(xy_m) == 0:  # which it refuses
            return np.zeros(0, np.int64)
        found: Int = DBSCAN(eps=radius_m, min_samples=min_points).fit_predict(xy_m)
        return found

    return fit


def _cars_px(labels: Labels) -> Float64:
    """Return the boxes of the cars of KITTI's moderate difficulty."""
    height_px = labels.boxes_px[:, 3] - labels.boxes_px[:, 1]
    is_moderate: Bool = (labels.occlusion <= 1) & (labels.truncation <= 0.3) & (height_px >= 25)
    return np.asarray(labels.boxes_px[is_moderate & (labels.types == "Car")])


def _reached_percent(
    cars_px: list[Float64], min_iou: float, boxes_px: list[Float64]
) -> float | None:
    cars = sum(map(len, cars_px))
    pairs = zip(cars_px, boxes_px, strict=True)
    found = sum(int(count_recalled(truths, boxes, [min_iou])[0]) for truths, boxes in pairs)
    return 100 * found / cars if cars else None
