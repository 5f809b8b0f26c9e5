"""HOTA, CLEAR and identity of one sequence, or of several, together."""

from collections.abc import Mapping
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
        return {**_hota_json(self.hota), **_clear_json(self.clear), **_identity_json(self.identity)}


def evaluate_tracks(sequence: TrackedSequence, threshold: float = 0.5) -> MotMetrics:
    """Measure one sequence.

    Args:
        sequence: Frames in order.
        threshold: Similarity at which CLEAR and identity match.
    """
    return MotMetrics(hota(sequence), clear(sequence, threshold), identity(sequence, threshold))


_COLUMNS = (
    Column[MotMetrics]("HOTA", lambda m: 100 * m.hota.hota, ".3f"),
    Column[MotMetrics]("DetA", lambda m: 100 * m.hota.det_a, ".3f"),
    Column[MotMetrics]("AssA", lambda m: 100 * m.hota.ass_a, ".3f"),
    Column[MotMetrics]("LocA", lambda m: 100 * m.hota.loc_a, ".3f"),
    Column[MotMetrics]("MOTA", lambda m: 100 * m.clear.mota, ".3f"),
    Column[MotMetrics]("MOTP", lambda m: 100 * m.clear.motp, ".3f"),
    Column[MotMetrics]("IDF1", lambda m: 100 * m.identity.idf1, ".3f"),
    Column[MotMetrics]("TP", lambda m: m.clear.true_positives),
    Column[MotMetrics]("FP", lambda m: m.clear.false_positives),
    Column[MotMetrics]("FN", lambda m: m.clear.false_negatives),
    Column[MotMetrics]("IDSW", lambda m: m.clear.id_switches),
    Column[MotMetrics]("Frag", lambda m: m.clear.fragmentations),
    Column[MotMetrics]("MT", lambda m: m.clear.mostly_tracked),
    Column[MotMetrics]("PT", lambda m: m.clear.partly_tracked),
    Column[MotMetrics]("ML", lambda m: m.clear.mostly_lost),
)


def mot_table(title: str, metrics: Mapping[str, MotMetrics]) -> Table[MotMetrics]:
    """Return the table of several sequences or trackers: ratios in percent, then counts."""
    return Table(title, _COLUMNS, metrics)


def _hota_json(hota: Hota) -> dict[str, Any]:
    return {
        "HOTA": hota.hota,
        "DetA": hota.det_a,
        "AssA": hota.ass_a,
        "LocA": hota.loc_a,
        "DetRe": hota.det_re,
        "DetPr": hota.det_pr,
        "AssRe": hota.ass_re,
        "AssPr": hota.ass_pr,
        "HOTA(0)": float(hota.hota_by_alpha[0]),
        "LocA(0)": float(hota.loc_a_by_alpha[0]),
        "per_alpha": {
            "HOTA": hota.hota_by_alpha,
            "DetA": hota.det_a_by_alpha,
            "AssA": hota.ass_a_by_alpha,
            "LocA": hota.loc_a_by_alpha,
            "TP": hota.true_positives,
            "FP": hota.false_positives,
            "FN": hota.false_negatives,
        },
    }


def _clear_json(clear: Clear) -> dict[str, Any]:
    return {
        "MOTA": clear.mota,
        "MODA": clear.moda,
        "sMOTA": clear.smota,
        "MOTP": clear.motp,
        "TP": clear.true_positives,
        "FP": clear.false_positives,
        "FN": clear.false_negatives,
        "IDSW": clear.id_switches,
        "Frag": clear.fragmentations,
        "MT": clear.mostly_tracked,
        "PT": clear.partly_tracked,
        "ML": clear.mostly_lost,
    }


def _identity_json(identity: Identity) -> dict[str, Any]:
    return {
        "IDF1": identity.idf1,
        "IDP": identity.idp,
        "IDR": identity.idr,
        "IDTP": identity.true_positives,
        "IDFP": identity.false_positives,
        "IDFN": identity.false_negatives,
    }
