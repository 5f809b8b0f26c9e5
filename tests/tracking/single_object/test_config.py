"""Each tracker of one object uses its part of the configuration."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from perception.errors import UsageError
from perception.sensor import HDL_64E
from perception.tracking.single_object.config import (
    ColorModelConfig,
    SingleObjectTrackerConfig,
    TrackerName,
)
from perception.tracking.single_object.tracker import TrackerInput
from perception.tracking.single_object.trackers import TRACKERS, single_object_tracker
from perception.types import Boxes3D

DEFAULT = SingleObjectTrackerConfig()


def test_every_name_that_opencv_supports_makes_a_tracker():
    assert set(TRACKERS) <= set(get_args(TrackerName))
    for name in TRACKERS:
        assert hasattr(single_object_tracker(name, HDL_64E), "update")


@pytest.mark.parametrize(
    ("change", "found"), [({"bins_per_channel": 5}, "5"), ({"ring_scale": 1.0}, "1.0")]
)
def test_invalid_colour_models_are_errors(change, found):
    with pytest.raises(UsageError) as caught:
        ColorModelConfig(**change)
    assert (caught.value.where, caught.value.found) == ("colour model", found)


def test_an_unknown_name_is_an_error():
    with pytest.raises(UsageError) as caught:
        single_object_tracker("nobody", HDL_64E)
    assert caught.value.found == "nobody"


@pytest.mark.parametrize("name", ["default", "h-fus", "3d-ms", "3d-kf"])
def test_the_time_until_an_object_is_lost_is_that_of_the_config(name):
    config = replace(
        DEFAULT,
        box=replace(DEFAULT.box, lost_after_s=0.25),
        point=replace(DEFAULT.point, lost_after_s=0.25),
    )
    tracker = single_object_tracker(name, HDL_64E, config)
    box = Boxes3D(np.array([[10.0, 2.0, -1.73]]), np.array([[4.0, 1.8, 1.5]]), np.zeros(1))
    inputs = [TrackerInput(0.1 * i, np.zeros((0, 4), np.float32), np.eye(4)) for i in range(5)]
    tracker.init(inputs[0], box)
    states = [str(tracker.update(tracker_input).status) for tracker_input in inputs[1:]]
    assert states == ["predicted", "predicted", "lost", "lost"]
