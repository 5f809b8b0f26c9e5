"""Result files of any program, measured against labels by KITTI's protocols."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from data.coco_results import parse_coco_detections
from data.kitti.detection_rows import DetectionSet, read_detection_set, read_frame_list
from data.kitti.tracker_files import (
    TrackedSequenceFiles,
    label_folder,
    other_names,
    pair_with_labels,
    sequences_in,
)
from data.kitti.tracking_rows import NO_TYPE, read_label_rows
from data.nuscenes.results import KeyFrame, read_scene_results
from data.nuscenes.task_tracks import tracked_scene
from data.result_files import ResultFiles
from data.results.evaluated import EvaluationDocument
from perception.errors import UsageError
from perception.evaluation.detection.benchmark_scores import measure_benchmark
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.class_precision import PrecisionReport, measure_precision
from perception.evaluation.detection.config import PrecisionConfig, PublishedTable
from perception.evaluation.detection.evaluation_boxes import pair_boxes
from perception.evaluation.detection.protocol import DONT_CARE, DetectionClass
from perception.evaluation.detection.published import PublishedComparison
from perception.evaluation.frame_numbering import numbering_fit, numbering_notes
from perception.evaluation.multi_object.ground_protocol import GroundTracks
from perception.evaluation.multi_object.kitti_protocol import NEIGHBOURS, ImageBoxes, KittiClass
from perception.evaluation.nuscenes.tracking import measure_task_tracks
from perception.evaluation.report import Report
from perception.evaluation.tracking_measure import PROTOCOL, TrackingMeasure
from perception.evaluation.vehicle_measure import labelled_boxes
from perception.types import Progress

_SPLIT = "the files under data; the training data of the program are not known"
_NO_RIDERS = "cyclist"  # nuScenes' tracks do not state whether a bicycle has a rider


@dataclass(frozen=True)
class ResultBars:
    """Progress bars over the files of results.

    Attributes:
        reading: Bar over the frames that are read.
        bootstrap: Bar over the resamples.
        sequences: Bar over the sequences of tracks.
    """

    reading: Progress = iter
    bootstrap: Progress = iter
    sequences: Callable[[Iterable[Any]], Iterable[Any]] = iter


def measure_detections(  # noqa: PLR0913, PLR0917 - each is a flag of its own
    results: ResultFiles,
    labels: Path,
    classes: Sequence[DetectionClass],
    metric: PrecisionConfig,
    frame_list: Path | None,
    published: PublishedTable | None,
    bars: ResultBars,
) -> tuple[str, PrecisionReport, EvaluationDocument]:
    """Measure detections; return a heading, the metrics, and what they rest on.

    Args:
        results: Results of a detector.
        labels: Folder of the label files, or the root of KITTI's object data; the tables of nuScenes for its results.
        classes: Classes to measure.
        metric: Average precision.
        frame_list: File of frame numbers, one a row; None for all frames with labels.
        published: Table of the thesis whose published detectors stand beside, or None.
        bars: Progress bars.

    Raises:
        LabelError: A file cannot be read.
        UsageError: There are no frame numbers that a list could name.
    """
    found = _read_detections(results, labels, frame_list, bars)
    frames = len(found.numbers)
    rows = found.truths, found.detections, frames
    boxes, scores = pair_boxes(*rows), measure_benchmark(*rows, classes, metric, bars.bootstrap)
    precision = [measure_precision(boxes, one, metric, bars.bootstrap) for one in classes]
    data = {
        **_paths(results=results.path, labels=labels, frame_list=frame_list),
        "format": results.form,
        "frames": frames,
        "missing_results": found.missing_results,
        "detections": len(found.detections),
        "notes": found.notes,
    }
    words = metric.protocol(classes=classes)
    document = EvaluationDocument("detections", data, words, _SPLIT)
    title = f"Average precision in the image, {frames} frames"
    computed = PrecisionReport(title, precision, benchmark=scores)
    if published is not None:
        place = f"{frames} frames of {labels}"
        computed = PublishedComparison(title, precision, (), scores, published, place)
    return f"{results.path}: {found.description}", computed, document


def _read_detections(
    results: ResultFiles, labels: Path, frame_list: Path | None, bars: ResultBars
) -> DetectionSet:
    if results.form == "nuScenes":
        _require_no_file("--frame-list", frame_list)
        scenes = read_scene_results(results, labels, bars.sequences)
        cameras = [one.found.camera for one in scenes.frames]
        return DetectionSet(
            numbers=tuple(range(len(cameras))),
            truths=TrueBoxes.of_frames([one.labels for one in scenes.frames], cameras),
            detections=DetectedBoxes.of_located([one.found for one in scenes.frames]),
            notes=tuple(scenes.notes),
        )
    numbers = None if frame_list is None else read_frame_list(frame_list)
    if results.form == "COCO":
        coco = parse_coco_detections(results.path, results.document)
        found = read_detection_set(coco, labels, numbers, bars.reading)
        return replace(found, notes=(coco.note, *found.notes))
    return read_detection_set(results.path, labels, numbers, bars.reading)


def measure_tracks(
    results: ResultFiles,
    labels: Path,
    classes: Sequence[str],
    seqmap: Path | None,
    bars: ResultBars,
) -> tuple[str, Report, EvaluationDocument]:
    """Measure tracks; return a heading, the metrics, and what they rest on.

    Args:
        results: Results of a tracker.
        labels: Folder of the label files, or the root of KITTI's tracking data; the tables of nuScenes for its results.
        classes: Names of the classes to measure; none for car and pedestrian.
        seqmap: File of sequence names and numbers of frames; None for all sequences with results.
        bars: Progress bars.

    Raises:
        UsageError: A class is none of KITTI's, or no class is named of results that state none.
        LabelError: A file cannot be read.
    """
    requested = {name.lower() for name in classes or ("car", "pedestrian")}
    if not requested <= set(NEIGHBOURS):
        raise UsageError("--classes", expected=", ".join(NEIGHBOURS), found=",".join(classes))
    chosen = [name for name in NEIGHBOURS if name in requested]
    if results.form == "nuScenes":
        _require_no_file("--seqmap", seqmap)
        measured = _measure_scenes(results, labels, chosen, bars)
    else:
        labels = label_folder(labels)
        measured = _measure_sequences(results.path, labels, chosen, seqmap, bars)
    computed = replace(measured.measure.compute(), task=measured.task)
    data = {
        **_paths(results=results.path, labels=labels, seqmap=seqmap),
        "format": results.form,
        "frames": computed.frame_counts,
        "notes": measured.notes,
    }
    document = EvaluationDocument("tracks", data, PROTOCOL, _SPLIT)
    heading = (
        f"{results.path}: {len(computed.frame_counts)} of {measured.labelled} labelled sequences, "
        f"{sum(computed.frame_counts.values())} frames"
    )
    return "\n".join([heading, *measured.notes]), computed, document


@dataclass(frozen=True)
class _MeasuredTracks:
    """Tracks of some sequences.

    Attributes:
        measure: Measure of the sequences.
        labelled: Number of sequences that have labels.
        notes: Sentences on how the results are read.
        task: Metrics of nuScenes' tracking task, of its results.
    """

    measure: TrackingMeasure
    labelled: int
    notes: Sequence[str]
    task: Report | None = None


def _measure_sequences(
    results: Path, labels: Path, chosen: Sequence[KittiClass], seqmap: Path | None, bars: ResultBars
) -> _MeasuredTracks:
    """Measure the tracks of sequences in KITTI's or MOTChallenge's columns."""
    pairs, labelled = pair_with_labels(results, labels, seqmap), sequences_in(labels)
    unread = other_names(results, set(labelled) - {files.name for files in pairs})
    notes = [f"{file}: not read, as the labels are {name}.txt" for file, name in unread.items()]
    if any(not files.states_classes for files in pairs):
        only = _only_class(pairs, chosen)
        chosen = [only]
        notes.append(f"{results}: MOTChallenge's rows state no class: all count as {only}")
    measure, fits = TrackingMeasure(chosen), {}
    for files in bars.sequences(pairs):
        rows = files.read()
        true, found = rows.labels.image_boxes, rows.results.image_boxes
        types = np.where(found.types == NO_TYPE, chosen[0], found.types)
        measure.update(files.name, true, replace(found, types=types), rows.frame_count)
        objects = true[np.char.lower(true.types) != DONT_CARE]
        fits[files.name] = numbering_fit(
            objects.frames, objects.boxes_px, found.frames, found.boxes_px
        )
    return _MeasuredTracks(measure, len(labelled), [*notes, *numbering_notes(fits)])


def _only_class(pairs: Sequence[TrackedSequenceFiles], chosen: Sequence[KittiClass]) -> KittiClass:
    """Return the one class of those chosen that has labels, for rows that state none."""
    if len(chosen) > 1:
        types = {
            kind.lower() for files in pairs for kind in read_label_rows(files.labels).types.tolist()
        }
        found = [name for name in chosen if name in types]
        if len(found) != 1:
            raise UsageError(
                "--classes",
                expected="one class, as MOTChallenge's rows state none",
                found=f"labels of {' and '.join(found) or 'no ' + ' and no '.join(chosen)}",
                advice="name the class that was tracked",
            )
        chosen = found
    return chosen[0]


def _measure_scenes(
    results: ResultFiles, root: Path, chosen: Sequence[KittiClass], bars: ResultBars
) -> _MeasuredTracks:
    """Measure the tracks of nuScenes' scenes that the front camera sees, in its image and on the ground."""
    if _NO_RIDERS in chosen:
        expected = "car, pedestrian: nuScenes' tracks do not state whether a bicycle has a rider"
        raise UsageError("--classes", expected=expected, found=_NO_RIDERS)
    found = read_scene_results(results, root, bars.sequences)
    measure = TrackingMeasure(chosen)
    for name, frames in found.scenes.items():
        tracks = _tracks(frames)
        measure.update(name, *_image_boxes(frames, tracks), len(frames))
        labels = [one.labels for one in frames]
        measure.update_ground(list(zip(labels, tracks, strict=True)))
    task = measure_task_tracks(
        [tracked_scene([(one.sample, one.results) for one in of]) for of in found.scenes.values()]
    )
    return _MeasuredTracks(measure, found.labelled, found.notes, task)


