"""Every number of Tables 7.1, 7.4 and 7.5 has a flag and the value of the thesis; the tree is light and round-trips."""

import math
import subprocess
import sys
from dataclasses import is_dataclass
from operator import attrgetter
from typing import get_args, get_type_hints

import pytest

from perception.cli.parser import call, flag_types
from perception.errors import UsageError
from perception.geometry.grids import MOVING_OBJECT_AREA, SURROUNDINGS, LocalArea
from perception.obstacles.motion_segmentation import static_threshold
from perception.pipeline import PipelineConfig
from perception.sensor import HDL_64E, VLP_16
from perception.tracking.single_object.config import SingleObjectTrackerConfig

HEAVY = ("scipy", "cv2", "onnxruntime", "numba", "torch")

# Number of the table, flag, value of the thesis in the unit of the flag.
TABLE_7_1 = [
    ("m", "motion.previous_scans", 6),
    ("eta", "ground.planes.steps_per_slice", 6),
    ("tau", "ground.planes.max_angle_rad", math.radians(10)),
    ("l", "ground.planes.max_step_m", 0.10),
    ("d_min", "motion.counters.min_ground_distance_m", 0.20),
    ("upsilon", "motion.voxel_size_m", 0.10),
    ("T_d", "motion.counters.moving_threshold", 5),
]
# Values of the thesis, and of the author's code.
TABLE_7_4 = [
    ("upsilon", "cell_m", 0.20, 0.20),
    ("T_sigma", "ground_variance_m2", 0.02, 0.02),
    ("T_mu", "ground_height_m", 0.30, 0.80),
    ("n", "scans", 50, 90),
    ("m", "max_observations", 30, 60),
    ("k", "min_observations", 3, 5),
    ("epsilon", "radius_cells", 5, 10),
    ("alpha", "alpha", 0.2, 0.3),
]
TABLE_7_5 = [
    ("eta", "fusion.points.max_iterations", 5),
    ("delta", "fusion.points.tolerance_m", 0.05),
    ("eta'", "fusion.image.max_iterations", 4),
    ("delta'", "fusion.image.tolerance_px", 1),
    ("b", "fusion.colors.bins_per_channel", 8),
    ("d_min", "point.min_height_m", 0.20),
    ("ring", "fusion.colors.ring_scale", math.sqrt(2)),
]
# Values of the author's code for the trackers of one object, where the thesis gives none.
AUTHOR_TRACKER = [
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
DEFAULT, TRACKER = PipelineConfig(), SingleObjectTrackerConfig()
TRACKER_NUMBERS = [*TABLE_7_5, *AUTHOR_TRACKER]


CALLED_WITH: list[tuple[PipelineConfig, SingleObjectTrackerConfig]] = []


def command(
    *, pipeline: PipelineConfig = DEFAULT, tracker_config: SingleObjectTrackerConfig = TRACKER
) -> None:
    """Keep the configurations; one function for all tests, as its parser is built once."""
    CALLED_WITH.append((pipeline, tracker_config))


def configs(*words: str) -> tuple[PipelineConfig, SingleObjectTrackerConfig]:
    """Return the configurations that a command with these flags is called with."""
    call("trifuse command", command, words)
    return CALLED_WITH.pop()


def parsed(*words: str) -> PipelineConfig:
    return configs(*words)[0]


def leaf_names(kind: type, prefix: str) -> set[str]:
    """Return the dotted names of all settings of a configuration class."""
    names = set()
    for name, hint in get_type_hints(kind).items():
        inner = [part for part in (hint, *get_args(hint)) if is_dataclass(part)]
        names |= leaf_names(inner[0], f"{prefix}{name}.") if inner else {f"{prefix}{name}"}
    return names


def other(name: str, value: float) -> float:
    """Return another value that is valid."""
    if name == "cell_m":
        return 0.5  # the areas are whole cells of it
    if name.endswith("bins_per_channel"):
        return 16
    return value + 1 if isinstance(value, int) else 2 * value


@pytest.mark.parametrize(
    ("number", "name", "value"), TABLE_7_1, ids=[number for number, _, _ in TABLE_7_1]
)
def test_numbers_of_table_7_1_have_a_flag_and_the_value_of_the_thesis(number, name, value):
    assert attrgetter(name)(DEFAULT) == pytest.approx(value), number
    flag = f"--pipeline.{name}".replace("_", "-")
    changed = other(name, value)
    assert attrgetter(name)(parsed(flag, str(changed))) == pytest.approx(changed)


@pytest.mark.parametrize(
    ("number", "name", "thesis", "author"), TABLE_7_4, ids=[row[0] for row in TABLE_7_4]
)
def test_numbers_of_table_7_4_have_a_flag_and_the_value_of_the_method(number, name, thesis, author):
    changed, flag = other(name, thesis), f"--pipeline.datmo.grids.{name}".replace("_", "-")
    for method, value in (("thesis", thesis), ("author", author)):
        words = ("--pipeline.datmo.method", method)
        read = [parsed(*words, *more).datmo for more in ((), (flag, str(changed)))]
        values = [getattr(datmo.grids_of_method(), name) for datmo in read]
        assert values == pytest.approx([value, changed]), number


@pytest.mark.parametrize(
    ("number", "name", "value"), TRACKER_NUMBERS, ids=[name for _, name, _ in TRACKER_NUMBERS]
)
def test_numbers_of_table_7_5_have_a_flag_and_the_value_of_the_thesis(number, name, value):
    assert attrgetter(name)(TRACKER) == pytest.approx(value), number
    flag = f"--tracker-config.{name}".replace("_", "-")
    changed = other(name, value)
    assert attrgetter(name)(configs(flag, str(changed))[1]) == pytest.approx(changed)


def test_the_static_threshold_is_that_of_the_thesis_and_can_be_set():
    assert static_threshold(PipelineConfig().motion, HDL_64E) == 50
    config = parsed("--pipeline.motion.counters.static-threshold", "70")
    assert static_threshold(config.motion, HDL_64E) == 70


def test_every_setting_has_a_flag():
    settings = leaf_names(PipelineConfig, "pipeline.")
    settings |= leaf_names(SingleObjectTrackerConfig, "tracker_config.")
    assert set(flag_types(command)) == settings


def test_defaults_come_through_the_flags_unchanged():
    assert configs() == (PipelineConfig(), SingleObjectTrackerConfig())


def test_units_may_be_left_out_of_flags():
    assert parsed("--pipeline.motion.voxel-size", "0.2").motion.voxel_size_m == 0.2


def test_one_flag_chooses_the_method_and_a_stage_may_have_its_own():
    config = parsed("--pipeline.method", "thesis", "--pipeline.motion.method", "default")
    stages = (config.registration, config.ground, config.motion)
    assert [config.method_of(stage) for stage in stages] == ["thesis", "thesis", "default"]
    assert parsed("--pipeline.datmo.method", "author").datmo.method == "author"


def test_the_area_is_all_round_but_of_dense_scans_and_by_the_method_of_the_thesis():
    assert PipelineConfig().area_of(VLP_16) == SURROUNDINGS == LocalArea(50.0, 50.0, 50.0)
    assert PipelineConfig().area_of(HDL_64E) == MOVING_OBJECT_AREA
    assert PipelineConfig("thesis").area_of(VLP_16) == MOVING_OBJECT_AREA
    assert PipelineConfig.for_obstacles().area_of(VLP_16) == LocalArea()


def test_reaches_that_are_given_replace_those_of_the_sensor():
    config = parsed("--pipeline.area.side-m", "40", "--pipeline.area.height-m", "3")
    assert config.area_of(HDL_64E) == LocalArea(30.0, 10.0, 40.0, 3.0)
    assert config.area_of(VLP_16) == LocalArea(50.0, 50.0, 40.0, 3.0)


def test_yaml_sets_what_flags_set(tmp_path):
    path = tmp_path / "pipeline.yaml"
    path.write_text(
        "pipeline:\n  motion:\n    voxel_size_m: 0.3\n    free_space: {min_voxels: 7}\n"
    )
    motion = parsed("--config", str(path), "--pipeline.motion.previous-scans", "4").motion
    assert (motion.voxel_size_m, motion.free_space.min_voxels) == (0.3, 7)
    assert motion.previous_scans == 4


def test_a_window_without_history_is_an_error():
    with pytest.raises(UsageError) as error:
        parsed("--pipeline.motion.previous-scans", "0")
    assert "previous_scans" in error.value.where
    assert error.value.found == "0"


def test_the_configuration_loads_no_numeric_library():
    code = f"import sys, perception.pipeline.config, perception.tracking.single_object.config; print([m for m in {HEAVY} if m in sys.modules])"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert ran.stdout.strip() == "[]", ran.stderr
