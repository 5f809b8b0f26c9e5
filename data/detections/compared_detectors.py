"""Detectors by their names, one or several, whose frames are read once."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from data.detections.measured_detectors import (
    Detect,
    DetectorOptions,
    MeasuredDetector,
    open_detector,
)
from perception.errors import UsageError
from perception.evaluation.detection.detector_comparison import DetectorComparisonMeasure
from perception.types import Drive, Frame


def open_compared(names: Sequence[str], options: DetectorOptions) -> MeasuredDetector:
    """Open a detector, or several that are set beside each other.

    Args:
        names: Names or files of the detectors.
        options: Options of each of them.

    Raises:
        ModelError: a file holds no such network.
        UsageError: there is no such detector, none is named or one twice, or a network does not know a class.
    """
    if not names or len(set(names)) < len(names):
        expected = "one or several detectors, each once"
        raise UsageError("--detector", expected=expected, found=", ".join(names) or "none")
    opened = [open_detector(name, options) for name in names]
    return opened[0] if len(opened) == 1 else _beside(dict(zip(_short(names), opened, strict=True)))


def _beside(detectors: Mapping[str, MeasuredDetector]) -> MeasuredDetector:
    """Return several detectors as one, whose images of errors are those of the first."""
    first = next(iter(detectors.values()))

    def start(drive: Drive) -> tuple[Detect, DetectorComparisonMeasure]:
        started = {name: one.start(drive) for name, one in detectors.items()}

        def detect(frame: Frame) -> dict[str, Any]:
            return {name: detect_one(frame) for name, (detect_one, _) in started.items()}

        return detect, DetectorComparisonMeasure({name: one for name, (_, one) in started.items()})

    metadata = {
        key if key.split()[0] == name else f"{name} {key}": entries
        for name, one in detectors.items()
        for key, entries in one.metadata.items()
    }
    title = "\n".join(f"{name}: {one.title}" for name, one in detectors.items())
    return MeasuredDetector(title, metadata, first.classes, start, first.image)


def _short(names: Sequence[str]) -> Sequence[str]:
    """Return the names of files in place of their paths, where these differ."""
    short = [Path(name).name for name in names]
    return short if len(set(short)) == len(names) else names
