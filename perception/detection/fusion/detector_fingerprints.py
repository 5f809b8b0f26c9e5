"""Detectors that a fusion was trained with: scores of other detectors mean something else."""

from collections.abc import Mapping
from typing import Protocol

from perception.detection.detectors.modality_detector import ModalityDetector
from perception.types import Modality


class FittedModel(Protocol):
    """A model with a name and metadata."""

    @property
    def name(self) -> str:
        """Name of the model file."""
        ...

    @property
    def metadata(self) -> Mapping[str, str]:
        """Metadata of the model file."""
        ...


def detector_fingerprints(detectors: Mapping[Modality, ModalityDetector]) -> str:
    """Return the fingerprints of detectors as in the metadata of a fusion: `rgb 0f3a..., dm ...`."""
    return ", ".join(f"{name} {one.model.fingerprint}" for name, one in sorted(detectors.items()))


def unfitted_detectors(
    fusion: FittedModel, detectors: Mapping[Modality, ModalityDetector]
) -> list[str]:
    """Return the names of the detectors that are not those that a fusion was trained with.

    It is no error, since detectors may have been trained further. A fusion without fingerprints fits to all.
    """
    known = dict(
        word.split(" ", 1)
        for word in fusion.metadata.get("detectors", "").split(", ")
        if " " in word
    )
    return [
        one.model.name
        for name, one in detectors.items()
        if known.get(name, one.model.fingerprint) != one.model.fingerprint
    ]
