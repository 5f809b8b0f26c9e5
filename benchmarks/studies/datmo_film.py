"""The thesis' DATMO as a film of three scenes: motion grid, boxes and tracks (Fig. 7.6)."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.studies.motion_grid import PRESETS, SOURCES, Preset
from benchmarks.studies.report import RESULTS, DriveOfStudy, formatted_table, publish
from benchmarks.studies.tracking_metrics import PROTOCOL, tracking_values
from perception.atomic_file import write_jpeg
from perception.cli.flags import require_positive
from perception.cli.progress import progress_bar
from perception.evaluation.config import DatmoProtocol
from perception.evaluation.report import Table, Value
from perception.geometry.threads import limit_blas_threads
from perception.pipeline import PipelineConfig
from perception.render.palette import BACKGROUND
from perception.sensor import load_sensor
from perception.types import Drive, Frame, Obstacles, PointState, UInt8, Voxels

if TYPE_CHECKING:
    from perception.evaluation.datmo_measure import DatmoReport

_MOMENTS = (0.3, 0.6, 0.9)  # shares of a scene of which the figure shows the images
_TITLE_PX = 36
_SPECS = {
    **dict.fromkeys(("frames", "moving objects", "never tracked"), "d"),
    **dict.fromkeys(("HOTA [%]", "MOTA [%]"), ".1f"),
    "false tracks": "d",
}


@dataclass(frozen=True)
class DatmoFilmConfig(DriveOfStudy):
    """Drive and length of the film.

    Attributes:
        frames: Number of frames of each scene.
        preset: Values of the thesis' Table 7.4, or of its author's code.
    """

    frames: int = 60
    preset: Preset = "thesis"

    def __post_init__(self) -> None:
        """Validate the number of frames."""
        require_positive("--frames", self.frames)


def datmo_film(
    drive: str, *, config: DatmoFilmConfig, out: Path = RESULTS / "datmo-film.jpg"
) -> None:
    """Draw the thesis' DATMO as a film: motion grid, boxes and tracks in three scenes (Fig. 7.6).

    The word synthetic stands for vehicles on a highway, vehicles that join a road at a junction, and a crossing.

    Example: trifuse study datmo-film synthetic --frames 60

    Args:
        drive: Folder of a drive, or the word synthetic.
        out: Figure of three moments of each scene; the film and a JSON file are written beside it.
    """
    from perception.render.video import VideoWriter

    drives = _scenes(drive, config)
    reports: dict[str, DatmoReport | None] = {}
    stills: list[list[UInt8]] = []
    with VideoWriter(out.with_suffix(".mp4"), drives[0].sensor.rate_hz) as film:
        for number, one in enumerate(drives, start=1):
            scene, frames = FilmedScene(one, config.preset), min(config.frames, len(one))
            moments, row = [int(share * frames) for share in _MOMENTS], []
            for index in progress_bar(range(frames), one.name, delay_s=2):
                image = scene.draw(one[index], f"({number}) {one.name}")
                film.add(image)
                if index in moments:
                    row.append(image)
            reports[one.name] = scene.report()
            stills.append(row)
    write_jpeg(out, _contact_sheet(stills))
    title = f"Tracks of moving objects by {SOURCES[config.preset]}"
    publish(
        out,
        "Fig. 7.6",
        {"tracks": _table(title, reports)},
        {
            "config": config,
            "detector": PRESETS[config.preset],
            "protocols": {name: one and one.protocol for name, one in reports.items()},
        },
    )
    print(out.with_suffix(".mp4"))


def _scenes(drive: str, config: DatmoFilmConfig) -> Sequence[Drive]:
    """Return the drive, or the three scenes of the thesis' figure."""
    if drive != "synthetic":
        return [config.open(drive, images=True)]
    from data.synthetic.traffic_scenes import TRAFFIC_SCENES, TrafficSceneDrive

    sensor = load_sensor(config.sensor or "HDL-64E")
    return [TrafficSceneDrive(name, config.frames, sensor=sensor) for name in TRAFFIC_SCENES]


