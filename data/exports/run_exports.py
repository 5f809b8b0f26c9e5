"""Exports of a run, and the packages that they need."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module

from perception.errors import MissingDependencyError

# Package and extra of each export, by its field.
_PACKAGES: Mapping[str, tuple[str, str]] = {
    "tables": ("pyarrow", "tables"),
    "mcap": ("foxglove", "live"),
}


@dataclass(frozen=True)
class RunExports:
    """Exports.

    Attributes:
        tables: Write frames, poses, tracks, vehicles and timings as Parquet files, for pandas and DuckDB.
        mcap: Write results.mcap for Foxglove and the tools of ROS 2.
        report: Write report.html, a page with a player of the drive and figures, where plotly is installed.
    """

    tables: bool = False
    mcap: bool = False
    report: bool = True

    def __post_init__(self) -> None:
        """Validate that the package of each export is installed, before the run.

        Raises:
            MissingDependencyError: It is not.
        """
        for name, (package, extra) in _PACKAGES.items():
            if not getattr(self, name):
                continue
            try:
                import_module(package)
            except ImportError as error:
                raise MissingDependencyError(
                    package, needed_for=f"--{name}", extra=extra, reason=error
                ) from error
