"""Folders that commands write: the files that are theirs, and how the results of an earlier run are replaced.

The first line of `config.yaml` names the command. Only files of that command are ever removed, by the patterns below,
and only by the same command.
"""

import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Self, TypeVar

from data.results.command_config import CommandConfig
from perception.atomic_file import part_of, writing
from perception.errors import UsageError

Item = TypeVar("Item")

CONFIG = "config.yaml"
DRIVES = "drives.jsonl"  # of a batch: a row a drive
_RESULTS = Path("results")
LATEST = _RESULTS / "latest"
_VIDEO = {
    "video.mp4": "video",
    "video.partial.mp4": "video of a run that stopped early",
    "preview.jpg": "image of the frame in the middle",
}
_RUN = {
    "frames.jsonl": "one `FrameRecord` a line: time, position, counts, seconds of each stage",
    "poses.txt": "world_SE3_velo after registration, 12 numbers a row, as in KITTI's odometry benchmark",
    "tracks/*.txt": "KITTI tracking rows of all tracks in the image; only with a camera",
    "tracks.jsonl": "one `FrameTracks` a line",
    "data/*.txt": "KITTI object rows of the detected vehicles; this and the next two only with detectors",
    "vehicles/*.txt": "KITTI tracking rows of the tracked vehicles",
    "vehicles.jsonl": "one `FrameVehicles` a line",
    "trajectory.jsonl": "one `TrajectoryRecord` a line; only with `--track`",
    "labels/*.label": "one uint32 a point in SemanticKITTI's classes: 40 ground, 9 static, 251 moving",
    "obstacles/*.npz": "static and moving voxels (centres, counts of points), ground heights on a 1 m grid",
    "occupancy/*.png": "free, occupied, unknown cells around the vehicle; this and the next two only with `--occupancy`",
    "occupancy/*.yaml": "place and resolution of the image, as the map server of Nav2 reads them",
    "occupancy/*.npz": "the same as arrays",
    "tables/*.parquet": "frames, poses, tracks, vehicles, timings; only with `--tables`",
    **_VIDEO,
    "timeline.png": "start and end of each stage in a typical frame",
    "results.mcap": "messages of ROS 2 and Foxglove; only with `--mcap`",
    "summary.json": "the printed summary",
    "checkpoint.zip": "state of a run that was stopped; only until it is complete",
    "report.html": "summary, player, figures; this and the next two only with the extra `report`",
    "report.json": "versions, panels of the video, errors against labels",
    "panels/*.jpg": "two views of up to 200 frames; only without the video",
}
_DATE = "2025_06_01"  # of every synthetic drive
_SYNTH = {
    f"{_DATE}/calib_*.txt": "calibration of the raw layout",
    f"{_DATE}/*_sync/sensor.json": "LiDAR model",
    f"{_DATE}/*_sync/velodyne_points/data/*.bin": "scans",
    f"{_DATE}/*_sync/image_02/data/*.png": "images",
    f"{_DATE}/*_sync/oxts/data/*.txt": "INS packets",
    f"{_DATE}/*_sync/*/timestamps*.txt": "times of scans, images and packets",
    f"{_DATE}/*_sync/labels/*.label": "class and object of each point, as in SemanticKITTI",
    f"{_DATE}/*_sync/label_02.txt": "labels of the objects in the image",
    f"{_DATE}/*_sync/truth_*.txt": "exact poses, and boxes of all objects around",
    "training/sensor.json": "LiDAR model of the tracking and object layouts",
    "training/velodyne/**/*.bin": "scans",
    "training/image_*/**/*.png": "images",
    "training/labels/**/*.label": "class and object of each point",
    "training/calib/*.txt": "calibration",
    "training/oxts/*.txt": "INS packets",
    "training/label_*/*.txt": "labels of the objects in the image",
    "training/truth_*/*.txt": "exact poses, and boxes of all objects around",
}
# What each command writes beside `config.yaml`, by pattern.
RESULT_FILES: Mapping[str, Mapping[str, str]] = {
    "run": _RUN,
    "demo": _RUN,
    "label": {
        "boxes/*": "labels of the confident objects, in the form of a labelling tool",
        "proposals.json": "objects with confidence, motion, boxes, and what is unsure about them",
        "review.html": "page on which objects are accepted or rejected; it saves what `--review` reads",
        "summary.json": "the printed summary",
        "timeline.png": "start and end of each stage in a typical frame",
        "checkpoint.zip": "state of a run that was stopped; only until it is complete",
    },
    "track": {
        "trajectory.jsonl": "one `TrajectoryRecord` a line",
        "trajectory.txt": "KITTI tracking rows while the object is in the image and not lost",
        "ground.png": "ground of the frame in the middle; this and the next two only with `--plots`",
        "mean-shift.png": "mean shift over the points of that frame, where the tracker has one",
        "color-model.png": "colour model of the object in that frame, where the tracker has one",
        **_VIDEO,
        "summary.json": "the printed summary",
    },
    "detect": {
        "data/*.txt": "KITTI object rows; empty where nothing is detected",
        "previews/*.jpg": "image of each object frame",
        **_VIDEO,
        "summary.json": "the printed summary",
    },
    "maps": {
        "depth/*.png": "8-bit depth maps",
        "reflectance/*.png": "8-bit reflectance maps",
        "maps_*.png": "all methods compared on one frame",
    },
    "calibrate": {
        "calib*.txt": "calibration file of a KITTI drive, with the calibration that was found",
        "[0-9]*.txt": "the same of a tracking sequence or an object frame",
        "drive.yaml": "the same of a folder of scans",
        "calibration.json": "`Recalibration`",
        "calibration.png": "edges of a scan on the image, as stated and as found",
    },
    "synth": _SYNTH,
}


