"""The pipeline over a drive once for each fault and size."""

import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from data.faults.injection import Fault
from data.faults.kinds import FAULT_KINDS
from data.frames import frame_count
from data.labelled_drives import LabelledDrives
from data.results.evaluated import EvaluatedDrive, EvaluationDocument
from data.results.finished_runs import FinishedRuns
from perception.detection.config import DetectionConfig
from perception.errors import UsageError
from perception.evaluation.fault_cost import (
    CLEAN,
    PROTOCOL,
    FaultCost,
    FaultCostMeasure,
    FaultCostReport,
)
from perception.pipeline import PipelineConfig
from perception.types import Drive

log = logging.getLogger(__name__)

_ALL = ("all",)


@dataclass(frozen=True)
class FaultRuns:
    """Runs over one drive, one without a fault and one for each fault and size.

    Attributes:
        drive: Drive with labels or exact truth.
        reader: How its frames are read.
        detection: Detectors of the pipeline.
        seed: Seed of the faults.
    """

    drive: Drive
    reader: LabelledDrives
    detection: DetectionConfig
    seed: int

    def measure(
        self, kinds: tuple[str, ...], values: Mapping[str, object], finished: Path | None
    ) -> tuple[FaultCostReport, EvaluationDocument, str]:
        """Make all runs but those that are finished; return their cost, what it rests on, and a heading.

        Args:
            kinds: `KIND` for all its sizes or `KIND:SIZE`; `all` for all kinds.
            values: Configuration of the command; runs of another one are refused.
            finished: JSON file that keeps each finished run; None for none.
        """
        count = frame_count(self.drive, self.reader.frames)
        first, last = count // 3, count - 1
        runs = FinishedRuns.open(finished, values, FaultCost)
        cases: dict[str, Fault | None] = {CLEAN: None}
        cases |= {
            f"{kind} {size:g}": Fault(kind, first, last, size, self.seed)
            for kind, size in kinds_and_sizes(kinds)
        }
        for row, (name, fault) in enumerate(cases.items()):
            if name not in runs.metrics:
                log.info("%s: run %d of %d", name, row + 1, len(cases))
                runs.add(name, self._run(fault, first))
        measured = FaultCostReport({name: runs.metrics[name] for name in cases})
        data = EvaluatedDrive.of(self.drive, self.reader.frames, count)
        document = EvaluationDocument("robustness", data, PROTOCOL)
        return measured, document, f"{data}, faults from frame {first} on"

    def _run(self, fault: Fault | None, first: int) -> FaultCost:
        pipeline = PipelineConfig(detection=self.detection)
        kind, size = (CLEAN, 0.0) if fault is None else (fault.kind, fault.size or 0.0)
        part = "" if fault is None else fault.definition.part
        measure = FaultCostMeasure(
            kind,
            size,
            first,
            part,
            pipeline.area_of(self.drive.sensor),
            self.detection.display_score,
        )
        faults = () if fault is None else (fault,)
        for result in self.reader.results(self.drive, pipeline, faults):
            index = result.frame.index
            labels = self.drive.labels(index) if self.drive.has_labels else None
            measure.update(result, labels, self.drive.point_truth(index))
        return measure.compute()


def kinds_and_sizes(kinds: tuple[str, ...]) -> Iterator[tuple[str, float]]:
    """Yield kind and size of each fault of `--faults`.

    Args:
        kinds: `KIND` for all its sizes or `KIND:SIZE`; `all` for all kinds.

    Raises:
        UsageError: There is no such kind, or the size is no number.
    """
    for text in FAULT_KINDS if kinds == _ALL else kinds:
        kind, _, size = text.partition(":")
        if kind not in FAULT_KINDS:
            expected = f"all, or of {', '.join(FAULT_KINDS)}"
            raise UsageError("--faults", expected=expected, found=kind)
        try:
            sizes = (float(size),) if size else FAULT_KINDS[kind].sizes
        except ValueError as error:
            raise UsageError("--faults", expected="KIND or KIND:SIZE", found=text) from error
        yield from ((kind, one) for one in sizes)
