"""`trifuse train proposals`: the parameters of the proposals that reach most labelled objects (6.1.4)."""

from pathlib import Path
from typing import Literal

from perception.types import Method, OnBadFrame
from train.proposal_search.grid import SearchGrid

_GRID = SearchGrid()
_IOUS = (0.7, 0.5)


def train_proposals(
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
        workers: Number of processes; one per core by default.
        on_bad_frame: Stop at a damaged frame, or skip it with a warning.
        out: Folder of the results.
    """
    from perception.cli.progress import frame_progress_bar, search_bar
    from perception.geometry.threads import usable_cores
    from train.proposal_search.recall import compared_settings, measure_recall
    from train.proposal_search.report import best_table, recall_table, summary, write_report
    from train.proposal_search.search import SearchConfig, search
    from train.proposal_search.survey import survey

    processes = usable_cores() if workers is None else workers
    found = survey(drives, object_class, every=every, progress=frame_progress_bar("labels"))
    config = SearchConfig(found, grid, method, iou, on_bad_frame=on_bad_frame)
    try:
        counts = search(config, out / "counts.jsonl", processes, search_bar)
    except KeyboardInterrupt as error:
        raise KeyboardInterrupt("go on with the same command") from error
    print(f"{summary(found, counts[0])}\n\n{best_table(counts, iou).text()}\n", flush=True)
    compared = compared_settings(counts[0].parameters, method)
    recalls = measure_recall(config, compared, order, processes)
    print(recall_table(recalls).text(), "", sep="\n")
    print(*write_report(out, config, counts, recalls, order), sep="\n")
