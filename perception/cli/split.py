"""`trifuse split`: which labelled frames train, validate and test networks."""

from pathlib import Path

from data.splits.parts import SplitBy

_SHARES = (60.0, 20.0, 20.0)


def split(
    roots: list[Path],
    *,
    out: Path,
    shares: tuple[float, ...] = _SHARES,
    by: SplitBy = "frames",
    seed: int = 0,
    lists: Path | None = None,
) -> None:
    """Split labelled frames into training, validation and test, and write which frame is in which part.

    The commands that train, evaluate and export take the file by --split. The thesis' splits are 60,20,20 and 80,20.

    Example: trifuse split kitti/object --shares 60,20,20 --seed 0 --out split.json

    Args:
        roots: Labelled drives of any layout; of a folder of several, all are taken.
        out: Split file; folders are written relative to it.
        shares: Percentage of train, val and test; two of them are train and val.
        by: Unit that is drawn: single frames, or whole drives, since neighbouring frames are nearly equal.
        seed: Seed of the draw; the same seed gives the same split.
        lists: Folder with train.txt, val.txt and test.txt, one frame a line, that are read instead.
    """
    from data.open_drive import open_drives
    from data.splits.draw import draw_split, require_labels
    from data.splits.files import split_by_lists, write_split
    from data.splits.frame_split import COLUMNS, PartCounts
    from perception.atomic_file import require_writable
    from perception.cli.progress import frame_progress_bar
    from perception.evaluation.report import Table

    require_writable(out)
    drives = open_drives(roots, images=False)
    require_labels(drives)
    if lists is None:
        made = draw_split(drives, shares, by=by, seed=seed)
    else:
        made = split_by_lists(drives, lists)
    counts: dict[str, PartCounts] = {
        part: PartCounts.of(made.select(drives, part), frame_progress_bar(f"labels of {part}"))
        for part in made.parts
    }
    write_split(out, made)
    how = f"by {by}, seed {seed}" if lists is None else f"from {lists}"
    title = f"Split {made.fingerprint}, {how}"
    print(f"{Table(title, COLUMNS, counts, 'part').text()}\n\n{out}")
