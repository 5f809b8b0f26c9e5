"""What a training logged, epoch by epoch, read from TensorBoard's files."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from perception.types import Float64


def read_scalars(folder: Path, names: Sequence[str]) -> dict[str, Float64]:
    """Return the logged values of each name in the order of their steps.

    Of a step that was logged twice, as by a training that was killed and gone on with, the later counts.
    """
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    events = EventAccumulator(str(folder), size_guidance={"scalars": 0}).Reload()
    known = events.Tags()["scalars"]
    found = {}
    for name in names:
        by_step = (
            {event.step: event.value for event in events.Scalars(name)} if name in known else {}
        )
        found[name] = np.array([by_step[step] for step in sorted(by_step)], np.float64)
    return found
