"""Proposed labels of the frames of a drive, to learn from: what is unsure is neither an object nor background."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from data.array_store import entry_key
from data.label_proposals.config import ProposedLabelConfig
from data.label_proposals.proposals import FILE_NAME, ProposalFile
from data.label_proposals.review import FILE_NAME as REVIEW
from data.label_proposals.review import Decision, labels_by_frame, read_review, reviewed
from perception.errors import LabelError
from perception.types import Labels

UNSURE = "DontCare"  # type of objects that are ignored


class ProposedLabels:
    """Labels of all around by the proposals of `trifuse label`, and by the decisions of a person where there are some."""

    def __init__(
        self, folder: Path, min_confidence: float = ProposedLabelConfig.min_confidence
    ) -> None:
        """Read a folder of `trifuse label`, and review.json in it.

        Args:
            folder: Folder.
            min_confidence: Confidence from which a box is a label without a decision.

        Raises:
            LabelError: The proposals or the decisions cannot be read, or do not name their frames.
        """
        path, review = folder / FILE_NAME, folder / REVIEW
        file = ProposalFile.read(folder)
        if len(file.names) < len(file.poses):
            advice = "make them again with: trifuse label"
            raise LabelError(path, expected="names of frames", found="none", advice=advice)
        decisions = read_review(review) if review.exists() else {}
        labels = reviewed(file.proposals, decisions, min_confidence)
        labelled = {one.number: one.frames for one in labels}
        unsure = [
            replace(one.select(~np.isin(one.frames, labelled.get(one.number, ()))), kind=UNSURE)
            for one in file.proposals
            if decisions.get(one.number, Decision()).decision != "reject"
        ]
        found = labels_by_frame(file, [*labels, *unsure])
        self._labels = {file.names[frame]: of_frame for frame, of_frame in found.items()}
        files = (path, *([review] if review.exists() else []))
        texts = [one.read_text() for one in files]
        self.fingerprint = entry_key(texts=texts, min_confidence=min_confidence)
        """Hash of the files and the confidence."""

    def at(self, frame_name: str) -> Labels | None:
        """Return the labels of a frame, None of one that was not read."""
        return self._labels.get(frame_name)


def read_proposals(folders: Mapping[str, Path] | None) -> Mapping[str, ProposedLabels]:
    """Return the proposals of folders of `trifuse label` by the name of a drive; raise as `ProposedLabels`."""
    return {name: ProposedLabels(folder) for name, folder in (folders or {}).items()}
