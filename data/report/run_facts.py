"""What a report of a run states and the other result files do not hold: versions, panels of the video, errors."""

import platform
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Self

from data.report.label_errors import GroundError, PrecisionPanel
from data.results.documents import describe_machine, write_json
from data.results.records import read_record
from perception import __version__
from perception.render.panels import PanelArea

FACTS = "report.json"
# Packages that change results or their speed.
_PACKAGES = ("numpy", "scipy", "numba", "opencv-python-headless", "onnxruntime", "av", "plotly")


@dataclass(frozen=True)
class RunFacts:
    """Content of `report.json`.

    Attributes:
        period_s: Time from one scan to the next in seconds, the time budget of a frame.
        machine: Processor, number of cores and version of Python.
        versions: Version of each program and package.
        panels: Panels of an image of the video by name.
        skipped: Number of frames in which each stage was left out to keep the time budget.
        ground: Error of the ground at labelled objects, by frame; none without labels.
        precision: Precision-recall curves of the vehicles; none without labels or detectors.
    """

    period_s: float | None = None
    machine: str = ""
    versions: dict[str, str] = field(default_factory=dict)
    panels: dict[str, PanelArea] = field(default_factory=dict)
    skipped: dict[str, int] = field(default_factory=dict)
    ground: list[GroundError] = field(default_factory=list)
    precision: list[PrecisionPanel] = field(default_factory=list)

    @classmethod
    def of_run(cls, period_s: float, panels: dict[str, PanelArea]) -> Self:
        """Return what is known at the first frame.

        Args:
            period_s: Time from one scan to the next in seconds.
            panels: Panels of an image of the video by name.
        """
        return cls(period_s, describe_machine(), versions(), panels)

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read the file of a run; nothing is known without it.

        Raises:
            LabelError: The file is damaged.
        """
        path = folder / FACTS
        return read_record(path, cls) if path.is_file() else cls()

    def write(self, folder: Path) -> None:
        """Write the file of a run."""
        write_json(folder / FACTS, self)


def versions() -> dict[str, str]:
    """Return the versions of this program, of Python, and of the packages that change results or their speed."""
    found = {"trifuse": __version__, "Python": platform.python_version()}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return {**found, "system": platform.platform()}
