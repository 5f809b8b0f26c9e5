"""Health of the pipeline: seconds of each stage, and what was left out."""

from typing import Any

from data.messages.definitions import message
from data.messages.geometry import LIDAR, header
from perception.types import Result

_OK, _WARN = 0, 1  # levels of diagnostic_msgs/DiagnosticStatus


def diagnostics(result: Result) -> Any:  # noqa: ANN401 - a message
    """Return one status with the time of each stage; a warning where stages were left out or points are invalid."""
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
        hardware_id="",
        values=[
            message("diagnostic_msgs/KeyValue", key=key, value=value)
            for key, value in values.items()
        ],
    )
    return message(
        "diagnostic_msgs/DiagnosticArray",
        header=header(result.frame.stamp_s, LIDAR),
        status=[status],
    )
