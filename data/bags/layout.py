"""The layout of bags: a file, a folder of a ROS 2 bag, or a folder of several of these."""

from pathlib import Path
from typing import TYPE_CHECKING

from data.layouts import Layout, OpenConfig

if TYPE_CHECKING:
    from data.bags.drive import BagDrive

_SUFFIXES = (".bag", ".mcap", ".db3")
_METADATA = "metadata.yaml"  # of ROS 2; other recorders have files of this name, too


def bags_in(path: Path) -> tuple[str, ...] | None:
    """Return the names of the bags in a folder; none where the path is a bag; None where there is none."""
    if _is_bag(path):
        return ()
    if not path.is_dir():
        return None
    return tuple(one.name for one in sorted(path.iterdir()) if _is_bag(one)) or None


def _is_bag(path: Path) -> bool:
    if path.suffix in _SUFFIXES and path.is_file():
        return True
    return (path / _METADATA).is_file() and any(one.suffix in _SUFFIXES for one in path.iterdir())


def _open(path: Path, sequence: str | None, config: OpenConfig) -> "BagDrive":
    from data.bags.opening import open_bag

    return open_bag(path / sequence if sequence else path, config)


BAG = Layout(
    name="ROS bag",
    description="a ROS bag (.mcap, .db3, .bag, or a folder with metadata.yaml)",
    sequences=bags_in,
    open=_open,
)
