"""All layouts: ours in the order in which they are asked, then those of installed packages.

A package adds layouts by entry points of the group `trifuse.layouts`, each of which names a `Layout`:

    [project.entry-points."trifuse.layouts"]
    "My recorder" = "my_package.layout:MY_LAYOUT"
"""

import logging
from collections.abc import Iterator
from functools import cache
from importlib.metadata import EntryPoint, entry_points

from data.argoverse2.log import ARGOVERSE_2
from data.bags.layout import BAG
from data.folder.layout import FOLDER, LOOSE_SCANS, RECORDING
from data.kitti.layouts import KITTI_DATE, KITTI_OBJECT, KITTI_RAW, KITTI_TRACKING
from data.kitti360.drive import KITTI_360
from data.layouts import Layout
from data.nuscenes.scene import NUSCENES
from data.semantic_kitti.sequence import SEMANTIC_KITTI

log = logging.getLogger(__name__)

ENTRY_POINT_GROUP = "trifuse.layouts"
# A layout that is a special case of another comes before it.
LAYOUTS: tuple[Layout, ...] = (
    FOLDER, SEMANTIC_KITTI, KITTI_360, KITTI_RAW, KITTI_OBJECT, KITTI_TRACKING, KITTI_DATE, ARGOVERSE_2, NUSCENES, BAG,
    RECORDING,
)  # fmt: skip


def layouts() -> Iterator[Layout]:
    """Yield all layouts; packages are asked for theirs only where none of ours was taken."""
    yield from LAYOUTS
    yield from _installed_layouts()
    yield LOOSE_SCANS  # which a folder of most other layouts holds, too


@cache
def _installed_layouts() -> tuple[Layout, ...]:
    loaded = (_load(entry) for entry in entry_points(group=ENTRY_POINT_GROUP))
    return tuple(layout for layout in loaded if layout is not None)


def _load(entry: EntryPoint) -> Layout | None:
    """Return the layout of a package, or None where it is broken: that must not stop the other layouts."""
    try:
        layout = entry.load()
    except Exception as error:  # whatever a package does when it is imported
        log.warning("layout %s (%s) is left out: %s", entry.name, entry.value, error)
        return None
    if not isinstance(layout, Layout):
        found = type(layout).__name__
        log.warning(
            "layout %s (%s) is left out: it names a %s, not a Layout",
            entry.name,
            entry.value,
            found,
        )
        return None
    return layout
