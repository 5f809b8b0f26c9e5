"""Tracks of nuScenes' results beside the labels of their samples, as its tracking task counts them."""

from collections.abc import Sequence

import numpy as np

from data.nuscenes.results import SampleBoxes
from data.nuscenes.samples import Sample
from perception.evaluation.nuscenes.boxes import TaskBoxes
from perception.evaluation.nuscenes.tracking import TaskTracks, TrackedScene
from perception.types import Float64, Int


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
