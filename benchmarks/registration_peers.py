"""Registration by other libraries."""

from collections.abc import Callable

import numpy as np

from perception.errors import optional_package
from perception.types import Float32, Float64

# (target points, source points, first guess of target_SE3_source) to target_SE3_source.
Register = Callable[[Float32, Float32, Float64], Float64]


def one_call_small_gicp() -> Register:
    """Return small_gicp's one-line call with its defaults on two threads."""
    with optional_package(
        "small_gicp", needed_for="the small_gicp registration peer", extra="bench"
    ):
        import small_gicp

    def register(target: Float32, source: Float32, guess: Float64) -> Float64:
        result = small_gicp.align(
            target[:, :3].astype(np.float64),
            source[:, :3].astype(np.float64),
            init_T_target_source=guess,
            num_threads=2,
        )
        return np.asarray(result.T_target_source)

    return register


def kiss_icp_odometry() -> Callable[[Float32], Float64]:
    """Return KISS-ICP with its defaults on one thread: the points of the next scan to its (4, 4) world_SE3_velo.

    Synthetic scans and those of KITTI are taken at one instant, so that nothing is deskewed.

    Raises:
        MissingDependencyError: The package is not installed.
    """
    with optional_package("kiss-icp", needed_for="the KISS-ICP peer", extra="bench"):
        from kiss_icp.config import load_config
        from kiss_icp.kiss_icp import KissICP
    config = load_config(None)
    config.data.deskew = False
    config.registration.max_num_threads = 1
    odometry = KissICP(config)

    def update(points_velo: Float32) -> Float64:
        odometry.register_frame(points_velo[:, :3].astype(np.float64), np.zeros(0))
        return np.array(odometry.last_pose)

    return update


def open3d_point_to_plane(voxel_size_m: float = 0.5, reach_m: float = 1.0) -> Register:
    """Return point-to-plane ICP by Open3D on scans thinned to one point a box."""
    with optional_package("open3d", needed_for="the Open3D registration peer", extra="bench"):
        import open3d
    registration = open3d.pipelines.registration

    def thin(points: Float32) -> object:
        cloud = open3d.geometry.PointCloud()
        cloud.points = open3d.utility.Vector3dVector(points[:, :3].astype(np.float64))
        return cloud.voxel_down_sample(voxel_size_m)

    def register(target: Float32, source: Float32, guess: Float64) -> Float64:
        fixed, moving = thin(target), thin(source)
        fixed.estimate_normals()  # type: ignore[attr-defined]
        found = registration.registration_icp(
            moving,
            fixed,
            reach_m,
            guess,
            registration.TransformationEstimationPointToPlane(),
        )
        return np.asarray(found.transformation)

    return register
