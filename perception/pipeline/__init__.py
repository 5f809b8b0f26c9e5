"""Every stage over one frame after another, side by side where they can be, in bounded memory."""

from perception.pipeline.clock import StageClock
from perception.pipeline.config import PipelineConfig
from perception.pipeline.pipeline import Pipeline

__all__ = ["Pipeline", "PipelineConfig", "StageClock"]
