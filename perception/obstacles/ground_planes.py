"""The ground of the thesis: piecewise planes over slices of the road ahead (5.1.2).

        |<- S0 ->|  S1 | S2  |  S3    | S4      |  S5          |       slices, wider with range
    ____v________|_____|_____|________|_________|_____________ |
    behind      λ0    λ1    λ2       λ3        λ4            reach

Each slice is gated by the quartiles of its heights, fitted by RANSAC, and accepted only where its plane continues the
one before.
"""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from perception.geometry.grids import LocalArea
from perception.geometry.planes import planes_through
from perception.obstacles.config import PiecewisePlanesConfig
from perception.sensor import LidarModel
from perception.types import Bool, Float, Float64, Int

# The thesis does not check its first plane: a car beside the sensor can tip it on its side. This is its largest distance
# from level ground below the sensor.
_MAX_FIRST_STEP_M = 0.5


@dataclass(frozen=True)
class PiecewisePlanes:
    """N + 1 planes a x + b y + c z + d = 0 with unit normals up, each over an interval of x.

    Attributes:
        edges_m: (N,) x at which the plane changes.
        planes: (N + 1, 4) accepted planes.
        proposed: (N + 1, 4) planes of RANSAC before the validation; NaN where there is none.
        gates_m: (N + 1, 2) lowest and highest z of each slice's gate; NaN if the slice is empty.
        is_valid: (N + 1,) whether the proposed plane was accepted.
    """

    edges_m: Float64
    planes: Float64
    proposed: Float64
    gates_m: Float64
    is_valid: Bool

    def slice_of(self, x_m: Float) -> Int:
        """Return the number of the slice that each x lies in."""
        return np.searchsorted(self.edges_m, x_m, side="right")

    def height_m(self, xy_m: Float) -> Float64:
        """Return (N,) the z of the ground at (N, 2) positions."""
        a, b, c, d = self.planes[self.slice_of(xy_m[:, 0])].T
        return np.asarray(-(a * xy_m[:, 0] + b * xy_m[:, 1] + d) / c)

    def distance_m(self, points_velo: Float) -> Float:
        """Return (N,) signed distances of (N, 3+) points from the plane of their slice."""
        points = np.asarray(points_velo[:, :3], np.float64)
        planes: Float64 = self.planes[self.slice_of(points[:, 0])]
        along_normal: Float64 = (points * planes[:, :3]).sum(axis=1)
        return along_normal + planes[:, 3]


def slice_edges_m(
    height_m: float, elevation_step_rad: float, reach_m: float, config: PiecewisePlanesConfig
) -> Float64:
    """Return λ0, λ1, ... λN: equally many beams meet the ground in each slice (5.2)."""
    first_rad = np.arctan(config.first_edge_m / height_m)
    step_rad = config.steps_per_slice * elevation_step_rad
    slices = int((np.arctan(reach_m / height_m) - first_rad) / step_rad)
    return np.asarray(height_m * np.tan(first_rad + step_rad * np.arange(slices + 1)))


def slice_starts_m(edges_m: Float64, reach_m: float) -> Float64:
    """Return x at which the slices after S0 start; they cover all up to the reach.

    The floor of N leaves some metres beyond λN. They join the last slice, or become one of their own
    where they are wider than it.
    """
    leftover_m = reach_m - edges_m[-1]
    joins = len(edges_m) > 1 and leftover_m < edges_m[-1] - edges_m[-2]
    return edges_m[:-1] if joins else edges_m


def quartile_gate_m(heights_m: Float) -> tuple[float, float]:
    """Return the limits Q25 - 0.5 IQR and Q75 that ground points lie between."""
    low, high = np.percentile(heights_m, (25, 75))
    return float(low - 0.5 * (high - low)), float(high)


def best_supported_plane(points: Float64, samples: Int, inlier_m: float) -> Float64:
    """Return the plane (4,) with the most inliers among those through (T, 3) samples of (N, 3) points."""
    planes = planes_through(points[samples])
    distances = np.abs(planes[:, :3] @ points.T + planes[:, 3:])
    return np.asarray(planes[np.argmax((distances < inlier_m).sum(axis=1))])


def fit_plane(points: Float64) -> Float64:
    """Return the least-squares plane z = p x + q y + r of (N, 3) points as (4,) with unit normal up."""
    center = points.mean(axis=0)
    offset = points - center
    slope = np.linalg.lstsq(offset[:, :2], offset[:, 2], rcond=None)[0]
    normal = np.array([-slope[0], -slope[1], 1.0])
    normal /= np.linalg.norm(normal)
    return np.append(normal, -normal @ center)


