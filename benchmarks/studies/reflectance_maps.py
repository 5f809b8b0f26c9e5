"""Average precision of a detector by the method and the size of its reflectance map (Appendix B)."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from benchmarks.studies.detector_variants import DetectorVariant, VariantFlags, study_variants
from benchmarks.studies.report import RESULTS, publish
from benchmarks.studies.variant_report import (
    Percent,
    plot_variant_curves,
    precision_tables,
    times_table,
)
from perception.evaluation.report import Table
from perception.types import MapFilling

SPARSE, NEAREST, LINEAR, NATURAL = "sparse", "nearest", "linear", "natural"
TRIFUSE, WIDE = "Trifuse", "nearest, wide"
# Tables B.2 and B.3, 1496 frames: easy, moderate, hard. RM is nearest; RM* the same at 1216x352.
THESIS_B2: Mapping[str, Percent] = {
    SPARSE: (23.45, 17.57, 15.57),
    NEAREST: (67.69, 51.91, 44.98),
    WIDE: (72.67, 62.65, 54.89),
}
THESIS_B3: Mapping[str, Percent] = {
    NEAREST: (67.69, 51.91, 44.98),
    LINEAR: (60.60, 45.71, 40.79),
    NATURAL: (65.25, 50.07, 44.76),
}
THESIS_B1_MS = (34.0, 15.0)
_FILLINGS: Mapping[str, MapFilling] = {
    SPARSE: "sparse",
    NEAREST: "nearest",
    LINEAR: "linear",
    NATURAL: "natural",
    TRIFUSE: "default",
}
_IOU = 0.7


def reflectance_maps(
    drives: list[Path],
    *,
    training: VariantFlags,
    size: str = "416x416",
    wide_size: str = "352x1216",
    training_config: Literal["default", "thesis"] = "default",
    out: Path = RESULTS / "reflectance-maps.png",
) -> None:
    """Train a detector on sparse, interpolated and wide reflectance maps (Tables B.1, B.2 and B.3).

    A finished training is not repeated: the same command resumes where it was stopped.

    Example: trifuse study reflectance-maps synth/train --validation synth/val --epochs 20

    Args:
        drives: Labelled training drives.
        size: Height and width of the input.
        wide_size: Height and width of the input of RM* in Table B.2.
        training_config: Configuration of the trainings: default, or that of 7.2.2, thesis.
        out: Figure; the numbers and all trainings are written beside it.
    """
    variants = map_variants(training.variant(drives, "rm", size, training_config), wide_size)
    metrics = study_variants(variants, training, out.with_suffix(""))
    plot_variant_curves(out, "Detectors of the reflectance map", metrics, _IOU)
    tables: dict[str, Table[Any]] = {}
    for title, thesis in (
        ("Sparse, dense and wide (Table B.2)", THESIS_B2),
        ("Interpolations (Table B.3)", THESIS_B3),
    ):
        compared = {name: metrics[name] for name in (*thesis, TRIFUSE)}
        tables |= precision_tables(title, compared, [_IOU], thesis)
    title = "Time per frame (Table B.1; the thesis' on a GPU)"
    tables[title] = times_table(title, metrics, THESIS_B1_MS)
    publish(
        out,
        "Tables B.1, B.2 and B.3",
        tables,
        {"variants": variants, "training": training},
        variants=metrics,
    )


def map_variants(base: DetectorVariant, wide_size: str) -> dict[str, DetectorVariant]:
    """Return a variant for each method to fill the map, and one of a wider input.

    Args:
        base: Variant from which the others differ.
        wide_size: Height and width of the wide input.
    """
    variants = {name: base.but(model__filling=filling) for name, filling in _FILLINGS.items()}
    return {**variants, WIDE: variants[NEAREST].but(model__size=wide_size)}
