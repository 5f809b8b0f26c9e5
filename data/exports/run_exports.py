"""Exports of a run, and the packages that they need."""

import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from data.box_labels.form_names import LabelFormName
from perception.errors import UsageError, optional_package

# Package and extra of each export, by its field.
_PACKAGES: Mapping[str, tuple[str, str]] = {
    "tables": ("pyarrow", "tables"),
    "mcap": ("foxglove", "live"),
    "rerun": ("rerun", "view"),
    "view": ("rerun", "view"),
}


@dataclass(frozen=True)
class RunExports:
    """Exports.

    Attributes:
        tables: Write frames, poses, tracks, vehicles and timings as Parquet files, for pandas and DuckDB.
        occupancy: Write the occupancy grid of each frame: PNG and YAML as the map server of Nav2 reads them, and NPZ.
        mcap: Write results.mcap for Foxglove and the tools of ROS 2.
        report: Write report.html, a page with a player of the drive and figures, where plotly is installed.
        nuscenes: JSON file of the detected vehicles in the form of nuScenes' detection task, whose samples are the key frames
            of a nuScenes scene, else frame numbers.
        labels: Folder for the vehicles that a video shows as labels of their scans, in the form of a labelling tool.
        label_form: Form of the labels: openlabel, labelcloud, sustechpoints, kitti, kitti-tracking, datumaro (CVAT), tracklets,
            supervisely, nuscenes; of images coco, yolo.
        rerun: Recording for the Rerun viewer, a file that ends in .rrd.
        view: Show the run live in the Rerun viewer.
    """

    tables: bool = False
    occupancy: bool = False
    mcap: bool = False
    report: bool = True
    nuscenes: Path | None = None
    labels: Path | None = None
    label_form: LabelFormName = "openlabel"
    rerun: Path | None = None
    view: bool = False

    def __post_init__(self) -> None:
        """Validate before the run that the package of each export is installed, and that a viewer can open.

        Raises:
            MissingDependencyError: A package is not installed.
            UsageError: There is no display for the viewer, or the recording has another suffix.
        """
        for name, (package, extra) in _PACKAGES.items():
            if not getattr(self, name):
                continue
            with optional_package(package, needed_for=f"--{name}", extra=extra):
                import_module(package)
        if self.view:
            _require_display()
        if self.rerun is not None and self.rerun.suffix != ".rrd":
            raise UsageError(
                f"--rerun {self.rerun}", expected="a file that ends in .rrd", found=self.rerun.name
            )


def _require_display() -> None:
    if sys.platform == "linux" and not {"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys():
        raise UsageError(
            "--view",
            expected="a display for the viewer",
            found="none",
            advice="write a recording with --rerun FILE.rrd, and open it where there is a display: "
            "rerun FILE.rrd",
        )
