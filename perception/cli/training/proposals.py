"""`trifuse train proposals`: the rules of the proposals that reach most labelled objects (6.1.4)."""

import sys
from pathlib import Path

from tqdm import tqdm

from data.frames import OnBadFrame
from data.results.documents import usable_cores, write_json, write_yaml
from perception import __version__
from perception.cli.progress import frame_progress_bar, progress_bar
from perception.cli.training.proposal_tables import (
    best_table,
    recall_document,
    recall_table,
    search_document,
)
from perception.detection.depthcn.proposal_order import ProposalOrder
from perception.evaluation.detection.proposal_recall import IOU_THRESHOLDS
from perception.render.curve_plots import (
    plot_curves,
    recall_by_count_panels,
    recall_by_iou_panels,
)
from perception.types import Method
from train.proposal_search.counting import ProposalCount
from train.proposal_search.grid import SearchGrid
from train.proposal_search.recall import CollectedProposals, ProposalSetting, measure_recall
from train.proposal_search.search import FinishedTasks, SearchConfig, search
from train.proposal_search.survey import Survey, survey

_ORDERS: dict[ProposalOrder, str] = {"size": "most like a car", "points": "most returns"}
_GRID = SearchGrid()
_FILES = ("rules.yaml", "search.json", "recall_by_count.png", "recall_by_iou.png", "counts.jsonl")
_OBJECTIVE = (
    "the most labelled objects that some proposal overlaps by the first IoU or more; of equals, the "
    "fewest proposals"
)


def proposals(  # noqa: PLR0913 - flags of a command
    drives: list[Path],
    *,
    grid: SearchGrid = _GRID,
    method: Method = "default",
    object_class: str = "Car",
    iou: tuple[float, ...] = IOU_THRESHOLDS,
    order: ProposalOrder = "size",
    every: int = 1,
    workers: int | None = None,
    on_bad_frame: OnBadFrame = "stop",
    out: Path = Path("results") / "proposals",
) -> None:
    """Try all combinations of the four rules of the proposals, and draw what the best one reaches.

    A search that was ended goes on where it stopped when the same command is given again. It leaves
    rules.yaml (the best setting), search.json (all of them), and recall over proposals and over IoU.

    Example: trifuse train proposals kitti/object synthetic/val --grid.radius-m [0.4,0.5,0.6]

    Args:
        drives: labelled drives of any layout; of a folder of several, all are taken.
        grid: values that are tried.
        method: default, or thesis.
        object_class: type of the objects that have to be reached.
        iou: overlaps that are counted; the first is maximised.
        order: which proposals of a frame the curves take first: size (most like a car's) or points (most returns).
        every: take each such frame of a drive.
        workers: processes; else one a core.
        on_bad_frame: stop at a damaged frame, or leave it out and say so.
        out: folder of the results.
    """
    processes = usable_cores() if workers is None else workers
    found = survey(drives, object_class, every=every, progress=frame_progress_bar("labels"))
    config = SearchConfig(found, grid, method, iou, on_bad_frame=on_bad_frame)
    table = search(config, out / "counts.jsonl", processes, _search_bar)
    write_yaml(out / "rules.yaml", table[0].rules)
    print(f"{_describe(found, table[0])}\n\n{best_table(table, iou)}\n", flush=True)
    settings = _settings(ProposalSetting(table[0].rules, method))
    measured = measure_recall(config, list(settings.values()), order, processes, _recall_bar)
    recalls = dict(zip(settings, measured, strict=True))
    print(recall_table(recalls))
    title = f"Proposals of {table[0].frames} frames, {table[0].objects} {object_class} labels"
    columns = len(next(iter(recalls.values())).difficulties)
    by_count, by_iou = recall_by_count_panels(recalls), recall_by_iou_panels(recalls)
    by_count_title = f"{title}; {_ORDERS[order]} first"
    plot_curves(out / "recall_by_count.png", by_count_title, by_count, columns=columns)
    plot_curves(out / "recall_by_iou.png", title, by_iou, columns=columns)
    document = {
        "program": f"trifuse {__version__}",
        "objective": _OBJECTIVE,
        "search": config.identity(),
        "grid": grid,
        "settings": search_document(table, iou),
        "order": f"{_ORDERS[order]} first",
        "recall": recall_document(settings, recalls),
    }
    write_json(out / "search.json", document)
    print("\n".join(["", *(str(out / name) for name in _FILES)]))


def _settings(best: ProposalSetting) -> dict[str, ProposalSetting]:
    """Return what is drawn, by name; settings that are the same are drawn once."""
    names = {best: "best"}
    for name, setting in (
        ("default", ProposalSetting()),
        ("thesis", ProposalSetting(method="thesis")),
    ):
        names[setting] = f"{names[setting]} = {name}" if setting in names else name
    return {name: setting for setting, name in names.items()}


def _describe(found: Survey, count: ProposalCount) -> str:
    """Say what was searched over, and what of it could not be read."""
    line = f"{len(found.drives)} drives, {count.frames} frames, {count.objects} labels {found.of_class}"
    return f"{line}; {count.unread} frames could not be read" if count.unread else line


def _search_bar(finished: FinishedTasks, done: int, parts: int) -> FinishedTasks:
    progress_bar: FinishedTasks = tqdm(
        finished, "search", parts, initial=done, unit="part", file=sys.stderr, smoothing=0.05
    )
    return progress_bar


def _recall_bar(gathered: CollectedProposals, parts: int) -> CollectedProposals:
    return progress_bar(gathered, "recall", parts, unit="part", delay_s=2)
