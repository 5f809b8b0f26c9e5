"""Labels of a drive as a tool wrote them: joined to the scans, validated, and read in the axes of the LiDAR."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TypeVar

import numpy as np

from data.box_labels.axes_check import LabelledSample, boxes_of, choose_reading, numbers_of_boxes
from data.box_labels.boxes import LabelForm, LabelledBox, Reading, read_content
from data.box_labels.forms import label_files
from data.box_labels.label_types import label_type
from data.folder.drive import FolderDrive
from data.labelled_objects import labels_of_boxes
from data.reflectance import sample_indices
from perception.detection.bev.bev_map import BevGrid, BevMapper
from perception.errors import LabelError, PerceptionError
from perception.types import Float64, Int, Labels

Made = TypeVar("Made")
_SAMPLES = 6  # frames, of which the axes are checked
_UNTRACKED = -1


@dataclass(frozen=True)
class BoxLabels:
    """Labels of everything around.

    Attributes:
        path: File of labels, or folder of them.
        form: Form of the labels.
        classes: Other names for classes of the labels.
        drive: The whole drive without labels, to whose scans they belong.
    """

    path: Path
    form: LabelForm
    classes: Mapping[str, str]
    drive: FolderDrive

    def at(self, name: str, velo_SE3_file: Float64) -> Labels | None:
        """Return the labels of a frame, None of one that is not labelled.

        Args:
            name: Name of the frame.
            velo_SE3_file: (4, 4) transform from the axes of its scan to the LiDAR frame.

        Raises:
            LabelError: The labels cannot be read, or do not fit the scans.
        """
        boxes = self.boxes(name)
        if boxes is None:
            return None
        numbers = _known(self._reading).boxes(numbers_of_boxes(boxes))
        found = boxes_of(numbers, velo_SE3_file)
        return labels_of_boxes(found, self.types(boxes), self.track_ids(boxes))

    def boxes(self, name: str) -> Sequence[LabelledBox] | None:
        """Return the boxes of a frame as the files state them, None of one that is not labelled."""
        is_named = self.form.is_per_scan or self.form.names_frames
        return _known(self._boxes).get(name, None if is_named else ())

    def types(self, boxes: Sequence[LabelledBox]) -> list[str]:
        """Return the types of some boxes."""
        return [label_type(box.kind, self.classes) for box in boxes]

    def track_ids(self, boxes: Sequence[LabelledBox]) -> Int:
        """Return the (M,) numbers of the objects of some boxes, -1 of those without."""
        ids = [self._track_ids.get(box.track, _UNTRACKED) for box in boxes]
        return np.array(ids, np.int64)

    def file(self, name: str) -> Path:
        """Return the file of the labels of a frame, or the path of all."""
        return self._files.get(name, self.path)

    @cached_property
    def _files(self) -> Mapping[str, Path]:
        """File of each frame, of a form with one a scan."""
        paths = label_files(self.path).paths if self.form.is_per_scan else ()
        return {self._frames[one.stem]: one for one in paths if one.stem in self._frames}

    @cached_property
    def _boxes(self) -> Mapping[str, Sequence[LabelledBox]] | LabelError:
        """Boxes of each labelled frame, or the fault in a file, which is met before anything is made of the others."""
        return _outcome(self._read)

    def _read(self) -> Mapping[str, Sequence[LabelledBox]]:
        boxes: dict[str, list[LabelledBox]] = {}
        for path in label_files(self.path).paths:
            content = read_content(path)
            if not self.form.is_of(content):
                expected = f"labels of {self.form.name}, as the other files"
                raise LabelError(path, expected=expected, found="another content")
            for frame, ones in self.form.read(path, content).items():
                where = ones[0].where if ones else str(path)
                name = self._frame(frame or path.stem, where)
                if name is None:
                    continue
                if name in boxes:
                    raise LabelError(path, expected="a scan once", found=f"labels of {name} again")
                boxes[name] = list(ones)
        for ones in boxes.values():
            _require_single(ones)
        return boxes

    @cached_property
    def _frames(self) -> Mapping[str, str]:
        """Name of each frame by the names and numbers that labels may call it."""
        names = self.drive.scans.names
        numbers = map(str, self.drive.scans.numbers)
        stems = (path.stem for path in self.drive.scans.paths)
        return {**dict(zip(numbers, names, strict=True)), **dict(zip(stems, names, strict=True))}

    def _frame(self, name: str, where: str) -> str | None:
        """Return the name of the frame that labels call so; None of one that is none of the drive's."""
        known = self._frames.get(name) or self._frames.get(name.lstrip("0") or "0")
        if known is None:
            names = self.drive.scans.names
            found = f"labels of {name}, which is none of {len(names)} scans such as {names[0]}"
            advice = "add the scan, or remove the labels"
            raise LabelError(where, expected="labels of scans", found=found, advice=advice)
        return known

    @cached_property
    def _track_ids(self) -> Mapping[str, int]:
        """Number of each object: its own where all are numbers, else from 0 in the order of names."""
        names = {box.track for boxes in _known(self._boxes).values() for box in boxes if box.track}
        if all(name.isdecimal() and len(name) < 10 for name in names):
            return {name: int(name) for name in names}
        return {name: number for number, name in enumerate(sorted(names))}

    @cached_property
    def _reading(self) -> Reading | LabelError:
        return _outcome(self._choose)

    def _choose(self) -> Reading:
        boxes = [_known(self._boxes).get(name) or () for name in self.drive.scans.names]
        labelled = [index for index, ones in enumerate(boxes) if ones]
        places = sample_indices(len(labelled), _SAMPLES)
        indices = [labelled[place] for place in places]
        mirrored = [labelled[-1 - place] for place in places]
        mapper = BevMapper(self.drive.sensor, BevGrid())
        near = {index + step for index in indices for step in (-1, 0, 1)}
        used = near.union(mirrored).intersection(range(len(boxes)))
        scans = {index: one for index in used if (one := self._scan(index, mapper))}

        def samples(others: Iterable[int]) -> list[LabelledSample]:
            """Return the boxes of each frame with another scan, with their own where there is no such."""
            pairs = zip(indices, others, strict=True)
            kept = [(index, other) for index, other in pairs if index in scans]
            return [replace(scans.get(k, scans[index]), boxes=boxes[index]) for index, k in kept]

        reordered = {
            "they belong to the scan before": samples(index - 1 for index in indices),
            "they belong to the scan after": samples(index + 1 for index in indices),
            "their order is reversed": samples(mirrored),
        }
        return choose_reading(self.form, samples(indices), self.classes, reordered)

    def _scan(self, index: int, mapper: BevMapper) -> LabelledSample | None:
        """Return a scan; None of a damaged one, which is met where the frame is read."""
        try:
            points_velo = self.drive.scan(index).points_velo
        except PerceptionError:
            return None
        transform = self.drive.velo_SE3_file(index)
        return LabelledSample.of_scan(points_velo, mapper.ground(points_velo), transform)


def _outcome(make: Callable[[], Made]) -> Made | LabelError:
    """Return what a function makes, or its error: what takes long is found once, and raised at every frame."""
    try:
        return make()
    except LabelError as error:
        return error


def _known(outcome: Made | LabelError) -> Made:
    if isinstance(outcome, LabelError):
        raise outcome.with_traceback(None)
    return outcome


def _require_single(boxes: Sequence[LabelledBox]) -> None:
    """Validate that no object is twice in a frame."""
    seen: dict[str, str] = {}
    for box in boxes:
        if box.track and box.track in seen:
            found = f"{box.track} there and in {seen[box.track]}"
            advice = "remove one of them"
            raise LabelError(
                box.where, expected="each id once in a frame", found=found, advice=advice
            )
        seen[box.track] = box.where
