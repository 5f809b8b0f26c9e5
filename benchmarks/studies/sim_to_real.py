"""What more of the synthetic worlds, and changing their pictures, is worth on held-out and on real drives."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from benchmarks.studies.detector_variants import (
    DetectorVariant,
    VariantEvaluationConfig,
    VariantTrainingConfig,
    study_variants,
)
from benchmarks.studies.report import Study
from benchmarks.studies.variant_report import plot_over_frames, precision_tables
from perception.errors import UsageError

UNCHANGED = "all, pictures unchanged"


def share_variants(base: DetectorVariant, shares: Sequence[float]) -> list[DetectorVariant]:
    """Return a detector for each share of the frames, as many steps long, and one without augmentation.

    Raises:
        UsageError: a share is none, or there are none.
    """
    if not shares or min(shares) <= 0 or max(shares) > 1:
        found = ", ".join(f"{share:g}" for share in shares) or "none"
        raise UsageError("--shares", expected="shares above 0, at most 1", found=found)
    variants = [
        replace(
            base,
            name=f"{share:g} of all",
            experiment=replace(
                base.experiment, data=replace(base.experiment.data, training_fraction=share)
            ),
            epochs=round(base.epochs / share),
        )
        for share in shares
    ]
    return [
        *variants,
        replace(
            base,
            name=UNCHANGED,
            experiment=replace(base.experiment, data=replace(base.experiment.data, augment=False)),
        ),
    ]


def study_sim_to_real(
    variants: list[DetectorVariant],
    conditions: VariantTrainingConfig,
    evaluation: VariantEvaluationConfig,
    plot_path: Path,
) -> Study:
    """Train all, and draw average precision over the number of frames learned from."""
    metrics = study_variants(variants, conditions, evaluation, plot_path.with_suffix(""))
    overlaps = evaluation.metric.iou
    of_shares = {name: one for name, one in metrics.items() if name != UNCHANGED}
    modality = variants[0].experiment.modality
    plot_over_frames(
        plot_path, f"Detector of {modality}, trained on synthetic drives", of_shares, overlaps
    )
    return Study(
        name="sim-to-real",
        repeats="none: the thesis trains on KITTI",
        table="\n\n".join(
            precision_tables("Shares of the training frames", metrics, iou) for iou in overlaps
        ),
        numbers=metrics,
        conditions={"variants": variants, "training": conditions, "judging": evaluation},
    )
