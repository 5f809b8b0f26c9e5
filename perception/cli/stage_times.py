"""How long the stages took over many frames, for people and for programs."""

from collections.abc import Mapping, Sequence

import numpy as np

STAGE_HEADER = ("stage", "median ms", "99 % ms", "share %")


def stage_rows(seconds: Mapping[str, Sequence[float]]) -> list[list[str]]:
    """Return stage, median, 99th percentile and share, all stages together last.

    Args:
        seconds: by stage, one entry a frame.
    """
    stages = {name: np.array(of_stage) for name, of_stage in seconds.items()}
    total = np.sum(list(stages.values()), axis=0)
    return [
        [
            name,
            f"{1e3 * np.median(of_stage):.1f}",
            f"{1e3 * np.percentile(of_stage, 99):.1f}",
            f"{100 * of_stage.sum() / total.sum():.0f}",
        ]
        for name, of_stage in [*stages.items(), ("all stages", total)]
    ]


def stage_document(seconds: Mapping[str, Sequence[float]]) -> dict[str, dict[str, float]]:
    """Return the same figures by stage; none of no frames."""
    return {
        name: {"median": float(median), "p99": float(p99), "share_percent": float(share)}
        for name, median, p99, share in (stage_rows(seconds) if seconds else [])
    }


def median_frame_s(seconds: Mapping[str, Sequence[float]]) -> float:
    """Return the median over the frames of the time of all stages."""
    return float(np.median(np.sum(list(seconds.values()), axis=0)))
