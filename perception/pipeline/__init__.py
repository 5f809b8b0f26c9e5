"""The pipeline: every stage over the frames of a drive, in parallel where possible, in bounded memory.

`Pipeline` and `StageClock` are imported when they are used, so that `PipelineConfig` needs no numeric libraries.
"""

from typing import TYPE_CHECKING, Any

from perception.pipeline.config import PipelineConfig

if TYPE_CHECKING:
    from perception.pipeline.pipeline import Pipeline
    from perception.pipeline.workers import StageClock

__all__ = ["Pipeline", "PipelineConfig", "StageClock"]


def __getattr__(name: str) -> Any:  # noqa: ANN401 - a class of either module
    """Import `Pipeline` or `StageClock`."""
    if name == "Pipeline":
        from perception.pipeline.pipeline import Pipeline

        return Pipeline
    if name == "StageClock":
        from perception.pipeline.workers import StageClock

        return StageClock
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
