"""The figures of `trifuse train proposals`, for people and for programs."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from perception.cli.table import Cell, format_table, percent
from perception.detection.config import ProposalConfig
from perception.evaluation.detection.proposal_recall import IOU_STEPS, ProposalRecall, RecallMetrics
from train.proposal_search.counting import ProposalCount
from train.proposal_search.recall import ProposalSetting

_SHOWN = 10
_RULE_NAMES = ("cell [m]", "variance [m²]", "points", "radius [m]")


def best_table(table: Sequence[ProposalCount], overlaps: Sequence[float]) -> str:
    """Return the best settings, one a row."""
    shown = table[:_SHOWN]
    reached = [f"IoU {iou:g}" for iou in overlaps]
    header = ("", *_RULE_NAMES, *reached, "proposals a frame")
    rows: list[list[Cell]] = [
        [
            str(place),
            *_rule_cells(count.rules),
            *_reached_cells(count),
            f"{count.proposals / count.frames:.1f}",
        ]
        for place, count in enumerate(shown, start=1)
    ]
    return format_table(f"The best {len(shown)} of {len(table)} settings", header, rows)


def recall_table(recalls: Mapping[str, ProposalRecall]) -> str:
    """Return what each setting reaches, a row a difficulty."""
    overlaps = list(_any_difficulty(recalls).ranks)
    header = ("", "objects", *(f"recall at IoU {iou:g}" for iou in overlaps), "proposals a frame")
    rows: list[list[Cell]] = [
        [
            f"{name}, {difficulty}",
            metrics.objects,
            *(percent(metrics.found(iou), metrics.objects) for iou in overlaps),
            f"{recall.proposals_per_frame:.1f}",
        ]
        for name, recall in recalls.items()
        for difficulty, metrics in recall.difficulties.items()
    ]
    return format_table("Objects that some proposal reaches", header, rows)


def search_document(
    table: Sequence[ProposalCount], overlaps: Sequence[float]
) -> list[dict[str, Any]]:
    """Return every setting, the best first, for programs."""
    return [
        {
            **asdict(count.rules),
            "reached": {f"{iou:g}": n for iou, n in zip(overlaps, count.reached, strict=True)},
            "objects": count.objects,
            "proposals": count.proposals,
            "frames": count.frames,
        }
        for count in table
    ]


def recall_document(
    settings: Mapping[str, ProposalSetting], recalls: Mapping[str, ProposalRecall]
) -> dict[str, Any]:
    """Return the curves of each setting by difficulty, for programs."""
    return {
        name: {
            "rules": settings[name].rules,
            "method": settings[name].method,
            "frames": recall.frames,
            "proposals": recall.proposals,
            "difficulties": {
                difficulty: {
                    "objects": metrics.objects,
                    "found": {f"{iou:g}": metrics.found(iou) for iou in metrics.ranks},
                    "recall_by_proposals_a_frame": {
                        f"{iou:g}": metrics.recall_by_count(iou, recall.max_per_frame)
                        for iou in metrics.ranks
                    },
                    "iou": IOU_STEPS,
                    "recall_by_iou": metrics.recall_by_iou(),
                }
                for difficulty, metrics in recall.difficulties.items()
            },
        }
        for name, recall in recalls.items()
    }


def _any_difficulty(recalls: Mapping[str, ProposalRecall]) -> RecallMetrics:
    return next(iter(next(iter(recalls.values())).difficulties.values()))


def _rule_cells(rules: ProposalConfig) -> list[Cell]:
    return [
        f"{rules.cell_m:g}",
        f"{rules.min_variance_m2:g}",
        rules.min_points,
        f"{rules.radius_m:g}",
    ]


def _reached_cells(count: ProposalCount) -> list[Cell]:
    return [f"{reached} ({percent(reached, count.objects)})" for reached in count.reached]
