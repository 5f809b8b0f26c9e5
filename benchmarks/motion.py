"""Static and moving points: time, and moving points against exact truth."""

from collections.abc import Callable

import numpy as np

from benchmarks.measure import (
    Comparison,
    Contender,
    Measurement,
    add_peer,
    compare,
    confusion_columns,
)
from benchmarks.stages import PreparedDrive
from perception.errors import optional_package
from perception.evaluation.confusion import Confusion, confusion
from perception.evaluation.ground import UNLABELLED_CLASSES
from perception.evaluation.report import Column
from perception.obstacles.ground import ground_estimator
from perception.obstacles.motion_segmentation import motion_segmenter
from perception.types import Bool, Float32, Float64, GroundModel, Method, PointState

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


def compare_motion(prepared: PreparedDrive) -> Comparison:
    """Segment motion by free space, by the thesis' counters on the same ground, and by DUFOMap on whole scans."""
    sensor, config = prepared.drive.sensor, prepared.config
    estimator = ground_estimator(config.ground, "default", sensor, config.area_of(sensor))
    grounds = [estimator.update(window) for window in prepared.windows]

    def contender(name: str, method: Method) -> Contender:
        segmenter = motion_segmenter(config.motion, method, sensor, config.area_of(sensor))

        def run(i: int) -> Bool:
            states = segmenter.update(prepared.windows[i], grounds[i]).point_states
            return np.asarray(states == PointState.MOVING)

        return Contender(name, run)

    contenders = [
        contender("Trifuse", "default"),
        contender("thesis: counters (Fig. 5.6)", "thesis"),
    ]
    add_peer(contenders, lambda: _dufomap(prepared))
    columns = _columns(prepared, grounds)
    return compare("static and moving", contenders, len(prepared.frames), *columns)


def _dufomap(prepared: PreparedDrive) -> Contender:
    """Return DUFOMap with the scans so far: it maps a scan, then classifies its points."""
    map_and_classify = dufomap()

    def run(i: int) -> Bool:
        scan = prepared.windows[i].newest
        return map_and_classify(scan.points_velo, scan.world_SE3_velo)

    return Contender("DUFOMap, whole scan", run)


def _columns(prepared: PreparedDrive, grounds: list[GroundModel]) -> list[Column[Measurement]]:
    """Return the columns of moving points in the local area and below its height, where truth is exact."""
    area = prepared.config.area_of(prepared.drive.sensor)
    truths = [prepared.drive.point_truth(frame.index) for frame in prepared.frames]

    def count(moving: list[Bool]) -> Confusion:
        total = Confusion()
        for frame, ground, truth, moves in zip(
            prepared.frames, grounds, truths, moving, strict=True
        ):
            if truth is not None:
                counts = area.contains_xy(frame.points_velo)
                counts[counts] = ground.distance_m(frame.points_velo[counts]) < area.height_m
                counts &= ~np.isin(truth.classes, UNLABELLED_CLASSES)
                total += confusion(moves[counts], truth.is_moving[counts])
        return total

    return confusion_columns(count) if all(truth is not None for truth in truths) else []