@dataclass(frozen=True)
class ResultsFolder:
    """Folder for the results of one command.

    Attributes:
        path: Path of the folder; None for a new one, results/<time>.
        config: Configuration of the command.
        is_resumed: Whether the files in it are gone on with, and not removed.
    """

    path: Path | None
    config: CommandConfig
    is_resumed: bool = False

    @classmethod
    def choose(cls, path: Path | None, config: CommandConfig, *, overwrite: bool) -> Self:
        """Return a folder that may take new results; nothing in it changes before `prepare`.

        Args:
            path: Path of the folder; None for a new one, results/<time>.
            config: Configuration of the command.
            overwrite: Whether results of the same command are replaced.

        Raises:
            UsageError: It is a file, or holds results that are not to be replaced.
        """
        if path is not None:
            if path.exists() and not path.is_dir():
                raise UsageError(path, expected="a folder, or a new path", found="a file")
            _require_replaceable(path, config.command, overwrite=overwrite)
        return cls(path, config)

    def prepare(self) -> Path:
        """Remove the results of an earlier run, make the folder, write `config.yaml`; return the path.

        Call it when all checks of the input are done.

        Raises:
            WriteError: The folder cannot be written to.
        """
        if self.is_resumed and self.path is not None:
            return self.path
        with writing(self.path or _RESULTS):
            path = self.path or _new_folder()
            if command_of(path) == self.config.command:
                _remove(path, _results_in(path, self.config.command))
        self.config.write(path)
        return path


def command_of(folder: Path) -> str | None:
    """Return the command that wrote a folder of results, such as `run`, or None."""
    with suppress(OSError, UnicodeDecodeError):
        program, _, command = (folder / CONFIG).read_text().partition("\n")[0].partition(": ")
        if program.startswith("# trifuse "):
            return command
    return None


def started(items: Iterator[Item]) -> Iterator[Item]:
    """Compute the first item, so that its errors come before anything is written; return all items."""
    first = next(items, None)
    return items if first is None else chain((first,), items)


def _require_replaceable(path: Path, command: str, *, overwrite: bool) -> None:
    found, writer = _results_in(path, command), command_of(path)
    if not found or (overwrite and writer == command):
        return
    names = ", ".join(str(one.relative_to(path)) for one in found[:3])
    advice = "name another folder"
    if writer == command:
        advice += ", or replace them with --overwrite"
    raise UsageError(
        path,
        expected="a folder without results",
        found=f"those of `trifuse {writer}`" if writer else names,
        advice=advice,
    )


def _results_in(path: Path, command: str) -> list[Path]:
    """Return the files of a command in a folder, whole ones and parts, `config.yaml` last."""
    patterns = list(RESULT_FILES[command])
    patterns += [str(part_of(Path(pattern), "*")) for pattern in patterns]
    patterns += ["tables/.*.part.arrows"] * (command in ("run", "demo"))
    found = {one for pattern in patterns for one in path.glob(pattern) if not one.is_dir()}
    return [*sorted(found), *path.glob(CONFIG)]


def _remove(folder: Path, files: list[Path]) -> None:
    """Remove files of a folder, and the folders in it that are empty then."""
    for file in files:
        file.unlink()
    parents = {parent for file in files for parent in file.parents if folder in parent.parents}
    for parent in sorted(parents, reverse=True):
        with suppress(OSError):
            parent.rmdir()


def _new_folder() -> Path:
    """Make results/<time> and let results/latest point to it."""
    name = time.strftime("%Y-%m-%d_%H-%M-%S")
    folder, number = _RESULTS / name, 1
    while folder.exists():
        number += 1
        folder = _RESULTS / f"{name}_{number}"
    folder.mkdir(parents=True)
    if LATEST.is_symlink() or not LATEST.exists():
        LATEST.unlink(missing_ok=True)
        LATEST.symlink_to(folder.name)
    return folder
