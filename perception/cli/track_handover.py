"""`--follow` of a run: one track or vehicle of the pipeline, handed to a tracker of one object, written and drawn."""

import logging
import time
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

import numpy as np

from data.results.trajectory import TrajectoryRecord, trajectory_writer
from perception.geometry.threads import limit_blas_threads
from perception.render.tracked_object_figure import TrackedObjectFigure
from perception.render.trails import TrackedObjectTrail
from perception.tracking.single_object.handover import TrackHandover
from perception.types import Result

log = logging.getLogger(__name__)

STAGE = "one object"
# Of the way, so many places are drawn: a few seconds, as of the other tracks.
_MAX_DRAWN_POSITIONS = 40


class ObjectTracking(AbstractContextManager["ObjectTracking"], Protocol):
    """What a run asks of whoever follows an object beside it."""

    figure: TrackedObjectFigure | None

    def update(self, result: Result) -> Result:
        """Take in one frame; return it with the time that this took."""
        ...

    def without_object(self, result: Result) -> Result:
        """Return what is left for the pipeline's own tracks to be drawn of."""
        ...


class NoObjectTracking:
    """Follows nothing, where nothing is to be followed."""

    figure: TrackedObjectFigure | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None: ...

    def update(self, result: Result) -> Result:
        """Return the frame as it is."""
        return result

    def without_object(self, result: Result) -> Result:
        """Return the frame as it is."""
        return result


class HandoverTracking:
    """Follows one track on from its first frame, and writes where it is; a context manager.

    Attributes:
        figure: of the last frame, or None while there is nothing to draw.
    """

    def __init__(self, folder: Path, handover: TrackHandover) -> None:
        """Open the file.

        Args:
            folder: Folder of the results, which gets `trajectory.jsonl`.
            handover: that waits for it.
        """
        self.figure: TrackedObjectFigure | None = None
        self._handover, self._trail = handover, TrackedObjectTrail()
        self._file = trajectory_writer(folder)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the file; say so where the object never came."""
        self._file.close()
        if error is None and not self._handover.has_started:
            log.warning(
                "--follow %d: no frame had a track or a located vehicle of this id; tracks.jsonl and "
                "vehicles.jsonl hold the ids that there were",
                self._handover.track_id,
            )

    def update(self, result: Result) -> Result:
        """Follow the object in one frame, write where it is, and make its figure."""
        start_s = time.perf_counter()
        with limit_blas_threads():
            tracked = self._handover.update(result)
        seconds = time.perf_counter() - start_s
        if tracked is not None:
            self._file.write(TrajectoryRecord.of(result, tracked))
            self._trail.add(result, tracked)
            path_velo = self._trail.path_velo(result)[-_MAX_DRAWN_POSITIONS:]
            name = str(self._handover.track_id)
            self.figure = TrackedObjectFigure.of(tracked, path_velo, name)
        return replace(result, timings_s={**result.timings_s, STAGE: seconds})

    def without_object(self, result: Result) -> Result:
        """Return the frame without the pipeline's own track or vehicle of what is drawn as followed."""
        if self.figure is None:
            return result
        tracked_id, vehicles = self._handover.track_id, result.vehicles
        if vehicles is not None:
            # Its box in the image stays: there the tracker draws none.
            others = np.where(vehicles.ids == tracked_id, np.nan, 1.0)
            bottom_m = vehicles.boxes.bottom_m * others[:, None]
            vehicles = replace(vehicles, boxes=replace(vehicles.boxes, bottom_m=bottom_m))
        tracks = result.tracks[result.tracks.ids != tracked_id]
        return replace(result, tracks=tracks, vehicles=vehicles)
