"""HOTA, CLEAR and identity of one sequence, or of several, together.

Identity: every true object is assigned one track for the whole sequence, or none. E. Ristani et al., "Performance
Measures and a Data Set for Multi-Target, Multi-Camera Tracking", ECCV Workshops 2016.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from perception.evaluation.multi_object.clear import Clear, clear, ratio
from perception.evaluation.multi_object.hota import Hota, hota
from perception.evaluation.multi_object.matching import max_weight_matching
from perception.evaluation.multi_object.sequence import TrackedSequence, group_by_track, pair_boxes
from perception.evaluation.report import Column, SummedMetrics, Table

_PRINTED_RATIOS = ("HOTA", "DetA", "AssA", "LocA", "MOTA", "MOTP", "IDF1")
_PRINTED_COUNTS = ("TP", "FP", "FN", "IDSW", "Frag", "MT", "PT", "ML")


@dataclass(frozen=True)
class Identity(SummedMetrics):
    """Counts at one threshold; those of several sequences are added. Ratios without a denominator are 0.

    Attributes:
        true_positives: Number of frames in which an object overlaps its assigned track, over all objects.
        false_positives: Number of all other predicted boxes.
        false_negatives: Number of all other true boxes.
    """

    true_positives: int = 0
    false_positives: int = 0
    false_negatives: int = 0

    @property
    def idf1(self) -> float:
        """Harmonic mean of identity precision and recall."""
        wrong = self.false_positives + self.false_negatives
        return ratio(2 * self.true_positives, 2 * self.true_positives + wrong)

    @property
    def idp(self) -> float:
        """Identity precision: share of the predicted boxes."""
        return ratio(self.true_positives, self.true_positives + self.false_positives)

    @property
    def idr(self) -> float:
        """Identity recall: share of the true boxes."""
        return ratio(self.true_positives, self.true_positives + self.false_negatives)


def identity(sequence: TrackedSequence, threshold: float = 0.5) -> Identity:
    """Measure one sequence; several are combined by adding their results.

    Args:
        sequence: Frames in order.
        threshold: Similarity from which on two boxes count as overlapping.
    """
    paired = pair_boxes(sequence, threshold)
    track_pairs = group_by_track(paired.pairs)
    overlaps = track_pairs.sums(paired.pairs.similarity > 0)
    # A pair that overlaps in c frames saves c misses and c false positives, so the assignment of least cost
    # is the one of most overlapping frames.
    is_assigned = max_weight_matching(track_pairs.truths, track_pairs.tracks, overlaps)
    true_positives = int(overlaps[is_assigned].sum())
    return Identity(
        true_positives=true_positives,
        false_positives=int(paired.track_lengths.sum()) - true_positives,
        false_negatives=int(paired.truth_lengths.sum()) - true_positives,
    )


@dataclass(frozen=True)
class MotMetrics(SummedMetrics):
    """Metrics of multi-object tracking; those of several sequences are added.

    Attributes:
        hota: HOTA over all thresholds.
        clear: CLEAR at one threshold.
        identity: Identity metrics at the same threshold.
    """

    hota: Hota = field(default_factory=Hota)
    clear: Clear = field(default_factory=Clear)
    identity: Identity = field(default_factory=Identity)

    def ratios(self) -> dict[str, float]:
        """Return ratios from 0 to 1 by the names of the literature, those of HOTA averaged over its thresholds."""
        hota, clear, identity = self.hota, self.clear, self.identity
        # fmt: off
        at_thresholds = {
            "HOTA": hota.hota, "DetA": hota.det_a, "AssA": hota.ass_a, "LocA": hota.loc_a,
            "DetRe": hota.det_re, "DetPr": hota.det_pr, "AssRe": hota.ass_re, "AssPr": hota.ass_pr,
        }
        return {
            **{name: float(ratio.mean()) for name, ratio in at_thresholds.items()},
            "HOTA(0)": float(hota.hota[0]), "LocA(0)": float(hota.loc_a[0]),
            "MOTA": clear.mota, "MODA": clear.moda, "sMOTA": clear.smota, "MOTP": clear.motp,
            "IDF1": identity.idf1, "IDP": identity.idp, "IDR": identity.idr,
        }
        # fmt: on

    def counts(self) -> dict[str, int]:
        """Return counts of boxes, switches and objects by the names of the literature."""
        clear, identity = self.clear, self.identity
        # fmt: off
        return {
            "TP": clear.true_positives, "FP": clear.false_positives, "FN": clear.false_negatives,
            "IDSW": clear.id_switches, "Frag": clear.fragmentations,
            "MT": clear.mostly_tracked, "PT": clear.partly_tracked, "ML": clear.mostly_lost,
            "IDTP": identity.true_positives, "IDFP": identity.false_positives,
            "IDFN": identity.false_negatives,
        }
        # fmt: on

    def to_json(self) -> dict[str, Any]:
        """Return all ratios and counts, and those of HOTA at each threshold."""
        hota = self.hota
        at_each = {"HOTA": hota.hota, "DetA": hota.det_a, "AssA": hota.ass_a, "LocA": hota.loc_a}
        counts = {"TP": hota.true_positives, "FP": hota.false_positives, "FN": hota.false_negatives}
        return {**self.ratios(), **self.counts(), "per_alpha": {**at_each, **counts}}


def evaluate_tracks(sequence: TrackedSequence, threshold: float = 0.5) -> MotMetrics:
    """Measure one sequence.

    Args:
        sequence: Frames in order.
        threshold: Similarity at which CLEAR and identity match.
    """
    return MotMetrics(hota(sequence), clear(sequence, threshold), identity(sequence, threshold))


def mot_table(title: str, metrics: Mapping[str, MotMetrics]) -> Table[dict[str, float]]:
    """Return the table of several sequences or trackers: ratios in percent, then counts."""
    columns = [
        Column[dict[str, float]](name, lambda row, name=name: row[name], spec)  # type: ignore[misc]
        for names, spec in ((_PRINTED_RATIOS, ".3%"), (_PRINTED_COUNTS, ""))
        for name in names
    ]
    return Table(
        title, columns, {n: {**one.ratios(), **one.counts()} for n, one in metrics.items()}
    )
