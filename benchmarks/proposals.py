"""Clustering and proposals: Trifuse, the reference implementation and scikit-learn on the same points."""

from collections.abc import Callable

import numpy as np

from benchmarks.measure import Cell, Contender, time_interleaved
from benchmarks.reference.dbscan import cluster_by_definition
from benchmarks.reference.proposals import boxes_by_loop
from benchmarks.stages import Comparison, PreparedDrive, add_peer
from perception.detection.clustering import cluster
from perception.detection.config import ProposalConfig
from perception.detection.depthcn.above_ground import find_above_ground
from perception.detection.depthcn.proposals import propose
from perception.detection.height_cells import HeightCells
from perception.errors import MissingDependencyError
from perception.geometry.box_overlap_px import iou_px
from perception.maps.projection import camera_of
from perception.types import Bool, Float64, Int, Labels, Method

_RULES = ProposalConfig()
_OURS, _PEER = "Trifuse", "scikit-learn"
_OVERLAPS = (0.5, 0.7)


def compare_clusters(prepared: PreparedDrive) -> Comparison:
    """Cluster the points above ground in the camera's view by DBSCAN (6.1.2); compare the labels."""
    places_m = []
    for frame in prepared.frames:
        rules = _RULES.cell_m, _RULES.min_variance_m2
        places_m.append(
            find_above_ground(frame.points_velo, *camera_of(frame), *rules, "thesis").xy_m
        )
    reference = Contender("reference: by definition", _clustering(cluster_by_definition, places_m))
    return _compare("clusters in view", places_m, [reference])


def compare_clusters_full_scan(prepared: PreparedDrive) -> Comparison:
    """Cluster the points above ground of a whole scan, for which the reference takes minutes."""
    places_m = []
    for frame in prepared.frames:
        cells = HeightCells.of(frame.points_velo, _RULES.cell_m)
        above_ground = frame.points_velo[cells.has_variance(_RULES.min_variance_m2)]
        places_m.append(above_ground[:, :2].astype(np.float64))
    return _compare("clusters of a full scan", places_m, [])


def compare_proposals(prepared: PreparedDrive) -> Comparison:
    """Propose boxes from the scan, and measure the share of the cars in view that they reach."""
    views = [(frame.points_velo, *camera_of(frame)) for frame in prepared.frames]

    def ours(method: Method) -> Callable[[int], Float64]:
        return lambda i: propose(*views[i], _RULES, method).boxes_px

    contenders = [
        Contender(_OURS, ours("default")),
        Contender("thesis: cells that vary", ours("thesis")),
        Contender("reference: loop", lambda i: boxes_by_loop(*views[i], _RULES)),
    ]
    boxes_px: dict[str, list[Float64]] = {contender.name: [] for contender in contenders}
    timings = time_interleaved(
        contenders, len(views), lambda name, _, boxes: boxes_px[name].append(boxes)
    )
    metrics: dict[str, dict[str, Cell]] = {
        "boxes": {
            name: f"{np.mean([len(b) for b in found]):.1f}" for name, found in boxes_px.items()
        }
    }
    cars_px: list[Float64] = []
    if prepared.drive.has_labels:
        cars_px = [_cars_px(prepared.drive.labels(i)) for i in range(len(views))]
        for overlap in _OVERLAPS:
            metrics[f"cars at IoU {overlap:g} [%]"] = {
                name: _reached(cars_px, found, overlap) for name, found in boxes_px.items()
            }
    title = f"proposals, {sum(map(len, cars_px))} cars" if cars_px else "proposals"
    return Comparison(title, timings, metrics)


def _compare(title: str, places_m: list[Float64], others: list[Contender]) -> Comparison:
    contenders = [Contender(_OURS, _clustering(cluster, places_m)), *others]
    add_peer(contenders, lambda: Contender(_PEER, _clustering(_scikit_learn(), places_m)))
    labels: dict[str, list[Int]] = {contender.name: [] for contender in contenders}
    timings = time_interleaved(
        contenders, len(places_m), lambda name, _, found: labels[name].append(found)
    )
    same: dict[str, Cell] = {
        name: f"{sum(map(np.array_equal, found, labels[_OURS]))} of {len(found)}"
        for name, found in labels.items()
    }
    return Comparison(title, timings, {"equal frames": same})


def _clustering(
    method: Callable[[Float64, float, int], Int], places_m: list[Float64]
) -> Callable[[int], Int]:
    return lambda i: method(places_m[i], _RULES.radius_m, _RULES.min_points)


def _scikit_learn() -> Callable[[Float64, float, int], Int]:
    try:
        from sklearn.cluster import DBSCAN
    except ImportError as error:
        raise MissingDependencyError(
            "scikit-learn", needed_for="the DBSCAN peer", extra="bench", reason=error
        ) from error

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


def _reached(cars_px: list[Float64], boxes_px: list[Float64], overlap: float) -> Cell:
    best = [
        iou_px(cars, boxes).max(axis=1, initial=0)
        for cars, boxes in zip(cars_px, boxes_px, strict=True)
    ]
    every = np.concatenate(best)
    return f"{100 * np.mean(every >= overlap):.1f}" if len(every) else None
