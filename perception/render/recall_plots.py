"""Curves of what proposals reach, one colour a setting. matplotlib is loaded only where one is drawn."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from perception.evaluation.detection.proposal_recall import IOU_STEPS, ProposalRecall, RecallMetrics
from perception.render.success_plots import SuccessPanel, plot_success
from perception.types import Float64

_MAX_PROPOSALS = 200  # beyond which no curve is drawn


def plot_recall_by_count(path: Path, title: str, recalls: Mapping[str, ProposalRecall]) -> None:
    """Draw recall over proposals a frame: a row for each IoU, a column for each difficulty.

    Args:
        path: of the PNG.
        title: of the figure.
        recalls: by the name of the setting.
    """
    most = max(1, *(min(recall.max_per_frame, _MAX_PROPOSALS) for recall in recalls.values()))
    one = next(iter(recalls.values())).difficulties
    panels = [
        SuccessPanel(
            title=f"{name}: {metrics.objects} objects, IoU {iou:g}",
            x_name="proposals looked at in a frame",
            x_last=most,
            y_name="recall",
            curves=_curves(
                recalls, name, partial(RecallMetrics.recall_by_count, iou=iou, most=most)
            ),
            values=_values(recalls, name, iou),
        )
        for iou in next(iter(one.values())).ranks
        for name, metrics in one.items()
    ]
    plot_success(path, title, panels, columns=len(one))


def plot_recall_by_iou(path: Path, title: str, recalls: Mapping[str, ProposalRecall]) -> None:
    """Draw recall of all proposals over the IoU that is asked of them, a panel for each difficulty.

    Args:
        path: of the PNG.
        title: of the figure.
        recalls: by the name of the setting.
    """
    one = next(iter(recalls.values())).difficulties
    iou = next(iter(next(iter(one.values())).ranks))
    panels = [
        SuccessPanel(
            title=f"{name}: {metrics.objects} objects",
            x_name="IoU of the best proposal, at least",
            x_last=float(IOU_STEPS[-1]),
            y_name="recall",
            curves=_curves(recalls, name, RecallMetrics.recall_by_iou),
            values={
                setting: f"{value} at IoU {iou:g}"
                for setting, value in _values(recalls, name, iou).items()
            },
        )
        for name, metrics in one.items()
    ]
    plot_success(path, title, panels, columns=len(one))


def _curves(
    recalls: Mapping[str, ProposalRecall],
    difficulty: str,
    curve_of: Callable[[RecallMetrics], Float64],
) -> dict[str, Float64]:
    """Return a curve a setting; none where there are no objects."""
    metrics = {name: recall.difficulties[difficulty] for name, recall in recalls.items()}
    return {
        name: curve_of(of_setting) for name, of_setting in metrics.items() if of_setting.objects
    }


def _values(recalls: Mapping[str, ProposalRecall], difficulty: str, iou: float) -> dict[str, str]:
    return {
        name: f"{100 * recall.difficulties[difficulty].recall(iou):.1f} %"
        for name, recall in recalls.items()
    }
