"""The figures of `trifuse evaluate otd`, for people and for programs."""

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any

from data.derived.challenges import Challenge
from perception.cli.evaluations.otd_objects import AbsentObject
from perception.cli.evaluations.otd_report import ObjectReport, OtdReport
from perception.cli.table import Cell, format_table
from perception.evaluation.config import SingleObjectMetricsConfig
from perception.evaluation.single_object.metrics import SingleObjectMetrics

_TOGETHER = "together"
_PRINTED = "thesis H-Fus"
_Metric = Callable[[SingleObjectMetrics], Cell]


def otd_tables(report: OtdReport) -> str:
    """Return the figures for people: what is followed, trackers side by side, then each in detail."""
    tables = [
        _objects_table(report),
        *(_side_by_side(report, one) for one in _comparisons(report.protocol.metrics)),
        *_challenge_tables(report),
        *(_detail_table(report, name) for name in report.trackers),
    ]
    refusals = [
        f"{name} does not follow {one.sequence.name}: {reason}"
        for one in report.objects
        for name, reason in one.refusals.items()
    ]
    return "\n\n".join([*tables, *(["\n".join(refusals)] if refusals else [])])


def absent_lines(absent: Sequence[AbsentObject]) -> str:
    """Name what is not there, a line a reason."""
    names: dict[str, list[str]] = {}
    for one in absent:
        names.setdefault(one.reason, []).append(one.sequence.name)
    return "\n".join(f"  {reason}: {', '.join(which)}" for reason, which in names.items())


def _objects_table(report: OtdReport) -> str:
    rows = [
        [
            one.sequence.name,
            one.sequence.sequence,
            one.sequence.track_id,
            one.sequence.kind,
            f"{one.sequence.first_frame}-{one.sequence.last_frame}",
            one.labelled,
            one.total_frames,
            " ".join(one.challenges) or None,
            f"{one.variation.occluded_share:.0%}",
            f"{one.variation.turn_deg:.0f}",
            f"{one.variation.distance_ratio:.1f}",
            f"{one.variation.speed_change_m_s:.1f}",
        ]
        for one in report.objects
    ]
    header = (
        "sequence", "drive", "track", "type", "frames", "labelled", "of", "challenges",
        "occluded", "turn °", "distance x", "speed m/s",
    )  # fmt: skip
    return format_table("What is followed; challenges told from the labels", header, rows)


@dataclasses.dataclass(frozen=True)
class _Comparison:
    """One figure of all trackers, side by side.

    Attributes:
        title: what it is, and by which protocol.
        metric: taken from the scores.
        printed: the name under which a sequence states what the thesis prints of H-Fus, if it does.
    """

    title: str
    metric: _Metric
    printed: str | None = None


def _comparisons(config: SingleObjectMetricsConfig) -> list[_Comparison]:
    return [
        _Comparison(
            "E3D (7.3): mean distance of the box centres [m]",
            lambda s: s.center_m,
            "printed_E3D_m",
        ),
        _Comparison(
            "E2D (7.3): mean distance of the rectangles' centres in the image, clipped to it [px]",
            lambda s: _digits(s.center_px, 1),
            "printed_E2D_px",
        ),
        _Comparison(
            "E_phi (7.4): mean heading error, folded to 0..pi/2 [rad]",
            lambda s: s.folded_heading_rad,
            "printed_E_phi_rad",
        ),
        _Comparison("Heading error, mean, 0..pi [rad]", lambda s: s.heading_rad),
        _Comparison(
            f"Overlap success (A.1): frames with 3D IoU above {config.overlap:.0%}, in percent",
            lambda s: _percent(s.overlap_success),
        ),
        _Comparison(
            f"Heading success (A.2): frames within {config.heading_deg:g}°, in percent",
            lambda s: _percent(s.heading_success),
        ),
        _Comparison(
            f"Location success (A.3): frames within {config.location_px:g} px, in percent",
            lambda s: _percent(s.location_success),
        ),
        _Comparison(
            "Success, one-pass evaluation: area under 3D overlap 0..1, in percent",
            lambda s: _percent(s.success),
        ),
        _Comparison(
            f"Precision, one-pass evaluation: area under centre error 0..{config.max_center_error_m:g} m, in percent",
            lambda s: _percent(s.precision),
        ),
    ]


