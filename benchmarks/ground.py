"""Ground of the newest scan: time, and errors at labelled objects and of points against exact truth."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

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
from perception.errors import optional_package
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
from perception.obstacles.ground_planes import PiecewisePlanes
from perception.sensor import LidarModel
from perception.types import Bool, Float, Float32, Float64, GroundModel, Method, PointState

# (N, 4) points of a scan to (N,) whether each is ground.
ClassifyGround = Callable[[Float32], Bool]

_HEIGHT_ON_KITTI_M = 1.73
# A junction; the figures of all contenders are those of the common area.
_JUNCTION = LocalArea(ahead_m=40.0, behind_m=40.0, side_m=40.0)


class LocalPlanes:
    """A surface given by its points: a least-squares plane through the nearest ones, wherever asked."""

    def __init__(self, ground_points_velo: Float, neighbours: int = 50) -> None:
        self._points = np.asarray(ground_points_velo[:, :3], np.float64)
        self._tree = KDTree(self._points[:, :2])
        self._neighbours = min(neighbours, len(self._points))

    def _planes(self, xy_m: Float) -> tuple[Float64, Float64]:
        """Return (N, 3) centroids and (N, 3) upward unit normals around (N, 2) positions."""
        _, rows = self._tree.query(xy_m, k=self._neighbours)
        near = self._points[rows]
        centroids = near.mean(axis=1)
        centred = near - centroids[:, None]
        _, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", centred, centred))
        normals = vectors[:, :, 0]
        return centroids, normals * np.sign(normals[:, 2:3])

    def height_m(self, xy_m: Float) -> Float64:
        """Return (N,) the z of the ground at (N, 2) positions."""
        centroids, normals = self._planes(xy_m)
        slope = ((xy_m - centroids[:, :2]) * normals[:, :2]).sum(axis=1)
        return np.asarray(centroids[:, 2] - slope / normals[:, 2])

    def distance_m(self, points_velo: Float) -> Float:
        """Return (N,) signed distances of (N, 3+) points, up positive."""
        centroids, normals = self._planes(points_velo[:, :2])
        return np.asarray(((points_velo[:, :3] - centroids) * normals).sum(axis=1))


def patchwork(sensor: LidarModel) -> ClassifyGround:
    """Return Patchwork++ with its own defaults.

    Raises:
        MissingDependencyError: The package is not installed.
    """
    with optional_package("pypatchworkpp", needed_for="the Patchwork++ peer", extra="bench"):
        import pypatchworkpp
    parameters = pypatchworkpp.Parameters()
    parameters.verbose = False
    parameters.sensor_height = sensor.height_m
    estimator = pypatchworkpp.patchworkpp(parameters)

    def classify(points_velo: Float32) -> Bool:
        estimator.estimateGround(points_velo)
        is_ground = np.zeros(len(points_velo), bool)
        is_ground[np.ravel(estimator.getGroundIndices())] = True
        return is_ground

    return classify


def line_fit(sensor: LidarModel) -> ClassifyGround:
    """Return the line fits of Himmelsbach et al. (2010), with the defaults of the package, which are for KITTI.

    Raises:
        MissingDependencyError: The package is not installed.
    """
    with optional_package("linefit", needed_for="the line fit peer", extra="bench"):
        import linefit
    estimator = linefit.ground_seg()
    raised_m = np.array([0.0, 0.0, sensor.height_m - _HEIGHT_ON_KITTI_M], np.float32)

    def classify(points_velo: Float32) -> Bool:
        labels = estimator.run(np.ascontiguousarray(points_velo[:, :3] + raised_m))
        return np.ravel(labels).astype(bool)

    return classify


class RansacPlane:
    """One plane for the whole area, by Open3D's RANSAC."""

    def __init__(self, distance_m: float = 0.1, iterations: int = 200) -> None:
        with optional_package("open3d", needed_for="the RANSAC plane peer", extra="bench"):
            import open3d
        self._open3d, self._distance_m, self._iterations = open3d, distance_m, iterations

    def estimate(self, points_velo: Float) -> PiecewisePlanes:
        """Fit one plane to the points, its unit normal up."""
        cloud = self._open3d.geometry.PointCloud()
        cloud.points = self._open3d.utility.Vector3dVector(
            np.asarray(points_velo[:, :3], np.float64)
        )
        self._open3d.utility.random.seed(0)
        coefficients, _ = cloud.segment_plane(self._distance_m, 3, self._iterations)
        scale = np.linalg.norm(coefficients[:3]) * np.sign(coefficients[2])
        plane = np.array([coefficients]) / scale
        return PiecewisePlanes(np.zeros(0), plane, plane, np.full((1, 2), np.nan), np.ones(1, bool))


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
    area = config.area_of(sensor)
    default_m = config.motion.free_space.min_ground_distance_m
    thesis_m = config.motion.counters.min_ground_distance_m

    def plane() -> Contender:
        peer = RansacPlane()

        def run(i: int) -> SegmentedGround:
            points_velo = prepared.frames[i].points_velo
            surface = peer.estimate(points_velo[area.contains_xy(points_velo)])
            return _segmented(points_velo, surface, area, default_m)

        return Contender("one RANSAC plane (Open3D)", run)

    contenders = [
        _contender("Trifuse", "default", prepared, area, default_m),
        _contender("Trifuse, 80 m x 80 m", "default", prepared, _JUNCTION, default_m),
        _contender("thesis: piecewise planes", "thesis", prepared, area, thesis_m),
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
    drive, area = prepared.drive, prepared.config.area_of(prepared.drive.sensor)
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
