"""`trifuse train proposals`: the parameters of the proposals that reach most labelled objects (6.1.4)."""

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from data.samples.config import OnBadFrame
from perception import __version__
from perception.types import Method
from train.proposal_search.grid import SearchGrid

if TYPE_CHECKING:
    from train.proposal_search.recall import ProposalSetting
    from train.proposal_search.search import FinishedTasks

_GRID = SearchGrid()
_IOUS = (0.7, 0.5)
_ORDERS = {"size": "most like a car", "points": "most points"}
_FILES = (
    "parameters.yaml",
    "search.json",
    "recall_by_count.png",
    "recall_by_iou.png",
    "counts.jsonl",
)
_OBJECTIVE = (
    "the most labelled objects that a proposal overlaps by the first IoU; then the fewest proposals"
)


def train_proposals(  # noqa: PLR0913 - flags of a command
    drives: list[Path],
    *,
    grid: SearchGrid = _GRID,
    method: Method = "default",
    object_class: str = "Car",
    iou: tuple[float, ...] = _IOUS,
    order: Literal["size", "points"] = "size",
    every: int = 1,
    workers: int | None = None,
    on_bad_frame: OnBadFrame = "stop",
    out: Path = Path("results") / "proposals",
) -> None:
    """Search all combinations of the proposals' four parameters, and plot the recall of the best.

    An interrupted search continues when the same command is given again. It writes parameters.yaml, the best
    combination; search.json, all of them; and plots of recall over proposals and over IoU.

    Example: trifuse train proposals kitti/object synthetic/val --grid.radius-m 0.4,0.5,0.6

    Args:
        drives: Labelled drives of any layout; of a folder of several, all are taken.
        grid: Values that are tried.
        method: Method of the proposals: default or thesis.
        object_class: Class of the objects to reach.
        iou: IoU thresholds; the recall at the first is maximized.
        order: Order of the proposals in the curves: size, most like a car's first; or points, most points first.
        every: Stride of the frames of each drive.
        workers: Number of processes; else one for each core.
        on_bad_frame: Stop at a damaged frame, or skip it with a warning.
        out: Folder of the results.
    """
    from data.results.documents import usable_cores, write_json, write_yaml
    from perception.cli.progress import frame_progress_bar, progress_bar
    from perception.render.curve_plots import (
        plot_curves,
        recall_by_count_panels,
        recall_by_iou_panels,
    )
    from train.proposal_search.recall import ProposalSetting, measure_recall
    from train.proposal_search.report import (
        best_table,
        recall_document,
        recall_table,
        search_document,
    )
    from train.proposal_search.search import SearchConfig, search
    from train.proposal_search.survey import survey

    processes = usable_cores() if workers is None else workers
    found = survey(drives, object_class, every=every, progress=frame_progress_bar("labels"))
    config = SearchConfig(found, grid, method, iou, on_bad_frame=on_bad_frame)
    counts = search(config, out / "counts.jsonl", processes, _search_bar)
    best = counts[0]
    write_yaml(out / "parameters.yaml", best.parameters)
    unread = f"; {best.unread} frames could not be read" if best.unread else ""
    print(
        f"{len(found.drives)} drives, {best.frames} frames, {best.objects} labels {object_class}{unread}"
    )
    print(f"\n{best_table(counts, iou).text()}\n", flush=True)

    settings = _settings(ProposalSetting(best.parameters, method))
    bar = partial(progress_bar, unit="part", delay_s=2)
    measured = measure_recall(
        config,
        list(settings.values()),
        order,
        processes,
        lambda gathered, parts: bar(gathered, "recall", parts),
    )
    recalls = dict(zip(settings, measured, strict=True))
    print(recall_table(recalls).text())
    title = f"Proposals of {best.frames} frames, {best.objects} {object_class} labels"
    columns = len(next(iter(recalls.values())).difficulties)
    plot_curves(
        out / "recall_by_count.png",
        f"{title}; {_ORDERS[order]} first",
        recall_by_count_panels(recalls),
        columns=columns,
    )
    plot_curves(out / "recall_by_iou.png", title, recall_by_iou_panels(recalls), columns=columns)
    document = {
        "program": f"trifuse {__version__}",
        "objective": _OBJECTIVE,
        "search": config.identity(),
        "grid": grid,
        "settings": search_document(counts, iou),
        "order": f"{_ORDERS[order]} first",
        "recall": recall_document(settings, recalls),
    }
    write_json(out / "search.json", document)
    print("\n".join(["", *(str(out / name) for name in _FILES)]))


def _settings(best: "ProposalSetting") -> dict[str, "ProposalSetting"]:
    """Return the settings that are plotted, by name; equal ones are plotted once."""
    from train.proposal_search.recall import ProposalSetting

    names = {best: "best"}
    for name, setting in (
        ("default", ProposalSetting()),
        ("thesis", ProposalSetting(method="thesis")),
    ):
        names[setting] = f"{names[setting]} = {name}" if setting in names else name
    return {name: setting for setting, name in names.items()}


def _search_bar(finished: "FinishedTasks", done: int, parts: int) -> "FinishedTasks":
    from tqdm import tqdm

    bar: FinishedTasks = tqdm(
        finished, "search", parts, initial=done, unit="part", file=sys.stderr, smoothing=0.05
    )
    return bar
