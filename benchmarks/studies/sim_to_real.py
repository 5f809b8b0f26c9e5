"""Effect of the number of synthetic training frames, and of augmentation, on held-out and on real drives."""

from collections.abc import Sequence
from pathlib import Path

from benchmarks.studies.detector_variants import (
    IOU,
    DetectorVariant,
    VariantFlags,
    study_variants,
)
from benchmarks.studies.report import RESULTS, publish
from benchmarks.studies.variant_report import plot_over_frames, precision_tables
from perception.errors import UsageError
from perception.types import Modality

UNCHANGED = "all, without augmentation"


def sim_to_real(
    drives: list[Path],
    *,
    training: VariantFlags,
    real: list[Path] | None = None,
    modality: Modality = "dm",
    size: str = "192x640",
    shares: tuple[float, ...] = (0.125, 0.25, 0.5, 1.0),
    out: Path = RESULTS / "sim-to-real.png",
) -> None:
    """Train a detector on more and more synthetic frames; measure it on held-out and on real drives.

    A smaller share is trained for more epochs, so that all take the same number of steps. A finished training is
    not repeated: the same command resumes where it was stopped.

    Example: trifuse study sim-to-real synth/train --validation synth/val --real kitti/object

    Args:
        drives: Synthetic training drives; shares take their first frames.
        real: Other labelled drives to measure on, with commas between them.
        modality: Camera image, rgb; depth map, dm; or reflectance map, rm.
        size: Height and width of the input.
        shares: Shares of the frames; one more training takes all, without augmentation.
        out: Figure; the numbers and all trainings are written beside it.
    """
    variants = share_variants(training.variant(drives, modality, size), shares)
    metrics = study_variants(variants, training, out.with_suffix(""), real or ())
    of_shares = {name: one for name, one in metrics.items() if name != UNCHANGED}
    plot_over_frames(out, f"Detector of {modality}, trained on synthetic drives", of_shares, IOU)
    publish(
        out,
        "none: the thesis trains on KITTI",
        precision_tables("Shares of the training frames", metrics, IOU),
        {"variants": variants, "training": training, "real": real},
        variants=metrics,
    )


def share_variants(base: DetectorVariant, shares: Sequence[float]) -> dict[str, DetectorVariant]:
    """Return a variant for each share of the frames, with the same number of steps, and one without augmentation.

    Raises:
        UsageError: A share is out of range, or there are none.
    """
    if not shares or min(shares) <= 0 or max(shares) > 1:
        found = ", ".join(f"{share:g}" for share in shares) or "none"
        raise UsageError("--shares", expected="shares above 0, at most 1", found=found)
    epochs = int(str(base.arguments["trainer.max_epochs"]))
    variants = {
        f"{share:g} of all": base.but(
            data__training_fraction=share, trainer__max_epochs=round(epochs / share)
        )
        for share in shares
    }
    return {**variants, UNCHANGED: base.but(data__augment=False)}
