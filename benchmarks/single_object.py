"""Tracking one object: every tracker on the same frames, and the filters of its colour model."""

import logging

import numpy as np

from benchmarks.measure import Comparison, Contender, compare
from benchmarks.reference.color_filters import ReferenceAdaptiveColors, wandering_ratios
from benchmarks.stages import PreparedDrive
from perception.errors import DriveError, PerceptionError
from perception.pipeline import Pipeline, PipelineConfig
from perception.tracking.single_object.color_model import AdaptiveColorModel
from perception.tracking.single_object.handover import tracker_input_of
from perception.tracking.single_object.trackers import TRACKERS, single_object_tracker
from perception.types import Boxes3D

log = logging.getLogger(__name__)

_COLORS_IN_USE = 70  # the thesis' mean (5.3.3)
_IMAGES = 50


def compare_single_object_trackers(prepared: PreparedDrive) -> Comparison:
    """Let every tracker track the object of the first frame that is labelled longest."""
    config = PipelineConfig.for_motion("none")
    pipeline = Pipeline(prepared.drive.sensor, config)
    inputs = [
        tracker_input_of(pipeline.step(frame), config.ego_vehicle) for frame in prepared.frames
    ]
    track_id, box_velo = _longest(prepared)

    def contender(name: str) -> Contender:
        tracker = single_object_tracker(name, prepared.drive.sensor)

        def run(i: int) -> object:
            return tracker.update(inputs[i]) if i else tracker.init(inputs[0], box_velo)

        run(0)  # a tracker in the image refuses a drive without one
        return Contender(name, run)

    contenders: list[Contender] = []
    for name in TRACKERS:
        try:
            contenders.append(contender(name))
        except PerceptionError as error:
            log.warning("not measured: %s", error)
    return compare(f"tracking one object, track {track_id}", contenders, len(inputs))


def compare_color_filters(_: PreparedDrive) -> Comparison:
    """Filter the bins of a colour model by one batch of filters and by a loop over them."""
    ratios = wandering_ratios(_COLORS_IN_USE, _IMAGES)
    batch, reference = AdaptiveColorModel(), ReferenceAdaptiveColors()
    contenders = [
        Contender("Trifuse", lambda i: batch.update(ratios[i])),
        Contender("reference: one filter per bin", lambda i: reference.update(ratios[i])),
    ]
    return compare(f"colour model, {_COLORS_IN_USE} of 512 bins in use", contenders, _IMAGES)


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
