"""Tables and documents of a search of the proposals' parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from perception.evaluation.detection.proposal_recall import IOU_STEPS, ProposalRecall, RecallMetrics
from perception.evaluation.report import Column, Table
from train.proposal_search.counting import ProposalCount
from train.proposal_search.recall import ProposalSetting

_SHOWN = 10


def best_table(counts: Sequence[ProposalCount], ious: Sequence[float]) -> Table[ProposalCount]:
    """Return the best parameters, one row each."""
    columns = [
        Column[ProposalCount]("cell [m]", lambda row: row.parameters.cell_m, "g"),
        Column[ProposalCount]("variance [m²]", lambda row: row.parameters.min_variance_m2, "g"),
        Column[ProposalCount]("points", lambda row: row.parameters.min_points),
        Column[ProposalCount]("radius [m]", lambda row: row.parameters.radius_m, "g"),
        *(
            Column[ProposalCount](
                f"recall at IoU {iou:g} [%]",
                lambda row, at=at: _percent(row.reached[at], row.objects),  # type: ignore[misc]
                ".1f",
            )
            for at, iou in enumerate(ious)
        ),
        Column[ProposalCount]("proposals/frame", lambda row: row.proposals / row.frames, ".1f"),
    ]
    rows = {str(place): count for place, count in enumerate(counts[:_SHOWN], start=1)}
    return Table(f"The best {len(rows)} of {len(counts)} settings", columns, rows)


def recall_table(
    recalls: Mapping[str, ProposalRecall],
) -> Table[tuple[ProposalRecall, RecallMetrics]]:
    """Return the recall of each setting, one row for each difficulty."""
    rows = {
        f"{name}, {difficulty}": (recall, metrics)
        for name, recall in recalls.items()
        for difficulty, metrics in recall.difficulties.items()
    }
    ious = list(next(iter(rows.values()))[1].ranks)
    columns = [
        Column[tuple[ProposalRecall, RecallMetrics]]("objects", lambda row: row[1].objects),
        *(
            Column[tuple[ProposalRecall, RecallMetrics]](
                f"recall at IoU {iou:g} [%]",
                lambda row, iou=iou: _percent(row[1].found(iou), row[1].objects),  # type: ignore[misc]
                ".1f",
            )
            for iou in ious
        ),
        Column[tuple[ProposalRecall, RecallMetrics]](
            "proposals/frame", lambda row: row[0].proposals_per_frame, ".1f"
        ),
    ]
    return Table("Recall of labelled objects", columns, rows)


def search_document(counts: Sequence[ProposalCount], ious: Sequence[float]) -> list[dict[str, Any]]:
    """Return all parameters with what they reach, the best first."""
    return [
        {
            **asdict(count.parameters),
            "reached": {f"{iou:g}": n for iou, n in zip(ious, count.reached, strict=True)},
            "objects": count.objects,
            "proposals": count.proposals,
            "frames": count.frames,
        }
        for count in counts
    ]


def recall_document(
    settings: Mapping[str, ProposalSetting], recalls: Mapping[str, ProposalRecall]
) -> dict[str, Any]:
    """Return the recall curves of each setting by difficulty."""
    return {
        name: {
            "parameters": settings[name].parameters,
            "method": settings[name].method,
            "frames": recall.frames,
            "proposals": recall.proposals,
            "difficulties": {
                difficulty: {
                    "objects": metrics.objects,
                    "found": {f"{iou:g}": metrics.found(iou) for iou in metrics.ranks},
                    "recall_by_proposals_per_frame": {
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


def _percent(part: int, whole: int) -> float | None:
    return 100 * part / whole if whole else None
