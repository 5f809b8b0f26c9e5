"""Which faults of sensors are named, how soon, and how often a clean drive raises an alarm."""

from dataclasses import dataclass
from pathlib import Path

from data.synthetic.street_kind import StreetKind
from perception.cli.flags import SourceFlags
from perception.cli.parser import FlagGroup


@dataclass(frozen=True)
class InjectionConfig(FlagGroup):
    """Faults that are injected.

    Attributes:
        injections: Number of faults of each kind and size, in each drive.
        kinds: Kinds of faults; none for all.
        frames: Number of frames of each drive; 0 for all.
        within: Number of frames within which a fault must be named.
        calibration_within: The same of the calibration, which edges tell over two seconds.
        worlds: Number of synthetic drives, made in memory one after the other, beside those of the folders.
        world_sensors: LiDAR models of the synthetic drives, in turn.
        world_street: Kind of their streets; else any.
        world_night: Whether it is night there.
        world_images: Whether synthetic drives have images, which take most of the time.
        seed: Seed of the faults.
        curves: Inject faults of all sizes, not of the default size alone.
    """

    injections: int = 20
    kinds: tuple[str, ...] = ()
    frames: int = 0
    within: int = 5
    calibration_within: int = 30
    worlds: int = 0
    world_sensors: tuple[str, ...] = ("HDL-64E", "VLP-16", "OS1-64")
    world_street: StreetKind | None = None
    world_night: bool = False
    world_images: bool = True
    seed: int = 0
    curves: bool = False


def fault_detection(
    roots: tuple[str, ...] = (),
    *,
    source: SourceFlags,
    config: InjectionConfig,
    out: Path = Path("results/fault-detection.png"),
) -> None:
    """Inject faults of sensors into drives; measure which are named within five frames, and false alarms.

    With --injections 0 false alarms alone are counted; --worlds 100 drives the monitors through synthetic drives.

    Example: trifuse study fault-detection kitti/tracking --sequence 0000

    Args:
        roots: Folders or files of drives; of several drives in a folder, all are read. None with --worlds.
        out: Figure; a JSON file with the numbers is written beside it.
    """
    from benchmarks.studies.injected_faults import measure_faults

    measure_faults(roots, source, config, out)
