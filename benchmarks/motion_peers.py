"""Moving points by another library."""

from collections.abc import Callable

import numpy as np

from perception.errors import optional_package
from perception.types import Bool, Float32, Float64

# ((N, 4) points of the next scan, (4, 4) world_SE3_velo) to (N,) whether each point moves.
ClassifyMoving = Callable[[Float32, Float64], Bool]


def dufomap(
    voxel_size_m: float = 0.1, hit_margin_m: float = 0.2, unknown_margin: int = 1
) -> ClassifyMoving:
    """Return DUFOMap (Duberg et al., 2024), on one thread.

    Args:
        voxel_size_m: Edge of its voxels in metres.
        hit_margin_m: Distance behind a hit in metres that is no free space (d_s of the paper).
        unknown_margin: Number of voxels around unknown space that are not free (d_p of the paper).

    Raises:
        MissingDependencyError: The package is not installed.
    """
    with optional_package("dufomap", needed_for="the DUFOMap peer", extra="bench"):
        from dufomap import dufomap as make_map
    free_space = make_map(voxel_size_m, hit_margin_m, unknown_margin, num_threads=1)

    def classify(points_velo: Float32, world_SE3_velo: Float64) -> Bool:
        points = np.ascontiguousarray(points_velo[:, :3])
        free_space.run(points, world_SE3_velo, cloud_transform=True)
        labels = free_space.segment(points, world_SE3_velo, cloud_transform=True)
        return np.asarray(np.ravel(labels) == 1)

    return classify
