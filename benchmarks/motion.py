"""Static and moving points: time, and moving points against exact truth."""

import numpy as np

from benchmarks.measure import (
    Comparison,
    Contender,
    Measurement,
    add_peer,
    compare,
    confusion_columns,
)
from benchmarks.motion_peers import dufomap
from benchmarks.stages import PreparedDrive
from perception.evaluation.confusion import Confusion, confusion
from perception.evaluation.ground import UNLABELLED_CLASSES
from perception.evaluation.report import Column
from perception.obstacles.ground import ground_estimator
from perception.obstacles.motion_segmentation import motion_segmenter
from perception.types import Bool, GroundModel, Method, PointState


def compare_motion(prepared: PreparedDrive) -> Comparison:
    """Segment motion by free space, by the thesis' counters on the same ground, and by DUFOMap on whole scans."""
    sensor, config = prepared.drive.sensor, prepared.config
    estimator = ground_estimator(config.ground, "default", sensor, config.area)
    grounds = [estimator.update(window) for window in prepared.windows]

    def contender(name: str, method: Method) -> Contender:
        segmenter = motion_segmenter(config.motion, method, sensor, config.area)

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
    area = prepared.config.area
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
