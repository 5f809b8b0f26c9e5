"""False movers at what beams pass through: mesh fences, hedges and rows of trees, over speed and distance.

A vehicle that came to a halt within the last second has been a mover, and is not found to stand at once. Clusters on such
vehicles are counted apart from those on what has not moved.
"""

from dataclasses import dataclass, replace
from functools import partial, reduce
from itertools import pairwise, product
from operator import add
from pathlib import Path

import numpy as np

from benchmarks.studies.report import RESULTS, StreetFlags, formatted_table, publish
from data.batch.parts import run_parts
from perception.cli.parser import FlagGroup
from perception.cli.progress import progress_bar
from perception.errors import UsageError
from perception.evaluation.config import ObjectMatchConfig
from perception.evaluation.report import SummedMetrics, Table
from perception.geometry.grids import LocalArea
from perception.geometry.threads import usable_cores
from perception.pipeline import PipelineConfig
from perception.render.curve_plots import Curve, CurvePanel, plot_curves
from perception.sensor import LidarModel, load_sensor
from perception.types import Float64, PointState

_HALTED_S = 1.0  # since an object moved
_BANDS_M = (0.0, 5.0, 10.0, 20.0, 30.0, 40.0)


@dataclass(frozen=True)
class FalseMoversConfig(FlagGroup):
    """Roads.

    Attributes:
        speeds_m_s: Speeds of the ego vehicle in metres per second.
        reach_m: Reach of the local area in metres, to each side.
        workers: Number of processes; else one for each core.
    """

    speeds_m_s: tuple[float, ...] = (5.0, 10.0, 15.0, 20.0)
    reach_m: float = 40.0
    workers: int | None = None

    def __post_init__(self) -> None:
        """Validate that there is a speed, and that each is above 0."""
        if not self.speeds_m_s or min(self.speeds_m_s) <= 0:
            found = ", ".join(f"{one:g}" for one in self.speeds_m_s) or "none"
            raise UsageError("--speeds-m-s", expected="speeds above 0", found=found)

    @property
    def area(self) -> LocalArea:
        """Local area of the pipeline and of the counts."""
        return LocalArea(self.reach_m, self.reach_m, self.reach_m)


@dataclass(frozen=True)
class MoverCounts(SummedMetrics):
    """Movers of any number of scans.

    Attributes:
        scans: Number of scans.
        false_m: Distances in metres of the false moving clusters on what has not moved within the last second.
        halted: Number of false moving clusters on what has come to a halt within it.
        movers: Number of objects that move, each counted once a scan.
        missed: Number of these that were not found to move.
    """

    scans: int
    false_m: tuple[float, ...]
    halted: int
    movers: int
    missed: int

    @property
    def false_a_scan(self) -> float:
        """False moving clusters a scan on what has not moved."""
        return len(self.false_m) / self.scans

    @property
    def halted_a_scan(self) -> float:
        """False moving clusters a scan on what has come to a halt."""
        return self.halted / self.scans

    def false_by_distance(self) -> Float64:
        """Return (B,) false moving clusters a scan in each band of distances."""
        return np.histogram(self.false_m, _BANDS_M)[0] / self.scans


def false_movers(
    *,
    streets: StreetFlags,
    config: FalseMoversConfig,
    sensor: str = "HDL-64E",
    out: Path = RESULTS / "false-movers.png",
) -> None:
    """Count false movers on roads along mesh fences, hedges and rows of trees, and the movers that are missed there.

    Example: trifuse study false-movers --drives 3 --frames 40

    Args:
        sensor: LiDAR model, such as HDL-64E, VLP-16 or OS1-64, or a .yaml or .json file that describes one.
        out: Figure; a JSON file with the numbers is written beside it.
    """
    model = load_sensor(sensor)
    cases = list(product(config.speeds_m_s, streets.seeds))
    measure = partial(_measure, frames=streets.frames, model=model, area=config.area)
    done = run_parts(measure, cases, config.workers or usable_cores())
    of_case = dict(progress_bar(done, "drives", len(cases), unit="drive"))
    by_speed = {
        speed: reduce(add, (of_case[speed, seed] for seed in streets.seeds))
        for speed in config.speeds_m_s
    }
    title = f"False movers at fences, hedges and rows of trees, {model.name}, {streets.title}"
    panels = [
        CurvePanel(
            f"to {config.reach_m:g} m",
            "speed [m/s]",
            "false moving clusters a scan",
            [Curve("all", config.speeds_m_s, [one.false_a_scan for one in by_speed.values()])],
        ),
        CurvePanel(
            "by distance",
            "distance [m]",
            "false moving clusters a scan",
            [
                Curve(f"{speed:g} m/s", _BANDS_M[1:], one.false_by_distance())
                for speed, one in by_speed.items()
            ],
        ),
    ]
    plot_curves(out, title, panels)
    publish(
        out,
        "none: the thesis counts false movers on KITTI by hand",
        {"movers": _table(title, by_speed)},
        {"drives": streets, "config": config, "sensor": model, "area": config.area},
    )


def _measure(
    case: tuple[float, int], frames: int, model: LidarModel, area: LocalArea
) -> MoverCounts:
    """Count on one road; called by workers."""
    from data.synthetic.drive import SyntheticDrive
    from data.synthetic.world_kinds import park_road
    from perception.evaluation.exact_obstacles import (
        count_exactly,
        count_false,
        exact_points,
        false_clusters_m,
    )
    from perception.pipeline import Pipeline

    speed_m_s, seed = case
    world = replace(park_road(np.random.default_rng(seed)), ego_m_s=speed_m_s)
    drive = SyntheticDrive(frames, seed=seed, sensor=model, config=world, images=False)
    match, false_m, halted, movers, missed = ObjectMatchConfig(), [], 0, 0, 0
    moved_s: dict[int, float] = {}
    with Pipeline(model, replace(PipelineConfig.for_motion(), area=area)) as pipeline:
        for index in range(frames):
            result, truth = pipeline.step(drive[index]), drive.point_truth(index)
            counts = count_exactly(result, truth, area, match).counts
            movers, missed = movers + counts.moving, missed + counts.missed_moving
            points = exact_points(result, truth, area)
            moving = points[points.states == PointState.MOVING]
            stamp_s = drive.stamp_s(index)
            moved_s |= dict.fromkeys(np.unique(truth.instances[truth.is_moving]).tolist(), stamp_s)
            moved = [one for one, last_s in moved_s.items() if stamp_s - last_s <= _HALTED_S]
            has_moved = moving.is_moving | np.isin(moving.instances, moved)
            found_m = false_clusters_m(moving.points_m, has_moved)
            false_m += np.linalg.norm(found_m, axis=1).tolist()
            halted += count_false(moving.points_m, moving.is_moving) - len(found_m)
    return MoverCounts(frames, tuple(false_m), halted, movers, missed)


def _table(title: str, by_speed: dict[float, MoverCounts]) -> Table[MoverCounts]:
    bands = [f"{low:g} to {high:g} m" for low, high in pairwise(_BANDS_M)]
    rows = {f"{speed:g} m/s": one for speed, one in by_speed.items()}
    rows["all"] = reduce(add, by_speed.values())
    specs = {"scans": "d", "false a scan": ".3f", **dict.fromkeys(bands, ".3f"), "halted": ".3f"}
    return formatted_table(
        title,
        "speed",
        {**specs, "movers": "d", "missed": "d"},
        {
            name: [
                one.scans,
                one.false_a_scan,
                *one.false_by_distance(),
                one.halted_a_scan,
                one.movers,
                one.missed,
            ]
            for name, one in rows.items()
        },
    )
