"""Comparisons of `trifuse bench`: each stage beside reference implementations, the thesis' method and libraries."""

from collections.abc import Callable, Mapping

from benchmarks.average_precision import compare_average_precision
from benchmarks.camera_detectors import compare_camera_detectors
from benchmarks.depthcn import compare_depthcn
from benchmarks.ground import compare_ground
from benchmarks.maps import compare_maps
from benchmarks.measure import Comparison
from benchmarks.motion import compare_motion
from benchmarks.moving_objects import (
    compare_filters,
    compare_moving_objects,
    compare_short_term_maps,
)
from benchmarks.proposals import compare_clusters, compare_clusters_full_scan, compare_proposals
from benchmarks.registration import compare_registration
from benchmarks.single_object import compare_color_filters, compare_single_object_trackers
from benchmarks.stages import PreparedDrive, compare_voxels
from benchmarks.vehicle_tracking import compare_vehicle_trackers
from benchmarks.video import compare_video
from perception.errors import optional_package

COMPARISONS: Mapping[str, Callable[[PreparedDrive], Comparison]] = {
    "registration": compare_registration,
    "ground": compare_ground,
    "voxels": compare_voxels,
    "motion": compare_motion,
    "objects": compare_moving_objects,
    "short-term-map": compare_short_term_maps,
    "kalman-filters": compare_filters,
    "single-object": compare_single_object_trackers,
    "color-model": compare_color_filters,
    "maps": compare_maps,
    "clusters": compare_clusters,
    "clusters-full-scan": compare_clusters_full_scan,
    "proposals": compare_proposals,
    "depthcn": compare_depthcn,
    "video": compare_video,
    "average-precision": lambda _: compare_average_precision(),
}


def _compare_detectors(prepared: PreparedDrive) -> Comparison:
    """Compare what needs torch, to make networks of.

    Raises:
        MissingDependencyError: A package is missing.
    """
    with optional_package(
        "torch, onnx and onnxscript", needed_for="the benchmark of detectors", extra="train"
    ):
        from benchmarks.detectors import compare_detectors
    return compare_detectors(prepared)


def _compare_bev(prepared: PreparedDrive) -> Comparison:
    """Compare what needs torch, for the samples of a training.

    Raises:
        MissingDependencyError: The package is missing.
    """
    with optional_package("torch", needed_for="the benchmark from above", extra="train"):
        from benchmarks.bev import compare_bev
    return compare_bev(prepared)


# Only where asked for by name: networks that take a minute to make, tracks that need labels, networks of others.
ON_REQUEST: Mapping[str, Callable[[PreparedDrive], Comparison]] = {
    "detectors": _compare_detectors,
    "bev": _compare_bev,
    "vehicle-tracking": compare_vehicle_trackers,
    "camera-detectors": compare_camera_detectors,
}