def _tracks(frames: Sequence[KeyFrame]) -> list[GroundTracks]:
    """Return the tracks of the key frames of a scene, with numbers in place of their names."""
    names = np.unique(np.concatenate([one.track_ids for one in frames]))
    return [
        GroundTracks(
            ids=np.searchsorted(names, one.track_ids),
            types=one.found.detections.types,
            boxes=one.found.boxes_velo,
            boxes_px=one.found.detections.boxes_px,
        )
        for one in frames
    ]


def _image_boxes(
    frames: Sequence[KeyFrame], tracks: Sequence[GroundTracks]
) -> tuple[ImageBoxes, ImageBoxes]:
    """Return the labels and the tracks of a scene as boxes in the image."""
    true, tracked = [], []
    for number, (one, found) in enumerate(zip(frames, tracks, strict=True)):
        labels = labelled_boxes(one.labels)
        true.append(replace(labels, frames=np.full(len(labels), number)))
        here, unknown = np.full(len(found), number), np.full(len(found), -1.0)
        tracked.append(ImageBoxes(here, found.ids, found.types, unknown, unknown, found.boxes_px))
    return ImageBoxes.concatenate(true), ImageBoxes.concatenate(tracked)


def _require_no_file(flag: str, file: Path | None) -> None:
    if file is not None:
        raise UsageError(
            flag, expected="none, as nuScenes' results name their samples", found=str(file)
        )


def _paths(**paths: Path | None) -> dict[str, object]:
    return {name: path and path.resolve() for name, path in paths.items()}
