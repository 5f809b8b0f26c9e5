"""Results in nuScenes' JSON, and the key frames that they belong to, each in the view of the main camera.

    {"meta": {...}, "results": {"SAMPLE": [{"translation": [x, y, z], "size": [width, length, height], "rotation":
    [w, x, y, z], "detection_name": "car", "detection_score": 0.8, "attribute_name": ""}, ...], ...}}

Tracks have tracking_name, tracking_score and tracking_id instead.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from scipy.spatial.transform import Rotation

from data.layouts import OpenConfig
from data.nuscenes.boxes import CATEGORIES, category, upright_boxes
from data.nuscenes.samples import Sample, read_samples
from data.nuscenes.scene import NuScenesScene, open_scene, scenes_of_samples
from data.result_files import ResultFiles, ResultKind
from perception.errors import CalibrationError, DriveError, LabelError
from perception.evaluation.detection.box_rows import LocatedDetections
from perception.evaluation.nuscenes.boxes import TaskDetections
from perception.evaluation.nuscenes.protocol import ATTRIBUTES
from perception.geometry.boxes import transform_boxes
from perception.geometry.camera import box_outlines_px
from perception.geometry.se3 import inverse
from perception.types import ArrayTable, Boxes3D, Calibration, Detections, Float64, Int, Labels

# Category of each class, as the beginning of its name.
_CATEGORIES = {one.task_class: name for name, one in CATEGORIES.items() if one.task_class}
_NUMBERS = {"translation": 3, "size": 3, "rotation": 4}
_MAX_NUMBER = 1e9  # beyond the coordinates of any map
_MIN_NORM = 0.5  # of a rotation's quaternion


@dataclass(frozen=True)
class SampleBoxes(ArrayTable):
    """M boxes of one sample.

    Attributes:
        types: (M,) class names, as KITTI has them.
        boxes_world: (M) boxes in the world of the tables.
        scores: (M,) scores.
        track_ids: (M,) names of the tracks; empty of detections.
        objects: (M) the same as objects of the detection task.
    """

    types: np.ndarray
    boxes_world: Boxes3D
    scores: Float64
    track_ids: np.ndarray
    objects: TaskDetections


@dataclass(frozen=True)
class KeyFrame:
    """A key frame with its labels and the results of its sample, both as far as the camera sees them.

    Attributes:
        labels: Labels with boxes in the image.
        found: Results with boxes in the image and in the LiDAR frame.
        track_ids: (M,) names of the tracks.
        sample: Sample with the objects all round.
        results: Results all round.
    """

    labels: Labels
    found: LocatedDetections
    track_ids: np.ndarray
    sample: Sample
    results: SampleBoxes


@dataclass(frozen=True)
class SceneResults:
    """Results of the scenes of some tables.

    Attributes:
        scenes: Key frames of each scene that has results, by its name.
        labelled: Number of scenes of the tables.
        missing: Number of the key frames that have no entry in the results.
        others: Number of entries whose sample is in none of the tables.
    """

    scenes: Mapping[str, Sequence[KeyFrame]]
    labelled: int
    missing: int
    others: int

    @property
    def frames(self) -> list[KeyFrame]:
        """Key frames of one scene after the other."""
        return [frame for frames in self.scenes.values() for frame in frames]

    @property
    def notes(self) -> list[str]:
        """Sentences on what of the results is scored, and how."""
        boxes, seen = (
            sum(len(f.results) for f in self.frames),
            sum(len(f.track_ids) for f in self.frames),
        )
        notes = [
            f"{', '.join(self.scenes)}: {len(self.frames)} key frames; scored is what lies in the image of the front "
            f"camera, {seen} of {boxes} boxes"
        ]
        if self.missing:
            notes.append(f"{self.missing} key frames without an entry: counted as no detection")
        if self.others:
            notes.append(f"{self.others} samples of other scenes: not read")
        return notes


def read_scene_results(files: ResultFiles, root: Path, progress: Any = iter) -> SceneResults:  # noqa: ANN401 - a bar over scenes
    """Read the key frames of the scenes that have results, with these.

    Args:
        files: Results in nuScenes' form.
        root: Folder of the data set.
        progress: Progress bar over the names of the scenes.

    Raises:
        DriveError: There are no tables, or none of a sample with results, or no labelled boxes.
        LabelError: A box cannot be read.
    """
    samples, scene_of = files.document["results"], scenes_of_samples(root)
    if not scene_of:
        raise DriveError(
            root, expected="tables of nuScenes, as the results are of it", found="none"
        )
    scenes = {}
    missing = 0
    for name in progress(scenes_with_results(files, root, scene_of)):
        drive = open_scene(root, name, OpenConfig(images=False))
        frames = list(_key_frames(drive, files))
        missing += sum(scan.sample not in samples for scan in drive.scans if scan.is_key_frame)
        scenes[name] = frames
    others = sum(token not in scene_of for token in samples)
    return SceneResults(scenes, len(set(scene_of.values())), missing, others)


def scenes_with_results(files: ResultFiles, root: Path, scene_of: Mapping[str, str]) -> list[str]:
    """Return the names of the scenes that have results.

    Args:
        files: Results in nuScenes' form.
        root: Folder of the data set.
        scene_of: Name of the scene of each sample.

    Raises:
        DriveError: There is none.
    """
    samples = files.document["results"]
    names = sorted({scene_of[token] for token in samples if token in scene_of})
    if not names:
        raise DriveError(
            files.path,
            expected=f"results of the {len(scene_of)} samples of {root}",
            found=f"{len(samples)} of other samples",
        )
    return names


def _key_frames(drive: NuScenesScene, files: ResultFiles) -> Iterator[KeyFrame]:
    """Yield the key frames of a scene."""
    camera = drive.calibration
    if not drive.has_labels:
        raise DriveError(drive.root, expected=f"labelled boxes of {drive.name}", found="none")
    if camera is None:
        raise CalibrationError(drive.root, expected=f"a camera of {drive.name}", found="none")
    keys = [index for index, scan in enumerate(drive.scans) if scan.is_key_frame]
    for index, sample in zip(keys, read_samples(drive, keys), strict=True):
        found, pose = parse_sample(files, sample.token), drive.map_SE3_velo(index)
        located, rows = _in_view(found, inverse(pose), camera)
        yield KeyFrame(drive.labels(index), located, found.track_ids[rows], sample, found)


def _in_view(
    found: SampleBoxes, velo_SE3_world: Float64, camera: Calibration
) -> tuple[LocatedDetections, Int]:
    """Return the boxes that reach into the image, and their rows."""
    boxes_velo = transform_boxes(velo_SE3_world, found.boxes_world)
    boxes_px = box_outlines_px(camera.image_P_velo, boxes_velo, camera.image_size_px)
    rows = np.flatnonzero(np.isfinite(boxes_px).all(axis=1))
    detections = Detections(boxes_px[rows], found.scores[rows], found.types[rows])
    return LocatedDetections(detections, boxes_velo[rows], camera), rows


def parse_sample(files: ResultFiles, sample: str) -> SampleBoxes:
    """Return the boxes of one sample; none where it has no entry.

    Raises:
        LabelError: One of them is no box.
    """
    where = f"{files.path} results.{sample}"
    entries = files.document["results"].get(sample, [])
    if not isinstance(entries, list):
        raise LabelError(where, expected="a list of boxes", found=type(entries).__name__)
    boxes = [_Box.parse(f"{where}[{row}]", one, files.kind) for row, one in enumerate(entries)]
    tracks = [box.track_id for box in boxes if files.kind == "tracks"]
    if len(set(tracks)) < len(tracks):
        repeated = next(one for one in tracks if tracks.count(one) > 1)
        expected = "every tracking_id once in a sample"
        raise LabelError(where, expected=expected, found=f"{repeated!r} again")
    numbers = np.array([box.numbers for box in boxes], np.float64).reshape(-1, 12)
    turned = Rotation.from_quat(numbers[:, [7, 8, 9, 6]]) if boxes else Rotation.identity(0)
    scores = np.array([box.score for box in boxes], np.float64)
    boxes_world = upright_boxes(numbers[:, :3], numbers[:, [4, 3, 5]], turned.as_matrix())
    return SampleBoxes(
        types=np.array([box.type for box in boxes], np.str_),
        boxes_world=boxes_world,
        scores=scores,
        track_ids=np.array([box.track_id for box in boxes], np.str_),
        objects=TaskDetections(
            types=np.array([box.name for box in boxes], np.str_),
            centers_m=numbers[:, :3],
            size_m=boxes_world.size_m,
            yaw_rad=boxes_world.yaw_rad,
            velocities_m_s=numbers[:, 10:],
            attributes=np.array([box.attribute for box in boxes], np.str_),
            scores=scores,
        ),
    )


@dataclass(frozen=True)
class _Box:
    """One box: class as KITTI and as the file has it, score, track, and the numbers of place, size, rotation, velocity."""

    type: str
    name: str
    attribute: str
    score: float
    track_id: str
    numbers: Sequence[float]

    @classmethod
    def parse(cls, where: str, entry: Any, kind: ResultKind) -> Self:  # noqa: ANN401 - whatever the file holds
        """Return a box of a file.

        Raises:
            LabelError: It lacks a part of one.
        """
        prefix = "tracking" if kind == "tracks" else "detection"
        fields = entry if isinstance(entry, dict) else {}
        place, size, rotation = (_numbers(where, fields, *one) for one in _NUMBERS.items())
        if min(size) <= 0:
            raise _error(where, "size", "width, length and height above 0", size)
        if np.linalg.norm(rotation) < _MIN_NORM:
            raise _error(where, "rotation", "a unit quaternion", rotation)
        name: Any = fields.get(f"{prefix}_name")
        score: Any = fields.get(f"{prefix}_score")
        if type(name) is not str or name not in _CATEGORIES:
            raise _error(where, f"{prefix}_name", f"one of {', '.join(sorted(_CATEGORIES))}", name)
        if not _is_number(score):
            raise _error(where, f"{prefix}_score", "a number", score)
        track = fields.get("tracking_id")
        if kind == "tracks" and not isinstance(track, str | int):
            raise _error(where, "tracking_id", "the name of a track", track)
        attribute = str(fields.get("attribute_name") or "")
        if attribute not in ("", *ATTRIBUTES):
            raise _error(
                where, "attribute_name", f"none or one of {', '.join(ATTRIBUTES)}", attribute
            )
        kitti = category(_CATEGORIES[name], (attribute,)).kind
        numbers = (*place, *size, *rotation, *_velocity(where, fields))
        return cls(str(kitti), name, attribute, float(score), str(track), numbers)


def _velocity(where: str, fields: Mapping[str, Any]) -> list[float]:
    """Return the velocity of a box; NaN where it is not stated, or stated as such."""
    value = fields.get("velocity")
    is_pair = isinstance(value, list) and len(value) == 2
    if value is None or (is_pair and all(_is_unknown(one) for one in value)):
        return [float("nan")] * 2
    return _numbers(where, fields, "velocity", 2)


def _is_unknown(value: Any) -> bool:  # noqa: ANN401 - whatever the file holds
    return value is None or (type(value) is float and math.isnan(value))


def _numbers(where: str, fields: Mapping[str, Any], name: str, count: int) -> list[float]:
    value = fields.get(name)
    if not isinstance(value, list) or len(value) != count or not all(map(_is_number, value)):
        raise _error(where, name, f"{count} numbers", value)
    return [float(one) for one in value]


def _is_number(value: Any) -> bool:  # noqa: ANN401 - whatever the file holds
    return type(value) in (int, float) and abs(value) <= _MAX_NUMBER


def _error(where: str, name: str, expected: str, value: object) -> LabelError:
    text = repr(value)
    return LabelError(f"{where} {name}", expected=expected, found=text[:80])
