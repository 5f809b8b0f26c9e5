"""HOTA, CLEAR and identity of one sequence, or of several, together."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from perception.evaluation.multi_object.clear import Clear, clear
from perception.evaluation.multi_object.hota import Hota, hota
from perception.evaluation.multi_object.identity import Identity, identity
from perception.evaluation.multi_object.sequence import TrackedSequence
from perception.evaluation.report import Column, Table


@dataclass(frozen=True)
class MotMetrics:
    """Metrics of multi-object tracking; those of several sequences are added.

    Attributes:
        hota: HOTA over all thresholds.
        clear: CLEAR at one threshold.
        identity: Identity metrics at the same threshold.
    """

    hota: Hota = field(default_factory=Hota)
    clear: Clear = field(default_factory=Clear)
    identity: Identity = field(default_factory=Identity)

    def __add__(self, other: "MotMetrics") -> "MotMetrics":
        """Return the metrics of both, as of one longer sequence."""
        return MotMetrics(
            self.hota + other.hota, self.clear + other.clear, self.identity + other.identity
        )

    def to_json(self) -> dict[str, Any]:
        """Return ratios from 0 to 1 and counts, by the names of the literature."""
        hota = self.hota
        at_each = {"HOTA": hota.hota, "DetA": hota.det_a, "AssA": hota.ass_a, "LocA": hota.loc_a}
        counts = {"TP": hota.true_positives, "FP": hota.false_positives, "FN": hota.false_negatives}
        scalars = {name: value(self) for name, value in {**_RATIOS, **_COUNTS}.items()}
        return {**scalars, "per_alpha": {**at_each, **counts}}


def evaluate_tracks(sequence: TrackedSequence, threshold: float = 0.5) -> MotMetrics:
    """Measure one sequence.

    Args:
        sequence: Frames in order.
        threshold: Similarity at which CLEAR and identity match.
    """
    return MotMetrics(hota(sequence), clear(sequence, threshold), identity(sequence, threshold))


_RATIOS: dict[str, Callable[[MotMetrics], float]] = {
    "HOTA": lambda m: float(m.hota.hota.mean()),
    "DetA": lambda m: float(m.hota.det_a.mean()),
    "AssA": lambda m: float(m.hota.ass_a.mean()),
    "LocA": lambda m: float(m.hota.loc_a.mean()),
    "DetRe": lambda m: float(m.hota.det_re.mean()),
    "DetPr": lambda m: float(m.hota.det_pr.mean()),
    "AssRe": lambda m: float(m.hota.ass_re.mean()),
    "AssPr": lambda m: float(m.hota.ass_pr.mean()),
    "HOTA(0)": lambda m: float(m.hota.hota[0]),
    "LocA(0)": lambda m: float(m.hota.loc_a[0]),
    "MOTA": lambda m: m.clear.mota,
    "MODA": lambda m: m.clear.moda,
    "sMOTA": lambda m: m.clear.smota,
    "MOTP": lambda m: m.clear.motp,
    "IDF1": lambda m: m.identity.idf1,
    "IDP": lambda m: m.identity.idp,
    "IDR": lambda m: m.identity.idr,
}
_COUNTS: dict[str, Callable[[MotMetrics], int]] = {
    "TP": lambda m: m.clear.true_positives,
    "FP": lambda m: m.clear.false_positives,
    "FN": lambda m: m.clear.false_negatives,
    "IDSW": lambda m: m.clear.id_switches,
    "Frag": lambda m: m.clear.fragmentations,
    "MT": lambda m: m.clear.mostly_tracked,
    "PT": lambda m: m.clear.partly_tracked,
    "ML": lambda m: m.clear.mostly_lost,
    "IDTP": lambda m: m.identity.true_positives,
    "IDFP": lambda m: m.identity.false_positives,
    "IDFN": lambda m: m.identity.false_negatives,
}


def mot_table(title: str, metrics: Mapping[str, MotMetrics]) -> Table[MotMetrics]:
    """Return the table of several sequences or trackers: ratios in percent, then counts."""
    ratios = [_percent_column(n) for n in ("HOTA", "DetA", "AssA", "LocA", "MOTA", "MOTP", "IDF1")]
    counts = [
        Column(name, value)
        for name, value in _COUNTS.items()
        if len(name) < 3 or name in ("IDSW", "Frag")
    ]
    return Table(title, [*ratios, *counts], metrics)


def _percent_column(name: str) -> Column[MotMetrics]:
    return Column(name, lambda metrics: 100 * _RATIOS[name](metrics), ".3f")
