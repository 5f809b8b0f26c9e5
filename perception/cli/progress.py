"""How far a command is, as a bar on stderr."""

import sys
from collections.abc import Iterable
from typing import TypeVar

from tqdm import tqdm

from perception.types import Progress

Step = TypeVar("Step")


def progress_bar(
    steps: Iterable[Step],
    description: str,
    total: int | None = None,
    *,
    unit: str = "frame",
    delay_s: float = 0,
) -> Iterable[Step]:
    """Go through steps and show how many are done.

    Args:
        steps: what is done one after another.
        description: before the bar.
        total: how many there are, where they do not say it themselves.
        unit: what a step is.
        delay_s: show nothing of what is done before.
    """
    shown: Iterable[Step] = tqdm(
        steps, description, total, unit=unit, file=sys.stderr, delay=delay_s
    )
    return shown


def frame_progress_bar(description: str) -> Progress:
    """Return what shows how far the making of something from frames is, where it takes long."""

    def shown(frames: Iterable[int]) -> Iterable[int]:
        return progress_bar(frames, description, delay_s=2)

    return shown