def _side_by_side(report: OtdReport, comparison: _Comparison) -> str:
    """Return one figure with a row a sequence and a column a tracker, as Tables 7.6 and 7.7 have it."""
    metric, key = comparison.metric, comparison.printed
    rows: list[list[Cell]] = [
        [one.sequence.name, *(_cell(one.scores.get(name), metric) for name in report.trackers)]
        for one in report.objects
    ]
    if len(rows) > 1:
        together = (_cell(report.scores_of(name), metric) for name in report.trackers)
        rows.append([_TOGETHER, *together])
    header = ["", *report.trackers]
    if key is not None and any(key in one.sequence.stated for one in report.objects):
        header.append(_PRINTED)
        printed = [*(one.sequence.stated.get(key) for one in report.objects), None]
        rows = [[*row, value] for row, value in zip(rows, printed, strict=False)]
    return format_table(comparison.title, header, rows)


def _challenge_tables(report: OtdReport) -> list[str]:
    groups = [one for one in Challenge if report.objects_with(one)]
    if len(report.objects) < 2 or not groups:
        return []
    header = ["", *(f"{one} ({len(report.objects_with(one))})" for one in groups)]
    metrics: dict[str, _Metric] = {
        "Overlap success by challenge, all frames of its sequences, in percent": (
            lambda s: _percent(s.overlap_success)
        ),
        "Heading success by challenge, in percent": lambda s: _percent(s.heading_success),
    }
    return [
        format_table(
            title,
            header,
            [
                [name, *(_cell(report.scores_of(name, one), metric) for one in groups)]
                for name in report.trackers
            ],
        )
        for title, metric in metrics.items()
    ]


_DETAILS: dict[str, _Metric] = {
    "frames": lambda s: s.frames,
    "E3D m": lambda s: s.center_m,
    "E2D px": lambda s: _digits(s.center_px, 1),
    "in image": lambda s: _percent(s.in_image),
    "E_phi rad": lambda s: s.folded_heading_rad,
    "bias rad": lambda s: s.heading_bias_rad,
    "m/s": lambda s: s.velocity_m_s,
    "overlap": lambda s: _percent(s.overlap_success),
    "Success": lambda s: _percent(s.success),
    "Precision": lambda s: _percent(s.precision),
    "seen": lambda s: _percent(s.seen),
    "predicted": lambda s: _percent(s.predicted),
    "lost": lambda s: _percent(s.lost),
    "off": lambda s: _percent(s.drifted),
    "off for good": lambda s: None if s.lost_from_frame is None else f"from {s.lost_from_frame}",
    "ms a frame": lambda s: _digits(s.ms_per_frame, 2),
    "p99": lambda s: _digits(s.ms_p99, 2),
}


def _detail_table(report: OtdReport, tracker: str) -> str:
    rows = [_detail_row(one, tracker) for one in report.objects]
    if len(rows) > 1:
        together = report.scores_of(tracker)
        if together is not None:
            together = dataclasses.replace(together, lost_from_frame=None)
        rows.append([_TOGETHER, *(_cell(together, metric) for metric in _DETAILS.values())])
    title = f"{tracker}: velocity error, states as it says, frames off the object, time"
    return format_table(title, ("", *_DETAILS), rows)


def _detail_row(one: ObjectReport, tracker: str) -> list[Cell]:
    scores = one.scores.get(tracker)
    return [one.sequence.name, *(_cell(scores, metric) for metric in _DETAILS.values())]


def _cell(scores: SingleObjectMetrics | None, metric: _Metric) -> Cell:
    return None if scores is None else metric(scores)


def _percent(share: float) -> str | None:
    return None if math.isnan(share) else f"{100 * share:.1f}"


def _digits(value: float, digits: int) -> str | None:
    return None if math.isnan(value) else f"{value:.{digits}f}"


def otd_results(report: OtdReport, absent: Sequence[AbsentObject]) -> dict[str, Any]:
    """Return the figures for programs."""
    return {
        "objects": [
            {
                "sequence": one.sequence,
                "labelled_frames": one.labelled,
                "total_frames": one.total_frames,
                "variations": one.variation,
                "challenges": one.challenges,
                "scores": dict(one.scores),
                "refusals": dict(one.refusals),
            }
            for one in report.objects
        ],
        _TOGETHER: {name: report.scores_of(name) for name in report.trackers},
        "by_challenge": {
            str(one): {name: report.scores_of(name, one) for name in report.trackers}
            for one in Challenge
            if report.objects_with(one)
        },
        "absent": {one.sequence.name: one.reason for one in absent},
    }
