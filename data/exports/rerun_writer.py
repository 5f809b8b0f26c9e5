"""Results as a Rerun recording: a file, a viewer that is shown the run live, or both."""

import os
import socket
import subprocess
import sys
import time
import uuid
import warnings
from collections.abc import Sequence
from pathlib import Path
from shutil import which
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from data.exports.rerun_entities import (
    CAMERA,
    camera_entities,
    camera_path,
    object_entities,
    point_entities,
    pose_entities,
    series_entities,
)
from data.results.result_writer import ResultWriter
from perception.atomic_file import part_of, writing
from perception.errors import UsageError, WriteError
from perception.render.scene import SelectedObject
from perception.types import MAP_MODALITIES, Float64, Result

# Memory of the viewer, which drops the oldest frames beyond it.
_VIEWER_MEMORY = "2GiB"
_VIEWER_PORT = 9876
_VIEWER_HOST = "127.0.0.1"  # Rerun's own default is every interface, without a password
_VIEWER_START_S = 10.0
_PATH_S = 4.0  # of the vehicle, in the scene


class RerunWriter(ResultWriter):
    """Logs each result to Rerun."""

    def __init__(self, drive: str, path: Path | None, *, view: bool, display_score: float) -> None:
        """Open the file and the viewer.

        Args:
            drive: Name of the drive.
            path: Recording, `.rrd`, which is whole at the end; None for no file.
            view: Whether a viewer is opened.
            display_score: Score from which a detection is shown.

        Raises:
            UsageError: There is no viewer.
            WriteError: The file cannot be written.
        """
        self._path, self._display_score = path, display_score
        self._origin: tuple[Float64, float] | None = None
        self._recording = rr.RecordingStream("trifuse", recording_id=uuid.uuid4())
        sinks: list[rr.GrpcSink | rr.FileSink] = []
        if view:
            _open_viewer()
            sinks.append(rr.GrpcSink(f"rerun+http://{_VIEWER_HOST}:{_VIEWER_PORT}/proxy"))
        if path is not None:
            sinks.append(_file_sink(path))
        self._recording.set_sinks(*sinks)
        self._recording.send_recording_name(drive)

    def add(self, result: Result, selected: SelectedObject | None) -> None:
        """Log the entities of one frame."""
        if self._origin is None:
            self._origin = (result.world_SE3_velo[:3, 3].copy(), result.frame.stamp_s)
            self._log_static(result)
        origin_m, start_s = self._origin
        self._recording.set_time("frame", sequence=result.frame.index)
        self._recording.set_time("time", duration=result.frame.stamp_s - start_s)
        entities = {
            **pose_entities(result, origin_m),
            **point_entities(result),
            **object_entities(result, origin_m, self._display_score),
            **camera_entities(result, self._display_score),
            **series_entities(result),
        }
        for path, entity in entities.items():
            parts = entity if isinstance(entity, list) else [entity]
            self._recording.log([*path.split("/")], *parts)

    def close(self, *, is_complete: bool) -> None:
        """Put the file in its place, with the frames that were added.

        Raises:
            WriteError: It could not be written; no file is left.
        """
        self._recording.disconnect()
        if self._path is None:
            return
        part = part_of(self._path)
        with writing(self._path):
            if not _is_whole(part):
                part.unlink(missing_ok=True)
                raise WriteError(self._path, expected="room for the recording", found="a full disk")
            part.replace(self._path)

    def _log_static(self, result: Result) -> None:
        """Log what holds for the whole drive, and the layout of the viewer."""
        self._recording.send_blueprint(blueprint_of(result))
        self._recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        origin_m = rr.AnyValues(origin_m=np.asarray(result.world_SE3_velo[:3, 3]))
        self._recording.log("world", origin_m, static=True)
        self._recording.log("world/ego", rr.TransformAxes3D(axis_length=2.0), static=True)


def _open_viewer() -> None:
    """Start the viewer, which outlives this process; one that listens already is used.

    Rerun's `spawn` takes no address to bind to, so its program is started by itself.

    Raises:
        UsageError: There is no viewer, or it does not start.
    """
    if _is_listening():
        return
    folders = [str(Path(sys.executable).parent), os.environ.get("PATH", "")]
    viewer, fault = which("rerun", path=os.pathsep.join(folders)), "no program rerun"
    if viewer is not None:
        words = [
            viewer, f"--port={_VIEWER_PORT}", f"--bind={_VIEWER_HOST}", "--hide-welcome-screen",
            f"--memory-limit={_VIEWER_MEMORY}", f"--server-memory-limit={_VIEWER_MEMORY}", "--expect-data-soon",
        ]  # fmt: skip
        fault = _start(words)
    if fault:
        raise UsageError(
            "--view",
            expected="the Rerun viewer",
            found=fault,
            advice="write a recording with --rerun FILE.rrd",
        )


