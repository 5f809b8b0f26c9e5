"""How much of the exact truth lies within the reported 90 % intervals: of poses, moving objects and 3D boxes, by LiDAR."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.studies.frame_rate import frame_step
from benchmarks.studies.report import RESULTS, StreetFlags, formatted_table, publish
from data.synthetic.words import StreetKind
from perception.cli.parser import FlagGroup
from perception.cli.progress import progress_bar
from perception.evaluation.config import DatmoProtocol
from perception.evaluation.report import Table
from perception.render.bar_plots import plot_groups
from perception.sensor import load_sensor
from perception.types import Float64, Frame, Result

if TYPE_CHECKING:
    from data.synthetic.drive import SyntheticDrive
    from perception.evaluation.intervals import BoxIntervals
    from perception.evaluation.multi_object.track_errors import TargetErrors
    from perception.evaluation.pose_intervals import PoseErrors

_PROTOCOL = DatmoProtocol(view="all")
# Time since the first scan, from its second one on, in seconds, by name.
_SPANS_S = {"to 1 s": (0.0, 1.05), "1 to 5 s": (1.05, 5.05), "8 to 12 s": (7.95, 12.05)}
_COMPONENTS = ("x", "y", "z", "roll", "pitch", "yaw")
# Shares within intervals by the name of the part, by row.
Shares = Mapping[str, dict[str, float]]


@dataclass(frozen=True)
class UncertaintyConfig(FlagGroup):
    """What is measured.

    Attributes:
        sensors: LiDAR models.
        kinds: Kinds of streets, in turn; none for drawn ones.
        rates: Frame rates in Hz at which poses are estimated; none for that of the LiDAR.
        start_every: Number of scans from one start of the odometry to the next.
        images: Whether boxes are detected in images, too, or by LiDAR alone.
    """

    sensors: tuple[str, ...] = ("VLP-16", "HDL-32E", "HDL-64E", "VLS-128")
    kinds: tuple[StreetKind, ...] = ()
    rates: tuple[float, ...] = ()
    start_every: int = 20
    images: bool = True


@dataclass
class _Errors:
    """Errors of the drives of one LiDAR, in standard deviations.

    Attributes:
        poses: Errors of poses, by the name of prior and frame rate.
        tracks: Errors of moving objects.
        track_boxes: Errors of their boxes.
        vehicles: Errors of boxes of confirmed vehicles and people.
        single: The same of those that are not confirmed.
    """

    poses: "dict[str, list[PoseErrors]]" = field(default_factory=dict)
    tracks: "list[TargetErrors]" = field(default_factory=list)
    track_boxes: "list[BoxIntervals]" = field(default_factory=list)
    vehicles: "list[BoxIntervals]" = field(default_factory=list)
    single: "list[BoxIntervals]" = field(default_factory=list)


def uncertainty(
    *,
    streets: StreetFlags,
    config: UncertaintyConfig,
    out: Path = RESULTS / "uncertainty.png",
) -> None:
    """Measure how much of the truth lies within the 90 % intervals of poses, moving objects and boxes, by LiDAR.

    Beside the shares of poses stands, for each component, the RMS error over the mean deviation.

    Example: trifuse study uncertainty --frames 40 --drives 2 --sensors VLP-16,HDL-64E --rates 2,5,10

    Args:
        out: Figure; a JSON file with the numbers is written beside it.
    """
    found = {name: _measure(name, streets, config) for name in config.sensors}
    title = f"Share of the truth within 90 % intervals, {streets.title}"
    poses = {name: _pose_shares(one) for name, one in found.items()}
    objects = {name: _object_shares(one) for name, one in found.items()}
    kinds = _by_kind([one for errors in found.values() for one in errors.vehicles])
    panels = {
        f"{part} of {name} [%]": {
            row: np.array([100 * one[row][part] for one in rows.values()])
            for row in next(iter(rows.values()))
        }
        for name, part, rows in (("poses", "position", poses), ("objects", "centre", objects))
    }
    plot_groups(out, title, list(found), panels)
    tables = {
        "poses": _table(
            f"{title}: poses since a start, and errors over deviations", "LiDAR", _joined(poses)
        ),
        "objects": _table("Moving objects and boxes", "LiDAR", _joined(objects)),
        "classes": _table("Boxes of confirmed objects", "class", kinds),
    }
    conditions = {"drives": streets, "config": config, "protocol": _PROTOCOL}
    publish(out, "none: the thesis states no uncertainty", tables, conditions)


def _measure(sensor: str, streets: StreetFlags, config: UncertaintyConfig) -> _Errors:
    """Drive through the streets of one LiDAR."""
    from data.synthetic.drive import SyntheticDrive
    from data.synthetic.world_kinds import STREETS, draw_config

    errors = _Errors()
    for number, seed in enumerate(streets.seeds):
        rng = np.random.default_rng(seed)
        draw = STREETS[config.kinds[number % len(config.kinds)]] if config.kinds else draw_config
        drive = SyntheticDrive(
            streets.frames,
            seed=seed,
            sensor=load_sensor(sensor),
            config=draw(rng),
            images=config.images,
        )
        _drive(drive, config, errors)
    return errors


def _drive(drive: "SyntheticDrive", config: UncertaintyConfig, errors: _Errors) -> None:
    from data.derived.moving_truth import moving_truth
    from perception.evaluation.intervals import box_intervals
    from perception.evaluation.multi_object.track_assignment import assign_tracks
    from perception.evaluation.multi_object.track_errors import target_errors
    from perception.pipeline import Pipeline

    truth, targets = moving_truth(drive, _PROTOCOL.view, _PROTOCOL.motion), _PROTOCOL.targets
    true_poses = [drive.true_world_SE3_velo(index) for index in range(len(drive))]
    steps = {rate_hz: frame_step(drive, rate_hz) for rate_hz in config.rates or (None,)}
    started: list[_Started] = []
    with Pipeline(drive.sensor) as pipeline:
        for frame in progress_bar(drive, f"{drive.sensor.name} {drive.name}", len(drive)):
            result = pipeline.step(frame)
            scene = truth.scene(frame, targets.clearance_m)
            if scene is not None:
                assigned = assign_tracks(scene, result.tracks, targets)
                errors.tracks.append(target_errors(frame.stamp_s, scene, result.tracks, assigned))
                objects = scene.objects[assigned.matched_objects]
                types = np.full(len(objects), "")
                errors.track_boxes.append(
                    box_intervals(result.tracks, assigned.matched_tracks, objects.boxes_velo, types)
                )
            _add_vehicles(result, drive, errors)
            if frame.index % config.start_every == 0:
                started += [
                    _Started(frame.index, step, rate_hz, has_ins, true_poses)
                    for rate_hz, step in steps.items()
                    for has_ins in (True, False)
                ]
            for one in started:
                one.update(frame)
    for one in started:
        errors.poses.setdefault(one.name, []).append(one.intervals.errors)


class _Started:
    """Odometry from one scan of a drive on, on every n-th scan, with or without INS."""

    def __init__(
        self,
        first: int,
        step: int,
        rate_hz: float | None,
        has_ins: bool,
        true_poses: Sequence[Float64],
    ) -> None:
        from perception.evaluation.pose_intervals import PoseIntervals
        from perception.localization.odometry import LidarOdometry

        self.name = ("INS" if has_ins else "no INS") + (f", {rate_hz:g} Hz" if rate_hz else "")
        self.intervals = PoseIntervals(true_poses)
        self._odometry, self._has_ins = LidarOdometry(), has_ins
        self._first, self._step = first, step

    def update(self, frame: Frame) -> None:
        """Estimate the pose of a scan, where it is one of these."""
        if (frame.index - self._first) % self._step:
            return
        pose = frame.world_SE3_velo if self._has_ins else None
        located = self._odometry.update(frame.points_velo, frame.stamp_s, pose)
        self.intervals.add(frame.index, frame.stamp_s, located.world_SE3_velo, located.covariance)


def _add_vehicles(result: Result, drive: "SyntheticDrive", errors: _Errors) -> None:
    from perception.evaluation.intervals import box_intervals
    from perception.evaluation.vehicle_measure import matched_labels

    if result.vehicles is None:
        return
    known, rows = matched_labels(drive.labels(result.frame.index), result.vehicles)
    is_confirmed = result.vehicles.ids[rows] >= 0
    for one, of_group in ((errors.vehicles, is_confirmed), (errors.single, ~is_confirmed)):
        of_them = np.flatnonzero(of_group)
        one.append(
            box_intervals(
                result.vehicles, rows[of_them], known.boxes_velo[of_them], known.types[of_them]
            )
        )


def _pose_shares(errors: _Errors) -> Shares:
    """Return the shares of poses by prior and frame rate, and by the time since their start."""
    from perception.evaluation.pose_intervals import PoseErrors

    shares = {}
    for case, drives in errors.poses.items():
        every = PoseErrors.concatenate(drives)
        second_s = 1.5 * every.ages_s.min(initial=np.inf)
        spans_s = {"1 scan": (0.0, second_s)}
        spans_s |= {name: (max(low, second_s), high) for name, (low, high) in _SPANS_S.items()}
        for name, (low_s, high_s) in spans_s.items():
            within = every[(every.ages_s > low_s) & (every.ages_s < high_s)]
            if not len(within):
                continue
            one = within.summary()
            shares[f"{case}, {name}"] = {
                "number": float(one.frames),
                "position": one.position_coverage,
                "rotation": one.rotation_coverage,
                **dict(zip(_COMPONENTS, within.deviation_ratios().tolist(), strict=True)),
            }
    return shares


def _object_shares(errors: _Errors) -> Shares:
    """Return the shares of moving objects, of confirmed boxes and of those that are not confirmed."""
    from perception.evaluation.intervals import interval_coverage
    from perception.evaluation.multi_object.track_errors import TargetErrors

    tracks = TargetErrors.concatenate(errors.tracks).matched
    shares = {
        "moving objects": _box_shares(errors.track_boxes),
        "confirmed boxes": _box_shares(errors.vehicles),
        "new boxes": _box_shares(errors.single),
    }
    velocity = interval_coverage(tracks.velocity_spread, 2)
    shares["moving objects"]["velocity"] = velocity
    return shares


def _by_kind(boxes: "Sequence[BoxIntervals]") -> Shares:
    """Return the shares of the boxes of each class."""
    from perception.evaluation.intervals import BoxIntervals

    every = BoxIntervals.concatenate(boxes)
    return {
        kind: _box_shares([every[every.types == kind]])
        for kind in sorted(set(every.types.tolist()))
    }


def _box_shares(boxes: "Sequence[BoxIntervals]") -> dict[str, float]:
    from perception.evaluation.intervals import BoxIntervals

    one = BoxIntervals.concatenate(boxes).summary()
    return {
        "number": float(one.boxes),
        "centre": one.center,
        "length": one.length,
        "width": one.width,
        "height": one.height,
        "axis": one.axis,
        "velocity": np.nan,
    }


def _joined(sensors: Mapping[str, Shares]) -> Shares:
    return {f"{name}: {row}": one for name, rows in sensors.items() for row, one in rows.items()}


def _table(title: str, heading: str, rows: Shares) -> Table[Any]:
    columns = next(iter(rows.values()), {})
    specs = {name: ".0f" if name == "number" else ".2f" for name in columns}
    return formatted_table(title, heading, specs, {n: [*one.values()] for n, one in rows.items()})
