"""Every number of Table 7.5 has a flag and the value of the thesis; each tracker uses its part of the configuration."""

import math
from dataclasses import is_dataclass, replace
from operator import attrgetter
from typing import get_args, get_type_hints

import numpy as np
import pytest

from perception.cli.parser import call, flag_types
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

# Number of the table, flag, value of the thesis in the unit of the flag.
TABLE_7_5 = [
    ("d_min", "point.min_height_m", 0.20),
    ("eta", "fusion.points.max_iterations", 5),
    ("delta_l", "fusion.points.tolerance_m", 0.05),
    ("eta'", "fusion.image.max_iterations", 4),
    ("delta_l'", "fusion.image.tolerance_px", 1.0),
    ("b", "fusion.colors.bins_per_channel", 8),
    ("ring", "fusion.colors.ring_scale", math.sqrt(2)),
]
# Values of the author's code, where the thesis gives none.
AUTHOR = [
    ("gate", "point.gate", 2.0),
    ("pitch gate", "point.pitch.gate_rad", math.radians(0.3)),
    ("Q, motion", "point.motion.process", 3.0),
    ("R, motion", "point.motion.measurement", 1.0),
    ("Q, fusion", "fusion.process", 3.0),
    ("R, scan", "fusion.lidar_variance", 1.0),
    ("R, image", "fusion.image_variance", 3.0),
    ("Q, colours", "fusion.colors.noise.process", 0.1),
    ("iterations of 3D-MS", "baselines.mean_shift.max_iterations", 3),
]
NUMBERS = [*TABLE_7_5, *AUTHOR]
DEFAULT = SingleObjectTrackerConfig()


def parsed(*words: str) -> SingleObjectTrackerConfig:
    """Return the configuration that a command with these flags is called with."""
    found = []

    def command(*, tracker_config: SingleObjectTrackerConfig = DEFAULT) -> None:
        """Keep the configuration."""
        found.append(tracker_config)

    call("trifuse command", command, words)
    return found[0]


def leaf_names(kind: type, prefix: str) -> set[str]:
    """Return the dotted names of all settings of a configuration class."""
    names = set()
    for name, hint in get_type_hints(kind).items():
        inner = [part for part in (hint, *get_args(hint)) if is_dataclass(part)]
        names |= leaf_names(inner[0], f"{prefix}{name}.") if inner else {f"{prefix}{name}"}
    return names


@pytest.mark.parametrize(("number", "name", "value"), NUMBERS, ids=[name for _, name, _ in NUMBERS])
def test_numbers_of_the_table_have_a_flag_and_the_value_of_the_thesis(number, name, value):
    assert attrgetter(name)(DEFAULT) == pytest.approx(value), number
    other = 16 if name.endswith("bins_per_channel") else 2 * value
    flag = f"--tracker-config.{name}".replace("_", "-")
    assert attrgetter(name)(parsed(flag, str(other))) == pytest.approx(other)


def test_every_setting_has_a_flag():
    def command(*, tracker_config: SingleObjectTrackerConfig) -> None:
        """Keep nothing."""

    assert set(flag_types(command)) == leaf_names(SingleObjectTrackerConfig, "tracker_config.")


def test_defaults_come_through_the_flags_unchanged():
    assert parsed() == DEFAULT


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
    states = [str(tracker.update(tracker_input).state) for tracker_input in inputs[1:]]
    assert states == ["predicted", "predicted", "lost", "lost"]
