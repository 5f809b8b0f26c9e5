"""Precision that sets of modalities reach on drives of sensors with few and many beams, and the time that they take."""

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, cast

import numpy as np

from benchmarks.studies.report import RESULTS, publish
from perception.cli.flags import LabelledDriveFlags
from perception.detection.config import NO_DETECTION, DetectionConfig
from perception.evaluation.report import Metric, Metrics, Table
from perception.pipeline import PipelineConfig
from perception.render.bar_plots import plot_groups
from perception.types import DetectorModality, Result

SETS = ("rgb", "bev", "rgb+bev", "rgb+dm+rm", "rgb+dm+rm+bev")
_CLASSES = ("car", "pedestrian")
_DETECTION = DetectionConfig()


@dataclass(frozen=True)
class SetMetrics(Metrics):
    """What a set of modalities finds on a drive, and what it costs.

    Attributes:
        car: AP of cars, mean over the distances, 0 to 1.
        pedestrian: AP of pedestrians.
        cost_ms: Processor time of a frame beyond that without detectors in milliseconds.
    """

    car: Annotated[float, Metric("car AP [%]", ".1%")]
    pedestrian: Annotated[float, Metric("pedestrian AP [%]", ".1%")]
    cost_ms: Annotated[float, Metric("CPU/frame [ms]", ".1f")]

    @property
    def mean_ap(self) -> float:
        """Mean of both AP, 0 to 1."""
        return (self.car + self.pedestrian) / 2

    @property
    def per_ms(self) -> Annotated[float, Metric("AP/ms [points]", ".2f")]:
        """Points of the mean AP for each millisecond."""
        return 100 * self.mean_ap / self.cost_ms


@dataclass
class Timed:
    """Results of a run, and the processor time of its frames but the first, for which the networks are opened.

    Attributes:
        results: Results of the pipeline.
        seconds: Processor time of each frame so far, reading included.
    """

    results: Iterable[Result]
    seconds: list[float] = field(default_factory=list)

    def __iter__(self) -> Iterator[Result]:
        last_s: float | None = None
        for result in self.results:
            now_s = time.process_time()
            self.seconds += [] if last_s is None else [now_s - last_s]
            yield result
            last_s = time.process_time()


def modalities(
    drives: list[Path],
    *,
    drive: LabelledDriveFlags,
    sets: tuple[str, ...] = SETS,
    evidence: list[Path] | None = None,
    detection: DetectionConfig = _DETECTION,
    out: Path = RESULTS / "modalities.png",
) -> None:
    """Measure sets of modalities by nuScenes' detection task, all round, beside the processor time that they take.

    Example: trifuse study modalities nuscenes synth/vlp16 --sets rgb,bev,rgb+bev

    Args:
        drives: Labelled drives of sensors with few and many beams; one or several.
        sets: Modalities joined by +, several sets with commas.
        evidence: Labelled synthetic drives with images, with commas between them, to which the constants are fitted by
            which detections in an image and from above are joined, and of whose objects the names are counted.
        detection: Networks of the modalities.
        out: Figure; the numbers are written beside it.
    """
    from benchmarks.studies.bev_evidence import Evidence, Names, measure_evidence
    from data.measured_task import measure_task_run
    from data.open_drive import open_drives

    reader, measured = drive.reader(), dict[str, dict[str, SetMetrics]]()
    for name, opened in reader.drives(drives):
        rows = measured[f"{name}: {opened.sensor.name}"] = {}
        idle_ms = _cost_ms(Timed(reader.results(opened, PipelineConfig(detection=NO_DETECTION))))
        for words in sets:
            own = replace(
                detection,
                modalities=cast("tuple[DetectorModality, ...]", tuple(words.split("+"))),
                depthcn=NO_DETECTION.depthcn,
            )
            timed = Timed(reader.results(opened, PipelineConfig(detection=own)))
            report, _ = measure_task_run(opened, timed)
            car, pedestrian = (report.classes[one].mean_ap for one in _CLASSES)
            rows[words] = SetMetrics(car, pedestrian, _cost_ms(timed) - idle_ms)
    tables: dict[str, Table[Any]] = {
        name: Table(name, SetMetrics.columns(), rows, "modalities")
        for name, rows in measured.items()
    }
    figures = {
        heading: {
            words: np.array([getattr(rows[words], value) for rows in measured.values()])
            for words in sets
        }
        for heading, value in (("mean AP, 0 to 1", "mean_ap"), ("CPU/frame [ms]", "cost_ms"))
    }
    if evidence:
        title = "Evidence of the view from above"
        config = replace(detection, modalities=("rgb", "bev"))
        fitted, named = measure_evidence(open_drives(evidence), config)
        tables[title] = Table(title, Evidence.columns(), fitted, "objects")
        title = "Names of labelled objects by source"
        tables[title] = Table(title, Names.columns(), named, "class")
    plot_groups(out, "Modalities by sensor", list(measured), figures)
    conditions = {"drives": drives, "sets": sets, "evidence": evidence, "detection": detection}
    publish(out, "none: the thesis has no view from above", tables, conditions)


def _cost_ms(timed: Timed) -> float:
    if not timed.seconds:
        for _ in timed:
            pass
    return 1e3 * float(np.median(timed.seconds))
