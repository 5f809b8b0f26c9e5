"""Which detectors a fusion was fitted to: another's scores mean something else."""

import logging
from collections.abc import Mapping
from typing import Protocol

from perception.detection.detectors.modality_detector import ModalityDetector
from perception.types import Modality

log = logging.getLogger(__name__)


class FittedModel(Protocol):
    """What a model file says of itself."""

    @property
    def name(self) -> str:
        """Of the file."""
        ...

    @property
    def metadata(self) -> Mapping[str, str]:
        """By name."""
        ...


def detector_fingerprints(detectors: Mapping[Modality, ModalityDetector]) -> str:
    """Return what a fusion's file says of the detectors that it is fitted to: rgb 0f3a..., dm ..."""
    return ", ".join(f"{name} {one.model.fingerprint}" for name, one in sorted(detectors.items()))


def warn_of_detector_mismatch(
    fusion: FittedModel, detectors: Mapping[Modality, ModalityDetector]
) -> None:
    """Say so, once, where detectors are not those that a fusion was fitted to.

    It is no error, since detectors are trained further; a file that does not say is taken as it is.
    """
    known = dict(
        word.split(" ", 1)
        for word in fusion.metadata.get("detectors", "").split(", ")
        if " " in word
    )
    others = [
        one.model.name
        for name, one in detectors.items()
        if known.get(name, one.model.fingerprint) != one.model.fingerprint
    ]
    if others:
        log.warning(
            "%s was fitted to other detectors than %s: its scores may be off; fit it anew with "
            "`trifuse train fusion`",
            fusion.name,
            " and ".join(others),
        )
