"""Long vehicles in traffic jams, with and without INS: their moving points, their ids, and the poses beside them."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from itertools import product
from operator import add
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.studies.report import RESULTS, StreetFlags, formatted_table, publish
from benchmarks.studies.tracking_metrics import PROTOCOL
from data.batch.parts import run_parts
from perception.cli.flags import require_positive
from perception.cli.parser import FlagGroup
from perception.cli.progress import progress_bar
from perception.errors import UsageError
from perception.evaluation.confusion import Confusion
from perception.evaluation.report import SummedMetrics
from perception.geometry.threads import limit_blas_threads, usable_cores
from perception.pipeline import PipelineConfig
from perception.pipeline.workers import StageClock
from perception.render.bar_plots import plot_groups
from perception.sensor import load_sensor
from perception.types import Float64, Tracks

if TYPE_CHECKING:
    from data.synthetic.drive import SyntheticDrive
    from perception.evaluation.multi_object.track_assignment import MovingScene

_SPAN_S = 1.0  # over which the error of the motion is measured
_COVERED_SHARE = 0.5  # of a track's outline that lies on a vehicle


@dataclass(frozen=True)
class JamsConfig(FlagGroup):
    """Jams.

    Attributes:
        first_frame: First frame that counts; before it, earlier scans reach back less than free space does.
        min_length_m: Smallest length of a long vehicle in metres.
        workers: Number of processes; else one for each core.
    """

    first_frame: int = 15
    min_length_m: float = 8.0
    workers: int | None = None

    def __post_init__(self) -> None:
        """Validate the first frame and the length."""
        require_positive("--first-frame", self.first_frame)
        if not self.min_length_m > 0:
            raise UsageError(
                "--min-length-m", expected="a length above 0", found=f"{self.min_length_m:g}"
            )


@dataclass(frozen=True)
class JamCounts(SummedMetrics):
    """Points, bodies and poses of any number of drives.

    Attributes:
        points: Moving points of everything.
        long_points: Moving points of long vehicles.
        vehicles: Number of long vehicles that move.
        untracked: Number of these on which no track ever lies.
        ids: Number of different tracks on each of the others, added up.
        never_whole: Number of vehicles that no track ever matches by its box: of many only the rear is seen.
        errors_m: Errors of the motion over a second in metres, one for each scan.
        resets: Number of scans whose pose no longer fits to those of earlier scans.
    """

    points: Confusion
    long_points: Confusion
    vehicles: int
    untracked: int
    ids: int
    never_whole: int
    errors_m: tuple[float, ...]
    resets: int

    @property
    def ids_per_vehicle(self) -> float:
        """Mean number of ids of a long vehicle that is tracked; NaN without any."""
        tracked = self.vehicles - self.untracked
        return self.ids / tracked if tracked else float("nan")

    @property
    def values(self) -> list[float]:
        """Values of a row of the table."""
        return [
            self.points.iou,
            self.long_points.iou,
            self.vehicles,
            self.untracked,
            self.ids_per_vehicle,
            self.never_whole,
            *np.quantile(self.errors_m, (0.5, 0.9)).tolist(),
            self.resets,
        ]


_SPECS = {
    "moving IoU": ".3f",
    "of long vehicles": ".3f",
    "long vehicles": "d",
    "untracked": "d",
    "ids/vehicle": ".2f",
    "never whole": "d",
    "error over 1 s, p50 [m]": ".3f",
    "p90 [m]": ".3f",
    "resets": "d",
}
_INS = ("INS", "no INS")


def jams(
    *,
    streets: StreetFlags,
    config: JamsConfig,
    sensor: str = "HDL-64E",
    out: Path = RESULTS / "jams.png",
) -> None:
    """Measure long vehicles in jams, with and without INS: moving points, ids, and the error of the poses.

    Example: trifuse study jams --seed 101 --drives 6 --frames 40

    Args:
        sensor: LiDAR model, such as HDL-64E, VLP-16 or OS1-64, or a .yaml or .json file that describes one.
        out: Figure; a JSON file with the numbers is written beside it.

    Raises:
        UsageError: No frame counts.
    """
    if streets.frames <= config.first_frame:
        raise UsageError(
            f"--frames {streets.frames}",
            expected=f"more than the {config.first_frame} before the first that counts",
            found=str(streets.frames),
        )
    cases = list(product(_INS, streets.seeds))
    measure = partial(measure_jam, frames=streets.frames, sensor=sensor, config=config)
    done = run_parts(measure, cases, config.workers or usable_cores())
    of_case = dict(progress_bar(done, "jams", len(cases), unit="drive"))
    by_ins = {name: [of_case[name, seed] for seed in streets.seeds] for name in _INS}
    title = f"Long vehicles in jams, {load_sensor(sensor).name}, {streets.title}"
    panels = {
        "moving IoU of long vehicles [%]": _over_drives(
            by_ins, lambda one: 100 * one.long_points.iou
        ),
        "ids/vehicle": _over_drives(by_ins, lambda one: one.ids_per_vehicle),
    }
    plot_groups(out, title, [str(seed) for seed in streets.seeds], panels)
    rows = {f"{name}, {seed}": of_case[name, seed] for name, seed in cases}
    rows |= {f"{name}, all": reduce(add, drives) for name, drives in by_ins.items()}
    publish(
        out,
        "none: the thesis has no jams",
        {
            "drives": formatted_table(
                title, "drive", _SPECS, {n: one.values for n, one in rows.items()}
            )
        },
        {"drives": streets, "config": config, "sensor": sensor, "protocol": PROTOCOL},
    )


def measure_jam(case: tuple[str, int], frames: int, sensor: str, config: JamsConfig) -> JamCounts:
    """Measure one drive, with or without INS; called by workers."""
    from data.synthetic.collection import SynthConfig, draw_drive

    name, seed = case
    model = load_sensor(sensor)
    recipe = SynthConfig("tracking", frames, sensor=model, seed=seed, images=False, street="jam")
    return measure_drive(draw_drive(recipe, 0, frames), config, has_ins=name == "INS")


def measure_drive(drive: "SyntheticDrive", config: JamsConfig, *, has_ins: bool) -> JamCounts:
    """Measure a drive.

    Args:
        drive: Drive with exact truth.
        config: What counts.
        has_ins: Whether frames carry the pose of the INS.
    """
    from data.derived.moving_truth import moving_truth
    from perception.evaluation.obstacles import motion_confusions
    from perception.pipeline.lidar_stages import LidarStages

    truth, targets = moving_truth(drive, PROTOCOL.view, PROTOCOL.motion), PROTOCOL.targets
    stages = LidarStages(drive.sensor, PipelineConfig.for_motion())
    poses = _Poses(drive)
    points, long_points = Confusion(), Confusion()
    vehicles = _Vehicles()
    for index, measured in enumerate(drive):
        frame = measured if has_ins else replace(measured, world_SE3_velo=None)
        clock = StageClock()
        with limit_blas_threads():
            found = stages.step(frame, stages.check(frame, clock), clock)
        poses.update(index, found.world_SE3_velo, is_reset=found.is_reset)
        scene = truth.scene(frame, targets.clearance_m)
        if index < config.first_frame or scene is None:
            continue
        states, exact = found.obstacles.point_states, drive.point_truth(index)
        points += motion_confusions(states, exact.classes, exact.is_moving)["moving"]
        boxes = scene.objects.boxes_velo
        is_long = boxes.size_m[:, 0] >= config.min_length_m
        of_long = np.isin(exact.instances, scene.objects.track_ids[is_long] + 1)
        long_points += motion_confusions(
            states[of_long], exact.classes[of_long], exact.is_moving[of_long]
        )["moving"]
        vehicles.update(scene[is_long], found.tracks)
    return JamCounts(
        points,
        long_points,
        vehicles=len(vehicles.ids_of),
        untracked=sum(not ids for ids in vehicles.ids_of.values()),
        ids=sum(len(ids) for ids in vehicles.ids_of.values()),
        never_whole=len(vehicles.ids_of.keys() - vehicles.whole),
        errors_m=tuple(poses.errors_m[config.first_frame :]),
        resets=poses.resets,
    )


class _Vehicles:
    """Ids on each long vehicle that must be tracked, frame after frame.

    A track lies on a vehicle where half of its outline does, as a rear does whose vehicle is hidden behind it, or where
    it matches by the protocol of all moving objects.
    """

    def __init__(self) -> None:
        self.ids_of: dict[int, set[int]] = {}
        self.whole: set[int] = set()

    def update(self, scene: "MovingScene", tracks: Tracks) -> None:
        """Add a frame."""
        from perception.evaluation.multi_object.track_assignment import (
            assign_tracks,
            covered_shares,
        )

        assigned = assign_tracks(scene, tracks, PROTOCOL.targets)
        matches = np.zeros((len(scene), len(tracks)), bool)
        matches[assigned.matched_objects, assigned.matched_tracks] = True
        boxes = scene.objects.boxes_velo
        lies_on = matches | (covered_shares(boxes, tracks.boxes) >= _COVERED_SHARE)
        for row in assigned.targets.tolist():
            number = int(scene.objects.track_ids[row])
            self.ids_of.setdefault(number, set()).update(tracks.ids[lies_on[row]].tolist())
            if matches[row].any():
                self.whole.add(number)


class _Poses:
    """Errors of the motion over a second, or since poses of earlier scans no longer fit, of a drive."""

    def __init__(self, drive: "SyntheticDrive") -> None:
        self._drive, self._scans = drive, round(_SPAN_S * drive.sensor.rate_hz)
        self._poses: deque[tuple[Float64, Float64]] = deque(maxlen=self._scans + 1)
        self.errors_m: list[float] = []
        self.resets = -1  # the first scan is none

    def update(self, index: int, pose: Float64, *, is_reset: bool) -> None:
        """Add the pose of a scan."""
        from perception.geometry.se3 import inverse

        if is_reset:
            self._poses.clear()
            self.resets += 1
        self._poses.append((pose, self._drive.true_world_SE3_velo(index)))
        (first, true_first), (last, true_last) = self._poses[0], self._poses[-1]
        error = inverse(inverse(true_first) @ true_last) @ inverse(first) @ last
        self.errors_m.append(float(np.linalg.norm(error[:3, 3])))


def _over_drives(
    by_ins: Mapping[str, Sequence[JamCounts]], value: Callable[[JamCounts], float]
) -> dict[str, Float64]:
    return {name: np.array([value(one) for one in drives]) for name, drives in by_ins.items()}
