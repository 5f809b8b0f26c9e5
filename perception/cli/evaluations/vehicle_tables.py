"""What detected vehicles are worth as objects, for people and for programs."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from perception.cli.evaluations.mot_results import mot_results, mot_table
from perception.cli.table import Cell, format_table
from perception.evaluation.multi_object.mot_metrics import MotMetrics
from perception.evaluation.vehicle_location import LocationErrors
from perception.types import Float64

_BANDS_M = ((0.0, 25.0), (25.0, 50.0), (50.0, np.inf))
# Column of the table: of which error.
_MEASURES = (
    ("centre", "center_m"),
    ("yaw", "yaw_rad"),
    ("axis", "axis_rad"),
    ("distance", "distance_m"),
)


@dataclass(frozen=True)
class VehiclesReport:
    """What the vehicles of one drive are worth.

    Attributes:
        frames: how many.
        scores: of their tracks in the image.
        errors: of their places on the road.
        colocated: moving objects that share their place with a vehicle that has an id, frame by frame.
        same_id: of these, those that share its id.
    """

    frames: int
    scores: MotMetrics
    errors: LocationErrors
    colocated: int
    same_id: int


def vehicle_tables(report: VehiclesReport) -> str:
    """Return a table of the tracks, one of the places, and a sentence on ids."""
    rows: list[list[Cell]] = [
        [
            f"{low:g} to {high:g} m" if np.isfinite(high) else f"from {low:g} m",
            int(band["detected"]),
            *(band[name] for name in list(band)[1:]),
        ]
        for (low, high), band in zip(_BANDS_M, _bands(report.errors), strict=True)
    ]
    header = (
        "",
        "cars",
        "with a box",
        *(f"{n} {q}" for n, _ in _MEASURES for q in ("50 %", "90 %")),
    )
    return "\n\n".join(
        [
            mot_table("car: KITTI 2D boxes, ratios in percent", {"vehicles": report.scores}),
            format_table("detected cars on the road: metres and degrees", header, rows),
            f"moving objects at the place of a vehicle: {report.colocated}, of its id: {report.same_id}",
        ]
    )


def vehicle_results(report: VehiclesReport) -> dict[str, Any]:
    """Return the figures for programs."""
    return {
        "tracking": mot_results(report.scores),
        "location": [
            {"from_m": low, "to_m": high if np.isfinite(high) else None, **band}
            for (low, high), band in zip(_BANDS_M, _bands(report.errors), strict=True)
        ],
        "ids": {"met": report.colocated, "agreed": report.same_id},
    }


def _bands(errors: LocationErrors) -> list[dict[str, float]]:
    return [
        _summary(errors[(errors.range_m >= low) & (errors.range_m < high)])
        for low, high in _BANDS_M
    ]


def _summary(errors: LocationErrors) -> dict[str, float]:
    summary: dict[str, float] = {
        "detected": len(errors),
        "boxed": float(np.isfinite(errors.center_m).mean()) if len(errors) else np.nan,
    }
    for name, field in _MEASURES:
        values: Float64 = getattr(errors, field)
        values = np.degrees(values) if field.endswith("_rad") else values
        known = values[np.isfinite(values)]
        for share in (0.5, 0.9):
            summary[f"{name}_{share:g}"] = (
                float(np.quantile(known, share)) if len(known) else np.nan
            )
    return summary
