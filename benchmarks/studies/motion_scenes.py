"""Moving points, missed objects and false clusters on synthetic scenes by LiDAR, frame rate and INS, all around.

Among the scenes are those that are hard: fences and hedges, jams of lorries, people who stop, a poor INS, and none.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial, reduce
from itertools import product
from operator import add
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.studies.report import RESULTS, StreetFlags, publish
from data.batch.parts import run_parts
from data.synthetic.words import StreetKind
from perception.cli.parser import FlagGroup
from perception.cli.progress import progress_bar
from perception.errors import UsageError
from perception.evaluation.config import ObjectMatchConfig
from perception.evaluation.report import Table, with_total
from perception.geometry.grids import LocalArea
from perception.geometry.threads import limit_blas_threads, usable_cores
from perception.pipeline import PipelineConfig
from perception.pipeline.workers import StageClock
from perception.render.bar_plots import plot_groups
from perception.sensor import load_sensor
from perception.types import Float64, Method, PointTruth

if TYPE_CHECKING:
    from perception.evaluation.moving_segmentation import MotionCounts

METHODS: tuple[Method, ...] = ("default", "thesis")
_PANELS = {"IoU [%]": "iou", "found static [%]": "missed_share", "false/100 scans": "false_a_scan"}
_OF_EVERYTHING = ("false_clusters", "precision", "iou", "false_a_scan")
_POOR_INS = (0.5, 0.5)
_AT_REST_M_S = 0.01  # up to which an object stands


@dataclass(frozen=True)
class MotionScene:
    """One scene.

    Attributes:
        street: Kind of street.
        sensor: LiDAR model.
        rate_hz: Scans per second.
        ins_noise: Standard deviations of the INS in metres and degrees; those of KITTI's by default.
        has_ins: Whether frames carry the pose of the INS.
    """

    street: StreetKind
    sensor: str
    rate_hz: float = 10.0
    ins_noise: tuple[float, float] | None = None
    has_ins: bool = True


SCENES: Mapping[str, MotionScene] = {
    "town": MotionScene("town", "HDL-64E"),
    "fences, hedges": MotionScene("park", "HDL-64E"),
    "jam": MotionScene("jam", "HDL-64E"),
    "shopping": MotionScene("shopping", "HDL-64E"),
    "junction, poor INS": MotionScene("junction", "HDL-64E", ins_noise=_POOR_INS),
    "cycling, no INS": MotionScene("cycling", "HDL-64E", has_ins=False),
    "main road, 2 Hz": MotionScene("main-road", "HDL-32E", 2.0),
    "town, 2 Hz": MotionScene("town", "HDL-32E", 2.0),
    "fences, hedges, 2 Hz": MotionScene("park", "HDL-32E", 2.0),
    "shopping, 5 Hz": MotionScene("shopping", "HDL-32E", 5.0),
    "jam, 5 Hz": MotionScene("jam", "HDL-32E", 5.0),
    "town, 16 beams": MotionScene("town", "VLP-16"),
    "fences, hedges, 16 beams": MotionScene("park", "VLP-16"),
    "industrial": MotionScene("industrial", "OS1-128"),
    "housing, 20 Hz": MotionScene("housing", "OS1-64", 20.0),
    "country": MotionScene("country", "VLP-32C"),
}


@dataclass(frozen=True)
class MotionScenesConfig(FlagGroup):
    """Scenes.

    Attributes:
        reach_m: Reach of the local area in metres, to each side.
        workers: Number of processes; else one for each core.
    """

    reach_m: float = 50.0
    workers: int | None = None

    def __post_init__(self) -> None:
        """Validate the reach."""
        if not self.reach_m > 0:
            raise UsageError("--reach-m", expected="a reach above 0", found=f"{self.reach_m:g}")

    @property
    def area(self) -> LocalArea:
        """Local area of the pipeline and of the counts."""
        return LocalArea(self.reach_m, self.reach_m, self.reach_m)


def motion_scenes(
    *,
    streets: StreetFlags,
    config: MotionScenesConfig,
    out: Path = RESULTS / "motion-scenes.png",
) -> None:
    """Measure moving object segmentation on synthetic scenes by LiDAR, frame rate and INS; the first scan does not count.

    Example: trifuse study motion-scenes --seed 700 --drives 2 --frames 25

    Args:
        out: Figure; a JSON file with the numbers is written beside it.
    """
    from perception.evaluation.moving_segmentation import MotionCounts

    cases = list(product(METHODS, SCENES, streets.seeds))
    measure = partial(measure_scene, frames=streets.frames, area=config.area)
    done = run_parts(measure, cases, config.workers or usable_cores())
    of_case = dict(progress_bar(done, "scenes", len(cases), unit="drive"))
    rows = {
        method: {
            name: reduce(add, (of_case[method, name, seed]["all"] for seed in streets.seeds))
            for name in SCENES
        }
        for method in METHODS
    }
    title = f"Moving object segmentation, {streets.title}"
    panels: dict[str, dict[str, Float64]] = {
        heading: {
            method: np.array([100 * getattr(one, key) for one in scenes.values()])
            for method, scenes in rows.items()
        }
        for heading, key in _PANELS.items()
    }
    # Names would overlap; the bars are in the order of the table.
    plot_groups(out, title, [str(number + 1) for number in range(len(SCENES))], panels)
    of_default = [one for (method, *_), one in of_case.items() if method == "default"]
    by_speed = {name: reduce(add, (one[name] for one in of_default)) for name in of_default[0]}
    columns = MotionCounts.columns()
    of_objects = [one for one in columns if one.key not in _OF_EVERYTHING]
    del by_speed["all"]
    tables: dict[str, Table[MotionCounts]] = {
        method: Table(f"{title}: {method}", columns, with_total(scenes), heading="scene")
        for method, scenes in rows.items()
    }
    tables["speeds"] = Table("default: by speed", of_objects, by_speed, heading="speed")
    publish(
        out,
        "none: the thesis counts moving obstacles by hand",
        tables,
        {"drives": streets, "config": config, "scenes": SCENES},
    )


def measure_scene(
    case: tuple[Method, str, int], frames: int, area: LocalArea
) -> "dict[str, MotionCounts]":
    """Measure one method on one scene, all objects and those of each class of speeds; called by workers."""
    from data.derived.moving_truth import moving_truth
    from data.synthetic.drive import SyntheticDrive
    from data.synthetic.ins import InsNoise
    from data.synthetic.world_kinds import STREETS
    from perception.evaluation.moving_segmentation import MotionCounts, count_motion, speeds_of
    from perception.pipeline.lidar_stages import LidarStages

    method, name, seed = case
    scene = SCENES[name]
    sensor = replace(load_sensor(scene.sensor), rate_hz=scene.rate_hz)
    world = STREETS[scene.street](np.random.default_rng(seed))
    noise = None if scene.ins_noise is None else InsNoise(*scene.ins_noise)
    drive = SyntheticDrive(
        frames, seed=seed, sensor=sensor, config=world, noise=noise, images=False
    )
    motion, match = moving_truth(drive, "all").motion, ObjectMatchConfig()
    config = PipelineConfig.for_motion()
    pipeline = replace(config, area=area, motion=replace(config.motion, method=method))
    stages, total = LidarStages(sensor, pipeline), dict[str, MotionCounts]()
    for index, measured in enumerate(drive):
        frame = measured if scene.has_ins else replace(measured, world_SE3_velo=None)
        clock = StageClock()
        with limit_blas_threads():
            found = stages.step(frame, stages.check(frame, clock), clock, with_datmo=False)
        ids = drive.labels_around(index).track_ids
        speeds_m_s = speeds_of(ids, motion.velocities_of(index, ids))
        truth = _without_creeping(drive.point_truth(index), speeds_m_s)
        for key, one in count_motion(found.of_frame(frame), truth, match, speeds_m_s).items():
            total[key] = total.get(key, MotionCounts()) + (one if index else MotionCounts())
    return total


def _without_creeping(truth: PointTruth, speeds_m_s: Mapping[int, float]) -> PointTruth:
    """Take the class of points of objects that roll to a halt: too slow to count as moving, and yet not at rest."""
    from data.synthetic.actors import MOVING_M_S

    numbers = range(int(truth.instances.max(initial=0)) + 1)
    speeds = np.array([speeds_m_s.get(number, 0.0) for number in numbers])[truth.instances]
    creeps = ~truth.is_moving & (speeds > _AT_REST_M_S) & (speeds < MOVING_M_S)
    return replace(truth, classes=np.where(creeps, 0, truth.classes))
