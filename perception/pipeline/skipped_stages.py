"""Stages that a late frame skips: DepthCN, which nothing else needs, and detectors, of which one remains."""

from collections.abc import Collection, Iterable, Sequence
from typing import Literal

from perception.types import MODALITIES, DetectorModality, Modality

# Names as in the times of the stages.
SkippableStage = Literal["DepthCN", "rgb detector", "dm detector", "rm detector", "bev detector"]
DEPTHCN: SkippableStage = "DepthCN"
BEV_DETECTOR: SkippableStage = "bev detector"
_DETECTORS: dict[SkippableStage, DetectorModality] = {
    "rgb detector": "rgb",
    "dm detector": "dm",
    "rm detector": "rm",
    BEV_DETECTOR: "bev",
}


def skippable_stages(
    order: Iterable[SkippableStage], detecting: Iterable[DetectorModality], *, has_depthcn: bool
) -> list[SkippableStage]:
    """Return those of some stages that a frame may go without, in their order.

    Args:
        order: Stages that may be left out.
        detecting: Modalities of the detectors that would run.
        has_depthcn: Whether DepthCN would run.
    """
    remaining, skippable = set(detecting), list[SkippableStage]()
    for stage in order:
        modality = _DETECTORS.get(stage)
        if has_depthcn if modality is None else remaining > {modality}:
            skippable.append(stage)
            remaining -= {modality}
    return skippable


def modalities_without(
    skipped: Sequence[SkippableStage], modalities: Collection[Modality] = MODALITIES
) -> tuple[Modality, ...]:
    """Return the modalities whose detectors are not left out."""
    left_out = {_DETECTORS.get(stage) for stage in skipped}
    return tuple(name for name in modalities if name not in left_out)
