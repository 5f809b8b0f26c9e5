"""Average precision of a detector by the form of its loss: as published, with one of two options, and with both."""

from itertools import product
from pathlib import Path
from typing import Literal

from benchmarks.studies.detector_variants import (
    IOU,
    DetectorVariant,
    VariantFlags,
    study_variants,
)
from benchmarks.studies.report import RESULTS, publish
from benchmarks.studies.variant_report import plot_variant_curves, precision_tables
from perception.types import Modality

_BOXES: tuple[Literal["squared", "ciou"], ...] = ("squared", "ciou")
_OBJECTNESSES: tuple[Literal["squared", "focal"], ...] = ("squared", "focal")
_NAMES = ("as published", "focal objectness", "CIoU of boxes", "both")


def detector_losses(
    drives: list[Path],
    *,
    training: VariantFlags,
    modality: Modality = "dm",
    size: str = "192x640",
    out: Path = RESULTS / "detector-losses.png",
) -> None:
    """Train a detector with the published loss, with CIoU of boxes, with focal objectness, and with both.

    A finished training is not repeated: the same command resumes where it was stopped.

    Example: trifuse study detector-losses synth/train --validation synth/val --modality rgb

    Args:
        drives: Labelled training drives.
        modality: Camera image, rgb; depth map, dm; or reflectance map, rm.
        size: Height and width of the input.
        out: Figure; the numbers and all trainings are written beside it.
    """
    variants = loss_variants(training.variant(drives, modality, size))
    metrics = study_variants(variants, training, out.with_suffix(""))
    plot_variant_curves(out, "Losses", metrics, IOU[0])
    publish(
        out,
        "none: the thesis trains as published",
        precision_tables("Losses", metrics, IOU),
        {"variants": variants, "training": training},
        variants=metrics,
    )


def loss_variants(base: DetectorVariant) -> dict[str, DetectorVariant]:
    """Return a variant for each form of the loss."""
    forms = product(_BOXES, _OBJECTNESSES)
    return {
        name: base.but(model__loss__box=box, model__loss__objectness=objectness)
        for name, (box, objectness) in zip(_NAMES, forms, strict=True)
    }
