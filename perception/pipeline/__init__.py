"""The pipeline: every stage over the frames of a drive, in parallel where possible, in bounded memory.

`Pipeline` is imported when it is used, so that `PipelineConfig` needs no numeric libraries.
"""

from typing import TYPE_CHECKING, Any

from perception.pipeline.config import PipelineConfig

if TYPE_CHECKING:
    from perception.pipeline.pipeline import Pipeline

__all__ = ["Pipeline", "PipelineConfig"]


def __getattr__(name: str) -> Any:  # noqa: ANN401 - a class
    """Import `Pipeline`."""
    if name == "Pipeline":
        from perception.pipeline.pipeline import Pipeline

        return Pipeline
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
