"""The figures of `trifuse evaluate datmo`, for people and for programs."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from perception.cli.evaluations.datmo_report import DatmoReport
from perception.cli.evaluations.mot_results import mot_results, mot_table
from perception.cli.table import Cell, format_table
from perception.evaluation.multi_object.target_errors import ObjectSummary

_QUALITY = (
    "lost objects",
    "false tracks",
    "a minute",
    "never right",
    "on parked",
    "centre m",
    "velocity m/s",
    "mean",
    "heading rad",
    "length m",
    "width m",
    "ms a frame",
    "p99",
)
_OBJECT = (
    "type",
    "m/s",
    "frames",
    "followed",
    "share",
    "ids",
    "switches",
    "found after s",
    "centre m",
    "velocity m/s",
)


def datmo_tables(reports: Mapping[str, DatmoReport]) -> str:
    """Return the figures for people: methods as rows, then the objects of each method."""
    tables = [*_score_tables(reports), _quality_table(reports)]
    tables += [_object_table(method, report) for method, report in reports.items()]
    return "\n\n".join(tables)


def _score_tables(reports: Mapping[str, DatmoReport]) -> list[str]:
    protocol = next(iter(reports.values())).protocol
    within_m = protocol.targets.max_distance_m * (1 - protocol.distance_threshold)
    tight, loose = protocol.overlap_threshold, protocol.loose_overlap_threshold
    where = "on the ground plane; CLEAR and identity"
    return [
        mot_table(
            f"By distance of the centres {where} within {within_m:g} m; ratios in percent",
            {method: report.by_distance for method, report in reports.items()},
        ),
        mot_table(
            f"By overlap {where} at IoU {tight:g}; ratios in percent",
            {method: report.by_overlap for method, report in reports.items()},
        ),
        mot_table(
            f"By overlap {where} at IoU {loose:g}; ratios in percent",
            {method: report.by_loose_overlap for method, report in reports.items()},
        ),
    ]


def _quality_table(reports: Mapping[str, DatmoReport]) -> str:
    rows: list[list[Cell]] = []
    for method, report in reports.items():
        false, errors = report.false_tracks, report.errors
        rows.append(
            [
                method,
                len(report.never_tracked),
                len(false.ids),
                f"{false.per_minute:.1f}",
                len(false.never_matched),
                len(false.on_parked),
                errors.center_m,
                errors.velocity_m_s,
                errors.mean_velocity_m_s,
                errors.heading_rad,
                errors.length_m,
                errors.width_m,
                f"{1000 * report.seconds.mean():.1f}" if report.frames else None,
                f"{1000 * np.quantile(report.seconds, 0.99):.1f}" if report.frames else None,
            ]
        )
    title = (
        "Objects never followed, tracks of nothing that moves, and errors (medians, extent means)"
    )
    return format_table(title, ("", *_QUALITY), rows)


def _object_table(method: str, report: DatmoReport) -> str:
    rows = [_object_row(summary, report.types) for summary in report.objects]
    return format_table(f"Objects that must be tracked: {method}", ("object", *_OBJECT), rows)


def _object_row(summary: ObjectSummary, types: Mapping[int, str]) -> list[Cell]:
    return [
        str(summary.object_id),
        types.get(summary.object_id),
        f"{summary.speed_m_s:.1f}",
        summary.frames,
        summary.frames_tracked,
        f"{100 * summary.share:.0f} %",
        summary.tracks,
        summary.switches,
        f"{summary.time_to_first_track_s:.1f}" if summary.frames_tracked else None,
        summary.center_m,
        summary.velocity_m_s,
    ]


def datmo_results(reports: Mapping[str, DatmoReport]) -> dict[str, Any]:
    """Return the figures for programs, by method."""
    return {method: _results(report) for method, report in reports.items()}


def _results(report: DatmoReport) -> dict[str, Any]:
    objects = [
        {
            **dataclasses.asdict(summary),
            "type": report.types.get(summary.object_id),
            "share": summary.share,
        }
        for summary in report.objects
    ]
    return {
        "frames": report.frames,
        "duration_s": report.duration_s,
        "by_distance": mot_results(report.by_distance),
        "by_overlap": mot_results(report.by_overlap),
        "by_loose_overlap": mot_results(report.by_loose_overlap),
        "errors": report.errors,
        "never_tracked": report.never_tracked,
        "false_tracks": report.false_tracks,
        "objects": objects,
        "ms_per_frame": 1000 * report.seconds.mean() if report.frames else None,
        "ms_per_frame_p99": 1000 * np.quantile(report.seconds, 0.99) if report.frames else None,
    }
