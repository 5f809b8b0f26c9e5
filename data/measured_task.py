"""Detections measured by nuScenes' detection task: results of any program, and the pipeline's on any labelled drive."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from data.derived.motion_labels import evaluation_labels
from data.detections.config import LabelNoise
from data.detections.measured_drives import DriveReader, DrivesReport
from data.detections.measured_vehicles import open_vehicle_detector
from data.layouts import OpenConfig
from data.nuscenes.result_entries import ResultEntries
from data.nuscenes.results import parse_sample, scenes_with_results
from data.nuscenes.samples import Sample, read_samples
from data.nuscenes.scene import open_scene, scenes_of_samples
from data.open_drive import open_drive, sequences_in
from data.recorded_drive import RecordedDrive
from data.result_files import ResultFiles
from data.results.evaluated import EvaluationDocument
from perception.detection.config import DetectionConfig
from perception.errors import DriveError, LabelError, UsageError
from perception.evaluation.nuscenes.boxes import TaskDetections
from perception.evaluation.nuscenes.protocol import MAX_BOXES, PROTOCOL
from perception.evaluation.nuscenes.report import SampleObjects, TaskReport, measure_task
from perception.pipeline import PipelineConfig
from perception.types import Result

_TITLE = "nuScenes detection task"
_SPLIT = "the files under data; the training data of the program are not known"


def measure_task_results(
    results: ResultFiles, labels: Path, progress: Callable[[Iterable[Any]], Iterable[Any]] = iter
) -> tuple[str, TaskReport, EvaluationDocument]:
    """Measure a results file; return a heading, the metrics, and what they rest on.

    Args:
        results: Detections in nuScenes' form.
        labels: Tables of nuScenes, or the labelled drive whose frames the samples are.
        progress: Progress bar over drives.

    Raises:
        UsageError: The results have another form.
        DriveError: The labels have no sample of them.
        LabelError: A box cannot be read.
    """
    if results.form != "nuScenes" or results.kind != "detections":
        raise UsageError(
            "--protocol nuscenes",
            expected="detections in nuScenes' JSON",
            found=f"{results.kind} of {results.form}",
        )
    samples: dict[str, Sample] = {}
    names: list[str] = []
    for open_one in progress(_drives(results, labels)):
        drive = open_one()
        names.append(drive.name)
        samples |= {one.token: one for one in read_samples(drive)}
    stated: Mapping[str, Any] = results.document["results"]
    named = [token for token in stated if token in samples]
    if not named:
        raise DriveError(
            results.path,
            expected=f"results of the {len(samples)} labelled frames of {labels}",
            found=f"{len(stated)} of other samples",
        )
    missing = [token for token in samples if token not in stated]
    report = _measure(results, [samples[token] for token in (*named, *missing)])
    notes = []
    if missing:
        notes.append(f"{len(missing)} key frames without an entry: counted as no detection")
    if len(named) < len(stated):
        notes.append(f"{len(stated) - len(named)} samples of other scenes: not read")
    data = {
        "results": str(results.path),
        "labels": str(labels),
        "format": results.form,
        "frames": len(samples),
        "notes": notes,
    }
    heading = f"{results.path}: {', '.join(names)}, {len(samples)} samples all round"
    document = EvaluationDocument("detections", data, PROTOCOL, _SPLIT)
    return "\n".join([heading, *notes]), report, document


def measure_task_drives(
    paths: Sequence[Path], reader: DriveReader, detection: DetectionConfig
) -> tuple[DrivesReport, EvaluationDocument]:
    """Run the pipeline on labelled drives and measure its vehicles; return the metrics, and what they rest on.

    Args:
        paths: Folders of labelled drives.
        reader: How they are opened and read.
        detection: Detectors of the pipeline.

    Raises:
        PerceptionError: A drive, a frame or its labels cannot be read or used.
    """
    measured = []
    networks: Mapping[str, Mapping[str, str]] = {}
    for name, drive in reader.drives(paths):
        networks = open_vehicle_detector("fused", drive, detection, LabelNoise()).metadata
        evaluation_labels(drive, 0)  # a fault in them is met before the pipeline runs
        task, indices = measure_task_run(
            drive, reader.results(drive, PipelineConfig(detection=detection))
        )
        sampled = [index for index in indices if drive.sample_token(index) is not None]
        measured.append((reader.describe(name, drive, sampled, networks), task))
    report = DrivesReport(measured)
    return report, EvaluationDocument.of_networks("detection", report.data, PROTOCOL, networks)


def measure_task_run(
    drive: RecordedDrive, results: Iterable[Result]
) -> tuple[TaskReport, list[int]]:
    """Measure the vehicles of a run; return the metrics, and the indices of its frames.

    Args:
        drive: Labelled drive.
        results: Results of the pipeline on its frames.
    """
    entries, indices = ResultEntries(drive), []
    for result in results:
        entries.add(result)
        indices.append(result.frame.index)
    files = ResultFiles(drive.root, "detections", "nuScenes", entries.document())
    return _measure(files, read_samples(drive, indices)), indices


def require_unset(**flags: object) -> None:
    """Validate that no flag is given that nuScenes' detection task does not have.

    Args:
        **flags: Value of each such flag by its name.

    Raises:
        UsageError: One is given.
    """
    for name, value in flags.items():
        if value:
            expected = "none, as nuScenes' detection task measures all classes of all samples"
            raise UsageError(f"--{name.replace('_', '-')}", expected=expected, found="one")


def _drives(results: ResultFiles, labels: Path) -> list[Callable[[], RecordedDrive]]:
    """Return what opens the scenes of nuScenes that have results, or the drive that wrote them."""
    config = OpenConfig(images=False)
    if scene_of := scenes_of_samples(labels):
        names = scenes_with_results(results, labels, scene_of)
        return [partial(open_scene, labels, name, config) for name in names]
    meta = results.document.get("meta")
    wrote = meta.get("drive") if isinstance(meta, dict) else None
    if wrote is None:
        expected = "tables of nuScenes, as the results are of it"
        raise DriveError(labels, expected=expected, found="none")
    name = None if sequences_in(labels) == [None] else str(wrote)
    return [partial(open_drive, labels, sequence=name, config=config)]


def _measure(results: ResultFiles, samples: Sequence[Sample]) -> TaskReport:
    is_around = all(one.surroundings.view is None for one in samples)
    return measure_task(
        _TITLE if is_around else f"{_TITLE}, in the labelled image",
        [
            SampleObjects(one.truths, _detected(results, one.token), one.surroundings)
            for one in samples
        ],
    )


def _detected(results: ResultFiles, token: str) -> TaskDetections:
    found = parse_sample(results, token).objects
    where = f"{results.path} results.{token}"
    if len(found) > MAX_BOXES:
        raise LabelError(where, expected=f"at most {MAX_BOXES} boxes", found=str(len(found)))
    if (found.scores < 0).any():
        raise LabelError(where, expected="scores from 0 on", found=f"{found.scores.min():g}")
    return found
