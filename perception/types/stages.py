"""Method of a stage, progress over frames, and the time that each stage took."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

# The method of this package, or that of the thesis.
Method = Literal["default", "thesis"]
# Method of filling sparse depth and reflectance maps.
MapMethod = Literal["default", "thesis", "nearest", "linear", "natural"]
# Method of filling maps for a detector; sparse leaves the returns alone.
MapFilling = MapMethod | Literal["sparse"]
# Letterbox keeps the aspect of an image in the input of a network.
Fit = Literal["letterbox", "stretch"]
# Treatment of a frame that cannot be read.
OnBadFrame = Literal["stop", "skip"]
# Folder layouts of KITTI.
KittiLayout = Literal["raw", "tracking", "object"]
# Iterates over numbers, such as those of frames, and may show a progress bar.
Progress = Callable[[Iterable[int]], Iterable[int]]


@dataclass(frozen=True)
class StageSpan:
    """Start and end of one stage for one frame.

    Attributes:
        stage: Name of the stage.
        worker: Name of the worker that ran it.
        start_s: Start in seconds since the frame arrived.
        stop_s: End in seconds since the frame arrived.
    """

    stage: str
    worker: str
    start_s: float
    stop_s: float


def relative_to_start(spans: Sequence[StageSpan]) -> tuple[StageSpan, ...]:
    """Return the spans in seconds since the first stage started, without the time that the frame waited."""
    offset_s = min((span.start_s for span in spans), default=0.0)
    return tuple(
        replace(span, start_s=span.start_s - offset_s, stop_s=span.stop_s - offset_s)
        for span in spans
    )
