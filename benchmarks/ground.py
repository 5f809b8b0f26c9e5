"""Ground of the newest scan: time, and errors at labelled objects and of points against exact truth."""

from dataclasses import dataclass

import numpy as np

from benchmarks.ground_peers import ClassifyGround, LocalPlanes, RansacPlane, line_fit, patchwork
from benchmarks.measure import (
    Comparison,
    Contender,
    Measurement,
    add_peer,
    compare,
    confusion_columns,
    metric,
)
from benchmarks.stages import PreparedDrive
from perception.evaluation.confusion import Confusion
from perception.evaluation.ground import (
    GroundErrors,
    ground_confusion,
    ground_errors,
    mean_displacement_error,
)
from perception.evaluation.report import Column
from perception.geometry.grids import LocalArea
from perception.obstacles.above_ground import split_by_ground
from perception.obstacles.ground import ground_estimator
from perception.types import Bool, Float, GroundModel, Method, PointState

# A junction; the figures of all contenders are those of the common area.
_JUNCTION = LocalArea(ahead_m=40.0, behind_m=40.0, side_m=40.0)


@dataclass(frozen=True)
class SegmentedGround:
    """Ground of one scan.

    Attributes:
        is_ground: (N,) Whether each point of the scan is ground.
        surface: Surface in the LiDAR frame; None where only points were classified.
    """

    is_ground: Bool
    surface: GroundModel | None = None


def compare_ground(prepared: PreparedDrive) -> Comparison:
    """Classify the points of the newest scan by both methods, one plane, and methods that classify points alone."""
    sensor, config = prepared.drive.sensor, prepared.config
    default_m = config.motion.free_space.min_ground_distance_m
    thesis_m = config.motion.counters.min_ground_distance_m

    def plane() -> Contender:
        peer = RansacPlane()

        def run(i: int) -> SegmentedGround:
            points_velo = prepared.frames[i].points_velo
            surface = peer.estimate(points_velo[config.area.contains_xy(points_velo)])
            return _segmented(points_velo, surface, config.area, default_m)

        return Contender("one RANSAC plane (Open3D)", run)

    contenders = [
        _contender("Trifuse", "default", prepared, config.area, default_m),
        _contender("Trifuse, 80 m x 80 m", "default", prepared, _JUNCTION, default_m),
        _contender("thesis: piecewise planes", "thesis", prepared, config.area, thesis_m),
    ]
    add_peer(contenders, plane)
    add_peer(
        contenders, lambda: _whole_scan("Patchwork++, whole scan", patchwork(sensor), prepared)
    )
    add_peer(contenders, lambda: _whole_scan("line fit, whole scan", line_fit(sensor), prepared))
    return compare("ground", contenders, len(prepared.frames), *_error_columns(prepared))


def _contender(
    name: str,
    method: Method,
    prepared: PreparedDrive,
    area: LocalArea,
    min_ground_distance_m: float,
) -> Contender:
    estimator = ground_estimator(prepared.config.ground, method, prepared.drive.sensor, area)

    def run(i: int) -> SegmentedGround:
        surface = estimator.update(prepared.windows[i])
        points_velo = prepared.frames[i].points_velo
        return _segmented(points_velo, surface, area, min_ground_distance_m)

    return Contender(name, run)


def _whole_scan(name: str, classify: ClassifyGround, prepared: PreparedDrive) -> Contender:
    return Contender(name, lambda i: SegmentedGround(classify(prepared.frames[i].points_velo)))


def _segmented(
    points_velo: Float, surface: GroundModel, area: LocalArea, min_ground_distance_m: float
) -> SegmentedGround:
    is_ground = np.zeros(len(points_velo), bool)
    rows = split_by_ground(points_velo, surface, area, min_ground_distance_m).ground_rows
    is_ground[rows] = True
    return SegmentedGround(is_ground, surface)


def _error_columns(prepared: PreparedDrive) -> list[Column[Measurement]]:
    """Return the errors that the drive's labels and truth allow."""
    drive, area = prepared.drive, prepared.config.area
    truths = [drive.point_truth(frame.index) for frame in prepared.frames]

    def mde_mm(grounds: list[SegmentedGround]) -> float:
        errors = []
        for frame, ground in zip(prepared.frames, grounds, strict=True):
            surface = ground.surface or LocalPlanes(frame.points_velo[ground.is_ground])
            bottoms_m = drive.labels(frame.index).boxes_velo.bottom_m
            errors.append(ground_errors(frame.index, surface, bottoms_m, area))
        return 1e3 * mean_displacement_error(GroundErrors.concatenate(errors)).mde_m

    def count(grounds: list[SegmentedGround]) -> Confusion:
        total = Confusion()
        for frame, truth, ground in zip(prepared.frames, truths, grounds, strict=True):
            if truth is not None:
                states = np.where(ground.is_ground, PointState.GROUND, PointState.STATIC)
                by_range = ground_confusion(
                    frame.points_velo, states.astype(np.uint8), truth.classes, area
                )
                total = sum(by_range.values(), total)
        return total

    columns = [metric("mDE [mm]", mde_mm, ".1f")] if drive.has_labels else []
    if all(truth is not None for truth in truths):
        columns += confusion_columns(count)
    return columns
