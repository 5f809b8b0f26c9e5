"""Results of any program, told apart by what stands in them: KITTI's and MOTChallenge's rows, COCO's and nuScenes' JSON."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from data.kitti.mot_rows import are_mot_rows
from data.kitti.reading import first_row, read_text
from perception.errors import LabelError, UsageError
from perception.json_text import read_json_text

ResultKind = Literal["detections", "tracks"]
ResultForm = Literal["KITTI", "COCO", "nuScenes"]
_EXPECTED = "a list of COCO's detections, or nuScenes' object with meta and results"
_MAX_NAMED = 5  # keys of another document that its error names


@dataclass(frozen=True)
class ResultFiles:
    """Results of a program.

    Attributes:
        path: Folder of texts, or JSON file.
        kind: Detections, or tracks.
        form: Format; KITTI where it is a folder, of which each text may have MOTChallenge's columns.
        document: Contents of a JSON file.
    """

    path: Path
    kind: ResultKind
    form: ResultForm = "KITTI"
    document: Any = None


def find_results(path: Path, kind: ResultKind | None = None) -> ResultFiles:
    """Tell what a path holds; the files of a folder are not read, but for a first row.

    Args:
        path: Folder of texts, or JSON file.
        kind: Kind of the results, where it is known.

    Raises:
        LabelError: A file is no JSON, or another document.
        UsageError: The results are of another kind.
    """
    if not path.is_file():
        folder = path / "data" if (path / "data").is_dir() else path
        return ResultFiles(folder, kind or _kind_of_texts(folder))
    document = read_json(path)
    if isinstance(document, list):
        found = ResultFiles(path, "detections", "COCO", document)
    elif isinstance(document, dict) and isinstance(document.get("results"), dict):
        stated = _kind_of_samples(document["results"])
        found = ResultFiles(path, stated or kind or "detections", "nuScenes", document)
    else:
        is_object = isinstance(document, dict)
        keys = ", ".join(list(document)[:_MAX_NAMED]) if is_object else type(document).__name__
        raise LabelError(
            path, expected=_EXPECTED, found=f"an object with {keys}" if is_object else keys
        )
    if kind is not None and found.kind != kind:
        raise UsageError(f"--kind {kind}", expected=f"{found.kind}, as {path} holds", found=kind)
    return found


def read_json(path: Path) -> Any:  # noqa: ANN401 - any document
    """Read a JSON document.

    Raises:
        LabelError: The file cannot be read, or is no JSON.
    """
    text = read_text(path, LabelError, _EXPECTED)
    try:
        return read_json_text(text)
    except ValueError as error:
        advice = "name the folder of results that are texts"
        found = f"no JSON ({error})"
        raise LabelError(path, expected=_EXPECTED, found=found, advice=advice) from error


def _kind_of_texts(folder: Path) -> ResultKind:
    """Tell by the first row: tracks begin with a frame, detections with a class. Without any row, the names tell."""
    texts = sorted(folder.glob("*.txt"))
    row = next(filter(None, map(first_row, texts)), "")
    if row:
        is_frame = row.split()[0].lstrip("-").replace(".", "").isdecimal()
        return "tracks" if is_frame or are_mot_rows(row) else "detections"
    return "tracks" if texts and len(texts[0].stem) != len("000000") else "detections"


def _kind_of_samples(samples: Mapping[str, Any]) -> ResultKind | None:
    """Tell by the first box of nuScenes' results; None without any."""
    boxes = (one for found in samples.values() if isinstance(found, list) for one in found)
    first: Any = next(boxes, {})
    if isinstance(first, dict) and "tracking_id" in first:
        return "tracks"
    return "detections" if isinstance(first, dict) and "detection_name" in first else None