def _start(words: Sequence[str]) -> str:
    """Start the viewer and wait until it listens; return what is wrong, or nothing."""
    # The viewer outlives us: it must neither share our terminal nor hold a pipe open that others read to its end.
    silent = subprocess.DEVNULL
    try:
        process = subprocess.Popen(
            words, start_new_session=True, stdin=silent, stdout=silent, stderr=silent
        )
    except OSError as error:
        return str(error.strerror)
    end_s = time.monotonic() + _VIEWER_START_S
    while time.monotonic() < end_s:
        if _is_listening():
            return ""
        if process.poll() is not None:
            return f"a viewer that ended at once, with exit code {process.returncode}"
        time.sleep(0.1)
    return f"a viewer that does not listen at port {_VIEWER_PORT} after {_VIEWER_START_S:g} s"


def _is_listening() -> bool:
    try:
        socket.create_connection((_VIEWER_HOST, _VIEWER_PORT), timeout=0.5).close()
    except OSError:
        return False
    return True


def _file_sink(path: Path) -> rr.FileSink:
    """Return the sink of a partial file; make its folder."""
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        part_of(path).touch()
    return rr.FileSink(part_of(path))


def _is_whole(path: Path) -> bool:
    """Return whether a recording has its end: Rerun tells no error of a file but in its log."""
    from rerun.chunk import RrdReader

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a recording without its end
        try:
            RrdReader(path).store()
        except (RuntimeError, ValueError, OSError):
            return False
    return True


def blueprint_of(result: Result) -> rrb.Blueprint:
    """Return the layout for a drive by its first result: without views of what it does not have."""
    views = [_scene_view()]
    if side := _image_views(result):
        views.append(rrb.Vertical(*side))
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(*views, column_shares=[3, 2][: len(views)]),
            rrb.Horizontal(
                rrb.TimeSeriesView(origin="timings", name="Timings [ms]"),
                rrb.TimeSeriesView(origin="counts", name="Counts"),
                rrb.TimeSeriesView(origin="health", name="Health"),
            ),
            row_shares=[3, 1],
        ),
        rrb.TimePanel(timeline="time", state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )


def _scene_view() -> Any:  # noqa: ANN401 - a view
    """Return the 3D view, seen from behind the vehicle, with its path."""
    now = rrb.TimeRangeBoundary.cursor_relative()
    before = rrb.TimeRangeBoundary.cursor_relative(seconds=-_PATH_S)
    return rrb.Spatial3DView(
        origin="world/ego",
        name="Scene",
        contents=["+ /world/**", f"- {CAMERA}/**"],
        eye_controls=rrb.EyeControls3D(
            position=(-16, 0, 10), look_target=(10, 0, -2), eye_up=(0, 0, 1)
        ),
        overrides={
            "world/path": rrb.VisibleTimeRanges(
                [rrb.VisibleTimeRange("time", start=before, end=now)]
            )
        },
    )


def _image_views(result: Result) -> list[Any]:
    """Return the views of the cameras' images and of the maps, each with its detections."""
    views: list[Any] = []
    if result.frame.image is not None:
        contents = [f"{CAMERA}/image", f"{CAMERA}/detections/fused", "world/tracks"]
        views.append(rrb.Spatial2DView(origin=CAMERA, contents=contents, name="Camera"))
    maps = [
        rrb.Spatial2DView(
            origin=CAMERA,
            contents=[f"{CAMERA}/{modality}", f"{CAMERA}/detections/{modality}"],
            name=name,
        )
        for modality, name in zip(MAP_MODALITIES, ("Depth map", "Reflectance map"), strict=True)
        if modality in result.map_images
    ]
    further = [
        rrb.Spatial2DView(
            origin=(path := camera_path(one.name)),
            contents=[f"{path}/image", f"{path}/detections/fused", "world/tracks"],
            name=one.name,
        )
        for one in result.frame.further_cameras
    ]
    return views + further + maps
