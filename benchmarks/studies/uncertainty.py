"""How much of the exact truth lies within the reported 90 % intervals: of poses, moving objects and 3D boxes, by LiDAR."""

from dataclasses import dataclass
from pathlib import Path

from benchmarks.studies.report import RESULTS, StreetFlags
from data.synthetic.street_kind import StreetKind
from perception.cli.parser import FlagGroup


@dataclass(frozen=True)
class UncertaintyConfig(FlagGroup):
    """What is measured.

    Attributes:
        sensors: LiDAR models.
        kinds: Kinds of streets, in turn; none for drawn ones.
        start_every: Number of scans from one start of the odometry to the next.
        images: Whether boxes are detected in images, too, or by LiDAR alone.
    """

    sensors: tuple[str, ...] = ("VLP-16", "HDL-32E", "HDL-64E", "VLS-128")
    kinds: tuple[StreetKind, ...] = ()
    start_every: int = 20
    images: bool = True


def uncertainty(
    *,
    streets: StreetFlags,
    config: UncertaintyConfig,
    out: Path = RESULTS / "uncertainty.png",
) -> None:
    """Measure how much of the truth lies within the 90 % intervals of poses, moving objects and boxes, by LiDAR.

    Example: trifuse study uncertainty --frames 40 --drives 2 --sensors VLP-16,HDL-64E

    Args:
        out: Figure; a JSON file with the numbers is written beside it.
    """
    from benchmarks.studies.interval_shares import measure_uncertainty

    measure_uncertainty(streets, config, out)