def ransac_plane(
    points: Float64, config: PiecewisePlanesConfig, random: np.random.Generator
) -> Float64:
    """Fit a plane (4,) to (N, 3) points by 3-point RANSAC on a subsample; NaN where all line up.

    Unlike in the thesis, the best plane is fitted again to all its inliers.
    """
    if len(points) > config.subsample:
        points = points[random.integers(len(points), size=config.subsample)]
    samples = random.integers(len(points), size=(config.iterations, 3))
    plane = best_supported_plane(points, samples, config.inlier_m)
    inliers = np.abs(points @ plane[:3] + plane[3]) < config.inlier_m
    return fit_plane(points[inliers]) if inliers.sum() > 3 else plane


@dataclass(frozen=True)
class PlaneStep:
    """Difference of a plane from the one before.

    Attributes:
        angle_rad: δψ between the normals.
        step_m: δZ between the heights on the common edge, at y = 0.
    """

    angle_rad: float
    step_m: float


def plane_step(before: Float64, after: Float64, edge_m: float) -> PlaneStep:
    """Compare two planes where they meet (thesis 5.1.2)."""
    cross = np.linalg.norm(np.cross(before[:3], after[:3]))
    with np.errstate(divide="ignore", invalid="ignore"):  # an upright plane has no height
        heights = [-(plane[0] * edge_m + plane[3]) / plane[2] for plane in (before, after)]
    return PlaneStep(
        angle_rad=float(np.arctan2(cross, abs(before[:3] @ after[:3]))),
        step_m=float(abs(heights[1] - heights[0])),
    )


def validate(
    proposed: Float64, edges_m: Float64, level: Float64, config: PiecewisePlanesConfig
) -> tuple[Float64, Bool]:
    """Accept each plane that continues the one before, and copy that one elsewhere (Algorithm 3).

    The nearest plane is the reference, held only against level ground at the sensor's height.

    Args:
        proposed: (N + 1, 4) planes, NaN where none was found.
        edges_m: (N,) x of the edges between the planes.
        level: (4,) level ground at the sensor's height.
        config: Largest angle and step.

    Returns:
        (N + 1, 4) planes and (N + 1,) which of them were accepted.
    """
    planes, is_valid = proposed.copy(), np.zeros(len(proposed), bool)
    before = level
    for k, edge_m in enumerate([0.0, *edges_m]):
        step = plane_step(before, proposed[k], edge_m)
        limit_m = config.max_step_m if k else _MAX_FIRST_STEP_M
        is_valid[k] = step.angle_rad < config.max_angle_rad and step.step_m < limit_m
        planes[k] = before = proposed[k] if is_valid[k] else before
    return planes, is_valid


@dataclass(frozen=True)
class PiecewisePlanesEstimator:
    """Estimates the piecewise planes of a cloud.

    Attributes:
        sensor: LiDAR model, whose beams set the slices.
        area: Local area in which the ground is estimated.
        config: Configuration of the planes.
    """

    sensor: LidarModel
    area: LocalArea = field(default_factory=LocalArea)
    config: PiecewisePlanesConfig = field(default_factory=PiecewisePlanesConfig)

    def estimate(self, points_velo: Float, random: np.random.Generator) -> PiecewisePlanes:
        """Slice, gate, fit and validate (Algorithm 3).

        Args:
            points_velo: (N, 3+) a scan, or merged scans in the newest one's frame.
            random: Random generator of RANSAC.
        """
        points = points_velo[self.area.contains_xy(points_velo), :3].astype(np.float64)
        edges_m = self._edges_m()
        fits = [self._fit_slice(points[rows], random) for rows in self._slices(points, edges_m)]
        proposed, gates_m = np.stack([fit[0] for fit in fits]), np.stack([fit[1] for fit in fits])
        level = np.array([0.0, 0.0, 1.0, self.sensor.height_m])
        planes, is_valid = validate(proposed, edges_m, level, self.config)
        return PiecewisePlanes(edges_m, planes, proposed, gates_m, is_valid)

    def _edges_m(self) -> Float64:
        edges_m = slice_edges_m(
            self.sensor.height_m, self.sensor.elevation_step_rad, self.area.ahead_m, self.config
        )
        return slice_starts_m(edges_m, self.area.ahead_m)

    def _slices(self, points: Float64, edges_m: Float64) -> list[Bool]:
        """Return which points lie in S0, a disc around the sensor, and in the intervals of x after it."""
        x = points[:, 0]
        disc = np.hypot(x, points[:, 1]) < self.config.first_edge_m
        bounds = [*edges_m, self.area.ahead_m]
        return [disc, *((x >= low) & (x < high) for low, high in pairwise(bounds))]

    def _fit_slice(
        self, points: Float64, random: np.random.Generator
    ) -> tuple[Float64, tuple[float, float]]:
        """Gate one slice and fit its plane; NaN where too little is left."""
        if len(points) < 3:
            return np.full(4, np.nan), (np.nan, np.nan)
        low_m, high_m = quartile_gate_m(points[:, 2])
        gated = points[(points[:, 2] >= low_m) & (points[:, 2] <= high_m)]
        return ransac_plane(gated, self.config, random), (low_m, high_m)
