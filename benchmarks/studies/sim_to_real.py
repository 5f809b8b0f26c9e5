"""From synthetic training drives to real ones: more frames, augmentation, kinds of streets, and realism of the images."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.studies.detector_variants import (
    IOU,
    DetectorVariant,
    VariantFlags,
    VariantMetrics,
    study_variants,
)
from benchmarks.studies.realism import measure_realism, realism_panels, realism_table
from benchmarks.studies.report import RESULTS, publish
from benchmarks.studies.variant_report import (
    frames_panels,
    precision_of,
    precision_tables,
    variant_panels,
)
from perception.errors import UsageError
from perception.evaluation.report import Column, Table
from perception.render.curve_plots import plot_curves
from perception.types import Modality

UNCHANGED = "all, without augmentation"
ALL = "1 of all"
_LEVEL, _LOOSE_IOU = "moderate", min(IOU)


def sim_to_real(
    drives: list[Path],
    *,
    training: VariantFlags,
    real: list[Path] | None = None,
    modality: Modality = "dm",
    size: str = "192x640",
    shares: tuple[float, ...] = (0.125, 0.25, 0.5, 1.0),
    leave_one_out: bool = False,
    public: list[Path] | None = None,
    out: Path = RESULTS / "sim-to-real.png",
) -> None:
    """Measure on real drives what is trained on synthetic ones, and how real these look to other networks.

    A detector is trained on more and more synthetic frames, without augmentation and, with --leave-one-out, without
    each of the drives in turn, which shows what its kind of street is worth. All take the same number of steps. A
    finished training is not repeated: the same command resumes where it was stopped. With --public, networks that
    were trained on photographs detect in the validation drives and in the real ones: the more alike their average
    precision, the more real the synthetic frames look.

    Example: trifuse study sim-to-real synth/train --validation synth/val --real kitti/object

    Args:
        drives: Synthetic training drives; shares take their first frames.
        real: Other labelled drives to measure on, with commas between them.
        modality: Camera image, rgb; depth map, dm; or reflectance map, rm.
        size: Height and width of the input.
        shares: Shares of the frames; one more training takes all, without augmentation. No share trains neither.
        leave_one_out: Also train without each drive in turn.
        public: Detectors in camera images of others, ONNX files or YAML files that describe them, with commas between
            them.
        out: Figure; the numbers and all trainings are written beside it.
    """
    base = training.variant(drives, modality, size)
    by_share = share_variants(base, shares) if shares or not (leave_one_out or public) else {}
    left_out = leave_out_variants(base, drives) if leave_one_out else {}
    metrics = study_variants(by_share | left_out, training, out.with_suffix(""), real or ())
    tables: dict[str, Table[Any]] = {}
    panels = []
    if by_share:
        of_shares = {name: metrics[name] for name in by_share}
        tables |= precision_tables("Shares of the training frames", of_shares, IOU)
        panels += frames_panels(_without(of_shares, UNCHANGED), IOU)
    if left_out:
        of_drives = {name: metrics[name] for name in left_out}
        tables |= loss_tables(of_drives)
        panels += variant_panels(of_drives, _LOOSE_IOU)
    measured = [*training.validation, *(real or ())]
    realism = measure_realism(public, measured) if public else {}
    for name, found in realism.items():
        title = f"{name}: AP R40 [% of maximum], {_LEVEL}, by distance"
        tables[title] = realism_table(title, found)
        panels += realism_panels(name, found)
    plot_curves(out, f"Synthetic drives and real ones, {modality}", panels)
    publish(
        out,
        "none: the thesis trains on KITTI",
        tables,
        {"variants": by_share | left_out, "training": training, "real": real, "public": public},
        variants=metrics,
        realism=realism,
    )


def share_variants(base: DetectorVariant, shares: Sequence[float]) -> dict[str, DetectorVariant]:
    """Return a variant for each share of the frames, with the same number of steps, and one without augmentation.

    Raises:
        UsageError: A share is out of range, or there are none.
    """
    if not shares or min(shares) <= 0 or max(shares) > 1:
        found = ", ".join(f"{share:g}" for share in shares) or "none"
        raise UsageError("--shares", expected="shares above 0, at most 1", found=found)
    variants = {
        f"{share:g} of all": base.but(
            data__training_fraction=share, trainer__max_epochs=round(_epochs(base) / share)
        )
        for share in shares
    }
    return {**variants, UNCHANGED: base.but(data__augment=False)}


def leave_out_variants(base: DetectorVariant, drives: Sequence[Path]) -> dict[str, DetectorVariant]:
    """Return a variant of all drives, and one without each of them, with about the same number of steps.

    Raises:
        UsageError: There are not two drives.
        PerceptionError: A drive cannot be read.
    """
    from data.open_drive import open_drives

    if len(drives) <= 1:
        expected, found = "two training drives or more", f"{len(drives)}"
        raise UsageError("--leave-one-out", expected=expected, found=found)
    counts = [sum(map(len, open_drives([drive]))) for drive in drives]
    variants = {ALL: base.but(data__training_fraction=1.0)}
    for left_out, count in zip(drives, counts, strict=True):
        rest = [drive for drive in drives if drive != left_out]
        epochs = round(_epochs(base) * sum(counts) / (sum(counts) - count))
        variants[f"without {_name(left_out, drives)}"] = base.but(
            data__drives=rest, data__training_fraction=1.0, trainer__max_epochs=epochs
        )
    return variants


def loss_tables(metrics: Mapping[str, VariantMetrics]) -> dict[str, Table[str]]:
    """Return for each measured drive what average precision is lost without each training drive.

    Args:
        metrics: Metrics of the variant of all drives, then of those without one.
    """
    tables, rest = {}, _without(metrics, ALL)
    for drive in metrics[ALL].drives:
        columns: list[Column[str]] = [
            Column("training frames", lambda name: rest[name].training_frames, key="frames")
        ]
        for iou in IOU:
            of = drive, iou, _LEVEL
            ap, loss = f"AP, IoU {iou:g}", f"loss, IoU {iou:g}"
            columns += [
                Column(ap, partial(precision_of, metrics, of), ".2f", ap),
                Column(loss, partial(_loss, metrics, of), "+.2f", loss),
            ]
        heading = f"Without one training drive: AP R40 [%] and its loss on {drive}, {_LEVEL}"
        tables[heading] = Table(heading, columns, {name: name for name in rest})
    return tables


def _loss(metrics: Mapping[str, VariantMetrics], of: tuple[str, float, str], name: str) -> float:
    return metrics[ALL].ap(*of) - metrics[name].ap(*of)


def _without(metrics: Mapping[str, VariantMetrics], name: str) -> dict[str, VariantMetrics]:
    return {key: one for key, one in metrics.items() if key != name}


def _epochs(variant: DetectorVariant) -> int:
    return int(str(variant.arguments["trainer.max_epochs"]))


def _name(drive: Path, drives: Sequence[Path]) -> str:
    """Return the name of a drive's folder, or its path where several have that name."""
    is_unique = [one.name for one in drives].count(drive.name) == 1
    return drive.name if is_unique else str(drive)
