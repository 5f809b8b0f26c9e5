"""Tables and documents of a search of the proposals' parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from data.results.documents import write_json, write_yaml
from perception import __version__
from perception.detection.depthcn.proposal_order import ProposalOrder
from perception.evaluation.detection.proposal_recall import IOU_STEPS, ProposalRecall, RecallMetrics
from perception.evaluation.report import Column, Table
from perception.render.curve_plots import (
    plot_curves,
    recall_by_count_panels,
    recall_by_iou_panels,
)
from train.proposal_search.counting import ProposalCount
from train.proposal_search.search import SearchConfig
from train.proposal_search.survey import Survey

_SHOWN = 10
_ORDERS: Mapping[ProposalOrder, str] = {"size": "most like a car", "points": "most points"}


def summary(survey: Survey, best: ProposalCount) -> str:
    """Return the drives, frames and labels of a search in one line."""
    unread = f"; {best.unread} frames could not be read" if best.unread else ""
    labels = f"{best.objects} labels {survey.of_class}"
    return f"{len(survey.drives)} drives, {best.frames} frames, {labels}{unread}"


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


def write_report(
    out: Path,
    config: SearchConfig,
    counts: Sequence[ProposalCount],
    recalls: Mapping[str, ProposalRecall],
    order: ProposalOrder,
) -> list[Path]:
    """Write the best parameters, a document of all and plots of the recall; return the files.

    Args:
        out: Folder of the results.
        config: Drives and values of the search.
        counts: Counts of all parameters, the best first.
        recalls: Recall of the best parameters and of others, by name.
        order: Order of the proposals in the curves.
    """
    names = ("parameters.yaml", "search.json", "recall_by_count.png", "recall_by_iou.png")
    parameters, document, by_count, by_iou = files = [out / name for name in names]
    best, first = counts[0], f"{_ORDERS[order]} first"
    write_yaml(parameters, best.parameters)
    title = f"Proposals of {best.frames} frames, {best.objects} {config.survey.of_class} labels"
    columns = len(next(iter(recalls.values())).difficulties)
    plot_curves(by_count, f"{title}; {first}", recall_by_count_panels(recalls), columns=columns)
    plot_curves(by_iou, title, recall_by_iou_panels(recalls), columns=columns)
    write_json(
        document,
        {
            "program": f"trifuse {__version__}",
            "objective": "most labelled objects reached at the first IoU; then fewest proposals",
            "search": config.identity(),
            "grid": config.grid,
            "settings": [
                {
                    **asdict(count.parameters),
                    "reached": dict(
                        zip(map("{:g}".format, config.overlaps), count.reached, strict=True)
                    ),
                    "objects": count.objects,
                    "proposals": count.proposals,
                    "frames": count.frames,
                }
                for count in counts
            ],
            "order": first,
            "recall": {name: _recall_document(recall) for name, recall in recalls.items()},
        },
    )
    return [*files, out / "counts.jsonl"]


def _recall_document(recall: ProposalRecall) -> dict[str, Any]:
    return {
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


def _percent(part: int, whole: int) -> float | None:
    return 100 * part / whole if whole else None
