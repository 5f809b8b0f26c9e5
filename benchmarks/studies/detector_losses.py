"""What a detector comes to by each form of its loss: as published, and with either of the options, or both."""

from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Literal

from benchmarks.studies.detector_variants import (
    DetectorVariant,
    VariantEvaluationConfig,
    VariantTrainingConfig,
    study_variants,
)
from benchmarks.studies.report import Study
from benchmarks.studies.variant_report import plot_variant_curves, precision_tables

_BOXES: tuple[Literal["squared", "ciou"], ...] = ("squared", "ciou")
_OBJECTNESSES: tuple[Literal["squared", "focal"], ...] = ("squared", "focal")
_NAMES = ("as published", "focal objectness", "CIoU of boxes", "both")


def loss_variants(base: DetectorVariant) -> list[DetectorVariant]:
    """Return a detector for each form of the loss."""
    forms = product(_BOXES, _OBJECTNESSES)
    return [
        replace(
            base,
            name=name,
            experiment=replace(
                base.experiment, loss=replace(base.experiment.loss, box=box, objectness=objectness)
            ),
        )
        for name, (box, objectness) in zip(_NAMES, forms, strict=True)
    ]


def study_detector_losses(
    variants: list[DetectorVariant],
    conditions: VariantTrainingConfig,
    evaluation: VariantEvaluationConfig,
    plot_path: Path,
) -> Study:
    """Train all, and print average precision at every overlap."""
    metrics = study_variants(variants, conditions, evaluation, plot_path.with_suffix(""))
    overlaps = evaluation.metric.iou
    plot_variant_curves(plot_path, "Losses", metrics, overlaps[0])
    return Study(
        name="detector-losses",
        repeats="none: the thesis trains as published",
        table="\n\n".join(precision_tables("Losses", metrics, iou) for iou in overlaps),
        numbers=metrics,
        conditions={"variants": variants, "training": conditions, "judging": evaluation},
    )
