"""Tracks beside the labels of their samples, as nuScenes' tracking task counts them: of its results, or of the pipeline."""

from collections.abc import Sequence

import numpy as np

from data.labelled_objects import task_classes
from data.nuscenes.results import SampleBoxes
from data.nuscenes.samples import Sample
from perception.evaluation.nuscenes.boxes import TaskBoxes, TaskDetections
from perception.evaluation.nuscenes.tracking import TaskTracks, TrackedScene
from perception.geometry.boxes import transform_boxes
from perception.types import Float64, Int, Vehicles


def tracked_boxes(vehicles: Vehicles, map_SE3_velo: Float64) -> SampleBoxes:
    """Return the vehicles of one sample that have an id and a 3D box, with the existence of their tracks as scores.

    Args:
        vehicles: Tracked vehicles.
        map_SE3_velo: (4, 4) pose of the LiDAR in the world of the labels.
    """
    rows = np.flatnonzero((vehicles.ids >= 0) & np.isfinite(vehicles.boxes.yaw_rad))
    boxes = transform_boxes(map_SE3_velo, vehicles.boxes[rows])
    types, scores = vehicles.fused.detections.types[rows], vehicles.fused.existence[rows]
    found = TaskDetections(
        types=task_classes(types.tolist()),
        centers_m=boxes.centers_m,
        size_m=boxes.size_m,
        yaw_rad=boxes.yaw_rad,
        velocities_m_s=vehicles.velocities_m_s[rows] @ map_SE3_velo[:2, :2].T,
        attributes=np.full(len(rows), ""),
        scores=scores,
    )
    return SampleBoxes(types, boxes, scores, vehicles.ids[rows], found)


def tracked_scene(samples: Sequence[tuple[Sample, SampleBoxes]]) -> TrackedScene:
    """Return the objects and the tracks of a scene that count.

    Args:
        samples: Samples in order of time, each with its results.
    """
    names = np.unique(np.concatenate([results.track_ids for _, results in samples]))
    truths, found = [TaskTracks.empty()], [TaskTracks.empty()]
    for number, (sample, results) in enumerate(samples):
        rows = np.flatnonzero(sample.surroundings.count(sample.truths) & sample.truths.has_points)
        seen, unscored = sample.truths[rows], np.zeros(len(rows))
        truths.append(_tracks(number, seen, sample.track_ids[rows], unscored))
        rows = np.flatnonzero(sample.surroundings.count(results.objects))
        ids = np.searchsorted(names, results.track_ids[rows])
        found.append(_tracks(number, results.objects[rows], ids, results.scores[rows]))
    stamps_us = np.array([sample.stamp_us for sample, _ in samples], np.int64)
    return TrackedScene(stamps_us, TaskTracks.concatenate(truths), TaskTracks.concatenate(found))


def _tracks(frame: int, boxes: TaskBoxes, ids: Int, scores: Float64) -> TaskTracks:
    frames = np.full(len(boxes), frame)
    return TaskTracks(boxes.types, frames, ids, boxes.centers_m[:, :2], scores)
