"""Ground by other libraries: a surface, or the points that are ground; all are measured alike."""

from collections.abc import Callable

import numpy as np
from scipy.spatial import KDTree

from perception.errors import optional_package
from perception.obstacles.ground_planes import PiecewisePlanes
from perception.sensor import LidarModel
from perception.types import Bool, Float, Float32, Float64

# (N, 4) points of a scan to (N,) whether each is ground.
ClassifyGround = Callable[[Float32], Bool]

_HEIGHT_ON_KITTI_M = 1.73


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