class FilmedScene:
    """Detects, tracks, draws and measures the moving objects of a drive, frame by frame."""

    def __init__(self, drive: Drive, preset: Preset) -> None:
        """Start before the first frame.

        Args:
            drive: Drive.
            preset: Values of the detector and the tracker.
        """
        from data.derived.moving_truth import moving_truth
        from perception.datmo.grid_detector import MotionGridDetector
        from perception.datmo.stage import Datmo
        from perception.evaluation.datmo_measure import DatmoMeasure
        from perception.pipeline.lidar_stages import LidarStages
        from perception.render.composition import Composition
        from perception.render.trails import SceneHistory
        from perception.tracking.point_tracker import PointTracker

        config = PRESETS[preset]
        self._drive, self._area = drive, config.area
        self._stages = LidarStages(drive.sensor, PipelineConfig.for_motion("none"))
        self._detector = MotionGridDetector(drive.sensor, config)
        self._datmo = Datmo(self._detector, PointTracker(preset), uses_ins_poses=True)
        self._composition = Composition(area=config.area, period_s=1 / drive.sensor.rate_hz)
        self._history = SceneHistory()
        # Labels of a recorded drive are of what the camera sees.
        protocol = DatmoProtocol() if drive.point_truth(0) is None else PROTOCOL
        has_truth = drive.has_labels and drive.has_poses
        truth = moving_truth(drive, protocol.view, protocol.motion) if has_truth else None
        self._measure = None if truth is None else DatmoMeasure(truth, protocol)

    def draw(self, frame: Frame, title: str) -> UInt8:
        """Return the image of the next frame: the motion grid in place of voxels, with boxes and paths."""
        from perception.render.motion_grid_plots import cell_columns
        from perception.render.scene import SceneObjects

        result, scan = self._stages.segment(frame)
        start_s = time.perf_counter()
        with limit_blas_threads():
            tracks = self._datmo.update(scan)
        timings_s = {"moving objects": time.perf_counter() - start_s}
        result = replace(result, tracks=tracks, timings_s=timings_s, spans=())
        if self._measure is not None:
            self._measure.update(result)
        grids = self._detector.grids
        # The method knows no static voxels, and no state of single points.
        obstacles = Obstacles(
            np.full(len(frame.points_velo), PointState.OUTSIDE, np.uint8),
            Voxels(np.zeros((0, 3), np.float32), np.zeros(0, np.int64), grids.cells.cell_m),
            cell_columns(grids, result.ground, grids.motion_m),
        )
        shown = replace(result, obstacles=obstacles)
        objects = SceneObjects.of(shown)
        return _with_title(self._composition.draw(self._history.update(shown, objects)), title)

    def report(self) -> "DatmoReport | None":
        """Return the metrics of the tracks so far; None of a drive without labels and poses."""
        return None if self._measure is None else self._measure.compute()


def _with_title(image: UInt8, title: str) -> UInt8:
    from perception.render.canvas import blank_canvas, draw_text

    band = blank_canvas((image.shape[1], _TITLE_PX), BACKGROUND)
    draw_text(band, title, (_TITLE_PX / 4, 0.7 * _TITLE_PX), height_px=_TITLE_PX // 2)
    return np.vstack([band, image])


def _contact_sheet(stills: Sequence[Sequence[UInt8]]) -> UInt8:
    """Return the images side by side, a row for each scene."""
    import cv2

    def small(image: UInt8) -> UInt8:
        size_px = (image.shape[1] // 2, image.shape[0] // 2)
        return np.asarray(cv2.resize(image, size_px, interpolation=cv2.INTER_AREA), np.uint8)

    return np.vstack([np.hstack([small(image) for image in row]) for row in stills])


def _table(title: str, reports: Mapping[str, "DatmoReport | None"]) -> Table[Any]:
    rows: dict[str, tuple[Value, ...]] = {}
    for name, report in reports.items():
        if report is None:
            rows[name] = (None,) * len(_SPECS)
            continue
        metrics = tracking_values([report])
        rows[name] = (
            report.frames,
            len(report.objects),
            len(report.never_tracked),
            metrics["HOTA [%]"],
            metrics["MOTA [%]"],
            len(report.false_tracks.ids),
        )
    return formatted_table(title, "scene", _SPECS, rows)
