"""Health of sensors and stages, and seconds of each stage."""

from typing import Any

from data.messages.definitions import message
from data.messages.geometry import LIDAR, header
from perception.types import SENSOR_PARTS, Health, Result

_OK, _WARN = 0, 1  # levels of diagnostic_msgs/DiagnosticStatus, those of HealthLevel


def diagnostics(result: Result) -> Any:  # noqa: ANN401 - a message
    """Return a status of the pipeline with the time of each stage, and one of each sensor, and stage with a finding.

    The pipeline's own status warns where stages were left out or points are invalid.
    """
    values = {
        "latency_ms": f"{1e3 * result.latency_s:.2f}",
        **{f"{stage} [ms]": f"{1e3 * time:.2f}" for stage, time in result.timings_s.items()},
        "skipped": ", ".join(result.skipped),
        "invalid_points": str(result.frame.invalid_points),
    }
    status = message(
        "diagnostic_msgs/DiagnosticStatus",
        level=_WARN if result.skipped or result.frame.invalid_points else _OK,
        name="trifuse: pipeline",
        message=f"left out: {', '.join(result.skipped)}" if result.skipped else "all stages ran",
        values=[
            message("diagnostic_msgs/KeyValue", key=key, value=value)
            for key, value in values.items()
        ],
    )
    return message(
        "diagnostic_msgs/DiagnosticArray",
        header=header(result.frame.stamp_s, LIDAR),
        status=[status, *_part_statuses(result.health)],
    )


def _part_statuses(health: Health) -> list[Any]:
    """Return the status of each sensor, and of each other part that has a finding."""
    return [
        message(
            "diagnostic_msgs/DiagnosticStatus",
            level=int(health.level_of(part)),
            name=f"trifuse: {part}",
            message="; ".join(str(one) for one in health.findings if one.part == part) or "OK",
        )
        for part in dict.fromkeys((*SENSOR_PARTS, *health.levels))
    ]
