"""How much of the exact truth lies within the reported 90 % intervals: of poses, moving objects and 3D boxes, by LiDAR."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.studies.report import RESULTS, StreetFlags, formatted_table, publish
from data.synthetic.words import StreetKind
from perception.cli.parser import FlagGroup
from perception.cli.progress import progress_bar
from perception.evaluation.config import DatmoProtocol
from perception.evaluation.report import Table
from perception.render.bar_plots import plot_groups
from perception.sensor import load_sensor
from perception.types import Result

if TYPE_CHECKING:
    from data.synthetic.drive import SyntheticDrive
    from perception.evaluation.intervals import BoxIntervals
    from perception.evaluation.multi_object.track_errors import TargetErrors
    from perception.evaluation.pose_intervals import PoseErrors

_PROTOCOL = DatmoProtocol(view="all")
# Time since the first scan in periods of the sensor, by name.
_SPANS = {
    "1 scan": (0.5, 1.5),
    "to 1 s": (1.5, 10.5),
    "1 to 5 s": (10.5, 50.5),
    "8 to 12 s": (79.5, 120.5),
}
# Shares within intervals by the name of the part, by row.
Shares = Mapping[str, dict[str, float]]


@dataclass(frozen=True)
class UncertaintyConfig(FlagGroup):
    """What is measured.

    Attributes:
        sensors: LiDAR models.
        kinds: Kinds of streets, in turn; none for drawn ones.
        start_every: Number of scans from one start of the odometry to the next.
        images: Whether boxes are detected in images, too, or by LiDAR alone.
    """

    sensors: tuple[str, ...] = ("VLP-16", "HDL-32E", "HDL-64E", "VLS-128")
    kinds: tuple[StreetKind, ...] = ()
    start_every: int = 20
    images: bool = True


@dataclass
class _Errors:
    """Errors of the drives of one LiDAR, in standard deviations.

    Attributes:
        poses: Errors of poses with and without INS.
        tracks: Errors of moving objects.
        track_boxes: Errors of their boxes.
        vehicles: Errors of boxes of confirmed vehicles and people.
        single: The same of those that are not confirmed.
    """

    poses: "dict[bool, list[PoseErrors]]" = field(default_factory=lambda: {True: [], False: []})
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

    Example: trifuse study uncertainty --frames 40 --drives 2 --sensors VLP-16,HDL-64E

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
        "poses": _table(f"{title}: poses since a start", "LiDAR", _joined(poses)),
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
    from perception.evaluation.pose_intervals import PoseIntervals
    from perception.localization.odometry import LidarOdometry
    from perception.pipeline import Pipeline

    truth, targets = moving_truth(drive, _PROTOCOL.view, _PROTOCOL.motion), _PROTOCOL.targets
    true_poses = [drive.true_world_SE3_velo(index) for index in range(len(drive))]
    started: list[tuple[bool, LidarOdometry, PoseIntervals]] = []
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
                    (ins, LidarOdometry(), PoseIntervals(true_poses)) for ins in (True, False)
                ]
            for has_ins, odometry, intervals in started:
                pose = frame.world_SE3_velo if has_ins else None
                located = odometry.update(frame.points_velo, frame.stamp_s, pose)
                intervals.add(
                    frame.index, frame.stamp_s, located.world_SE3_velo, located.covariance
                )
    for has_ins, _, intervals in started:
        errors.poses[has_ins].append(intervals.errors)


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
    """Return the shares of poses with and without INS by the time since their start."""
    from perception.evaluation.pose_intervals import PoseErrors

    shares = {}
    for has_ins, drives in errors.poses.items():
        every = PoseErrors.concatenate(drives)
        period_s = every.ages_s.min(initial=np.inf)
        for name, (low, high) in _SPANS.items():
            within = every[(every.ages_s > low * period_s) & (every.ages_s < high * period_s)]
            if not len(within):
                continue
            one = within.summary()
            shares[f"{'INS' if has_ins else 'no INS'}, {name}"] = {
                "number": float(one.frames),
                "position": one.position_coverage,
                "rotation": one.rotation_coverage,
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
