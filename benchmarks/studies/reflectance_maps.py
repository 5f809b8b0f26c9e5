"""How the reflectance map is made, and how large it is: what a detector comes to by each (Appendix B)."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from benchmarks.studies.detector_variants import (
    DetectorVariant,
    VariantEvaluationConfig,
    VariantTrainingConfig,
    study_variants,
)
from benchmarks.studies.report import Study
from benchmarks.studies.variant_report import (
    Percent,
    plot_variant_curves,
    precision_tables,
    times_table,
)
from perception.detection.detectors.modalities import MapFilling

SPARSE, NEAREST, LINEAR, NATURAL = "sparse", "nearest", "linear", "natural"
TRIFUSE, WIDE = "ours", "nearest, wide"
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


def map_variants(base: DetectorVariant, wide_size: str) -> list[DetectorVariant]:
    """Return a detector for each way to make the map, and one of a wider input.

    Args:
        base: what they have in common.
        wide_size: of RM*.
    """
    variants = [
        replace(
            base,
            name=name,
            experiment=replace(
                base.experiment, model=replace(base.experiment.model, filling=filling)
            ),
        )
        for name, filling in _FILLINGS.items()
    ]
    wide = replace(base.experiment.model, filling=_FILLINGS[NEAREST], size=wide_size)
    return [*variants, replace(base, name=WIDE, experiment=replace(base.experiment, model=wide))]


def study_reflectance_maps(
    variants: list[DetectorVariant],
    conditions: VariantTrainingConfig,
    evaluation: VariantEvaluationConfig,
    plot_path: Path,
) -> Study:
    """Train all, and print Tables B.1, B.2 and B.3."""
    metrics = study_variants(variants, conditions, evaluation, plot_path.with_suffix(""))
    plot_variant_curves(plot_path, "Detectors of the reflectance map", metrics, _IOU)
    tables = [
        precision_tables(
            "Sparse, dense and wide (Table B.2)",
            {name: metrics[name] for name in (*THESIS_B2, TRIFUSE)},
            _IOU,
            THESIS_B2,
        ),
        precision_tables(
            "Interpolations (Table B.3)",
            {name: metrics[name] for name in (*THESIS_B3, TRIFUSE)},
            _IOU,
            THESIS_B3,
        ),
        times_table("Time of a frame (Table B.1; the thesis' on a GPU)", metrics, THESIS_B1_MS),
    ]
    return Study(
        name="reflectance-maps",
        repeats="Tables B.1, B.2 and B.3",
        table="\n\n".join(tables),
        numbers=metrics,
        conditions={
            "variants": variants,
            "training": conditions,
            "judging": evaluation,
            "thesis": {"B.1 ms": THESIS_B1_MS, "B.2": THESIS_B2, "B.3": THESIS_B3},
        },
    )
