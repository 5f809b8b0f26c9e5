"""HOTA, CLEAR and identity, for people and for programs, by the names of the field."""

from collections.abc import Mapping
from typing import Any

from perception.cli.table import Cell, format_table
from perception.evaluation.multi_object.clear import Clear
from perception.evaluation.multi_object.hota import Hota
from perception.evaluation.multi_object.identity import Identity
from perception.evaluation.multi_object.mot_metrics import MotMetrics

_PERCENT = ("HOTA", "DetA", "AssA", "LocA", "MOTA", "MOTP", "IDF1")
_COUNTS = ("TP", "FP", "FN", "IDSW", "Frag", "MT", "PT", "ML")


def mot_table(title: str, scores: Mapping[str, MotMetrics]) -> str:
    """Return one row for each name: ratios in percent, then counts."""
    rows: list[list[Cell]] = []
    for name, score in scores.items():
        metrics = mot_results(score)
        ratios = [100.0 * metrics[column] for column in _PERCENT]
        rows.append([name, *ratios, *(metrics[column] for column in _COUNTS)])
    return format_table(title, ("", *_PERCENT, *_COUNTS), rows)


def mot_results(scores: MotMetrics) -> dict[str, Any]:
    """Return all figures: ratios from 0 to 1, and counts."""
    return {
        **hota_results(scores.hota),
        **clear_results(scores.clear),
        **identity_results(scores.identity),
    }


def hota_results(hota: Hota) -> dict[str, Any]:
    """Return the means over all thresholds, and the figures at each."""
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


def clear_results(clear: Clear) -> dict[str, Any]:
    """Return the CLEAR ratios and counts."""
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


def identity_results(identity: Identity) -> dict[str, Any]:
    """Return the identity ratios and counts."""
    return {
        "IDF1": identity.idf1,
        "IDP": identity.idp,
        "IDR": identity.idr,
        "IDTP": identity.true_positives,
        "IDFP": identity.false_positives,
        "IDFN": identity.false_negatives,
    }
