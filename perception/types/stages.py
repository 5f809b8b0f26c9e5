"""How a stage is asked to work, how it shows its progress, and when it worked."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal

# By which form of a stage: ours, or the thesis' own.
Method = Literal["default", "thesis"]
# How sparse depth and reflectance maps are filled.
MapMethod = Literal["default", "thesis", "nearest", "linear", "natural"]
# What is done at a frame that cannot be read.
OnBadFrame = Literal["stop", "skip"]
# KITTI's folder layouts.
Layout = Literal["raw", "tracking", "object"]
# Goes through numbers, such as of frames, and may show how far it is.
Progress = Callable[[Iterable[int]], Iterable[int]]


@dataclass(frozen=True)
class StageSpan:
    """When one stage worked on a frame.

    Attributes:
        stage: its name.
        worker: that ran it, one stage after another.
        start_s: since the frame arrived.
        stop_s: since the frame arrived.
    """

    stage: str
    worker: str
    start_s: float
    stop_s: float
