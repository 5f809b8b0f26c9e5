"""The report of a run, written at its end."""

import logging
from dataclasses import replace
from pathlib import Path

from data.frames import frame_period_s
from data.report.frame_images import MAX_FRAMES, write_panels
from data.report.label_errors import LabelErrors
from data.report.run_facts import RunFacts
from data.results.result_writer import ResultWriter
from perception.errors import PerceptionError
from perception.render.composition import Composition
from perception.render.scene import SceneObjects, SelectedObject
from perception.render.trails import SceneHistory
from perception.snapshot import Restorable
from perception.types import Drive, Progress, Result

log = logging.getLogger(__name__)

# Size of the composition whose two panels are drawn where there is no video.
_SMALL_PX = (1120, 630)


class RunReportWriter(Restorable, ResultWriter):
    """Writes `report.html` of a run when all other results are there, and `report.json` with what they do not hold."""

    memories = ("_facts", "_skipped", "_errors", "_has_labels", "_history", "_row")

    def __init__(
        self,
        out: Path,
        drive: Drive,
        composition: Composition,
        frames: int,
        *,
        has_video: bool,
        progress: Progress = iter,
    ) -> None:
        """Start without frames.

        Args:
            out: Folder of the results.
            drive: Drive of the run.
            composition: Layout of an image of the video.
            frames: Number of frames of the run.
            has_video: Whether the run has a video; else panels of some frames are drawn for the report.
            progress: Progress bar around the rows of the video, at the end.
        """
        self._out, self._drive, self._progress = out, drive, progress
        self._composition = composition if has_video else replace(composition, size_px=_SMALL_PX)
        self._step = max(-(-frames // MAX_FRAMES), 1)
        self._draws, self._has_labels = not has_video, drive.has_labels
        self._history = SceneHistory() if drive.is_sequence else SceneHistory(duration_s=0.0)
        self._errors = LabelErrors(composition.area)
        self._facts: RunFacts | None = None
        self._skipped: dict[str, int] = {}
        self._row = 0

    def add(self, result: Result, selected: SelectedObject | None) -> None:
        """Add one frame."""
        if self._facts is None:
            panels = self._composition.main_panels(result)
            self._facts = RunFacts.of_run(
                frame_period_s(self._drive), {} if self._draws else panels
            )
        for stage in result.skipped:
            self._skipped[stage] = self._skipped.get(stage, 0) + 1
        if self._has_labels:
            self._measure(result)
        if self._draws:
            self._draw(result, selected)
        self._row += 1

    def close(self, *, is_complete: bool) -> None:
        """Write the report of all frames; of a run that stopped, only what `trifuse report` needs to write it."""
        if self._facts is None:
            return
        facts = replace(
            self._facts,
            skipped=self._skipped,
            ground=self._errors.ground,
            precision=self._errors.precision(),
        )
        facts.write(self._out)
        if is_complete:
            from data.report.report_file import write_report

            write_report(self._out, progress=self._progress)

    def _measure(self, result: Result) -> None:
        """Add the errors of a frame; damaged labels end that and not the run, which needs none."""
        try:
            self._errors.update(result, self._drive.labels(result.frame.index))
        except PerceptionError as error:
            log.warning("no errors against labels in the report from here on: %s", error)
            self._has_labels = False

    def _draw(self, result: Result, selected: SelectedObject | None) -> None:
        objects = SceneObjects.of(result, self._composition.display_score, selected)
        scene = self._history.update(result, objects)
        if self._row % self._step == 0:
            if selected is not None:
                scene = replace(scene, tracked=selected.tracked)
            write_panels(self._out, self._row, self._composition.draw_main_panels(scene))
