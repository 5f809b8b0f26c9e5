"""The pipeline that proposes labels, and the labels that follow from proposals."""

from dataclasses import replace
from pathlib import Path

from data.box_labels.forms import FORM_OF_NAME
from data.label_proposals.config import ProposedLabelConfig
from data.label_proposals.proposals import ProposalFile
from data.label_proposals.review import labelled_frames, read_review, reviewed
from data.recorded_drive import RecordedDrive
from perception.detection.networks import chosen_detection
from perception.pipeline import PipelineConfig
from perception.types import DetectorModality

LABELS = "boxes"  # folder of the labels


def proposal_pipeline(config: PipelineConfig, drive: RecordedDrive) -> PipelineConfig:
    """Return a configuration that detects from above beside the modalities of the sensor, unless modalities are named."""
    if config.detection.modalities is not None:
        return config
    modalities: tuple[DetectorModality, ...] = ("bev",)
    if drive.images is not None:
        chosen = chosen_detection(config.detection, drive.sensor, config.method)
        modalities = tuple(dict.fromkeys([*(chosen.modalities or ()), "bev"]))
    return replace(config, detection=replace(config.detection, modalities=modalities))


def write_labels(drive: RecordedDrive, out: Path, config: ProposedLabelConfig) -> str:
    """Write the labels of the proposals in a folder; return what was written in a sentence.

    Args:
        drive: Drive of the proposals.
        out: Folder with the proposals.
        config: Which of them become labels.

    Raises:
        LabelError: The proposals or the decisions cannot be read.
    """
    file = ProposalFile.read(out)
    decisions = {} if config.review is None else read_review(config.review, drive.name)
    labels = reviewed(file.proposals, decisions, config.min_confidence)
    for earlier in (out / LABELS).glob("*"):  # of another form
        if earlier.is_file():
            earlier.unlink()
    FORM_OF_NAME[config.form].write(out / LABELS, labelled_frames(drive, file, labels))
    boxes = sum(len(one.frames) for one in labels)
    return f"{len(labels)} of {len(file.proposals)} objects, {boxes} boxes in {len(file.poses)} frames: {out / LABELS}"
