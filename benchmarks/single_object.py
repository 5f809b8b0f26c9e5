"""Tracking one object: every tracker on the same frames, and the filters of its colour model."""

import logging
from collections.abc import Callable

import numpy as np

from benchmarks.measure import Contender, time_interleaved
from benchmarks.reference.color_filters import time_color_filters
from benchmarks.stages import Comparison, PreparedDrive
from perception.errors import DriveError, PerceptionError
from perception.pipeline import Pipeline, PipelineConfig
from perception.tracking.single_object.handover import tracker_input_of
from perception.tracking.single_object.tracker import TrackerInput
from perception.tracking.single_object.trackers import TRACKERS, single_object_tracker
from perception.types import Boxes3D

log = logging.getLogger(__name__)

_COLORS_IN_USE = 70  # the thesis' mean (5.3.3)


def compare_single_object_trackers(prepared: PreparedDrive) -> Comparison:
    """Let every tracker track the object of the first frame that is labelled longest."""
    config = PipelineConfig.for_motion("none")
    pipeline = Pipeline(prepared.drive.sensor, config)
    tracker_inputs = [
        tracker_input_of(pipeline.step(frame), config.ego_vehicle) for frame in prepared.frames
    ]
    track_id, box_velo = _longest(prepared)

    def contender(name: str) -> Contender:
        tracker = single_object_tracker(name, prepared.drive.sensor)
        tracker.init(
            tracker_inputs[0], box_velo
        )  # one in the image alone refuses where there is none
        return Contender(name, _tracking(tracker.init, tracker.update, tracker_inputs, box_velo))

    contenders: list[Contender] = []
    for name in TRACKERS:
        try:
            contenders.append(contender(name))
        except PerceptionError as error:
            log.warning("not measured: %s", error)
    timings = time_interleaved(contenders, len(tracker_inputs))
    return Comparison(f"tracking one object, track {track_id}", timings, {})


def compare_color_filters(_: PreparedDrive) -> Comparison:
    """Filter the bins of a colour model by one batch of filters and by a loop over them."""
    title = f"colour model, {_COLORS_IN_USE} of 512 bins in use"
    return Comparison(title, time_color_filters(_COLORS_IN_USE), {})


def _tracking(
    init: Callable[[TrackerInput, Boxes3D], object],
    update: Callable[[TrackerInput], object],
    tracker_inputs: list[TrackerInput],
    box_velo: Boxes3D,
) -> Callable[[int], object]:
    return lambda i: update(tracker_inputs[i]) if i else init(tracker_inputs[0], box_velo)


def _longest(prepared: PreparedDrive) -> tuple[int, Boxes3D]:
    """Return the track of the first frame that is labelled in most frames, and its first box."""
    if not prepared.drive.has_labels:
        raise DriveError(
            prepared.drive.root, expected="labels of the object to track", found="none"
        )
    labels = [prepared.drive.labels(frame.index) for frame in prepared.frames]
    later = np.concatenate([of_frame.track_ids for of_frame in labels])
    stays = [int(np.count_nonzero(later == track_id)) for track_id in labels[0].track_ids]
    if not stays or max(stays) < 2:
        raise DriveError(
            prepared.drive.root,
            expected="a labelled object in the first frame",
            found="none in a later frame",
        )
    longest = int(np.argmax(stays))
    return int(labels[0].track_ids[longest]), labels[0].boxes_velo[longest : longest + 1]
