"""Evaluation of one drive, or of every sequence of a set that a folder holds."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from data.derived.obstacle_sequences import SequenceSet, find_sequences
from data.results.evaluated import EvaluatedDrive, EvaluatedSet
from perception.cli.evaluation import open_labelled_drive
from perception.cli.flags import LabelledDriveFlags
from perception.evaluation.report import Report
from perception.types import Drive

OneReport = TypeVar("OneReport", bound=Report)


def evaluate_drives(
    root: Path,
    set: SequenceSet | None,
    flags: LabelledDriveFlags,
    evaluate: Callable[[Drive], tuple[EvaluatedDrive, OneReport]],
    combine: Callable[[Mapping[str, OneReport]], Report],
) -> tuple[EvaluatedDrive | EvaluatedSet, Report]:
    """Evaluate one drive, or every sequence of a set that a folder holds.

    Args:
        root: Folder of a drive, or of tracking sequences.
        set: Name of the set, or None for one drive.
        flags: Sensor, and the only sequence, where one is named.
        evaluate: Function that returns the frames and the metrics of a drive.
        combine: Function that returns the metrics of a set, of those of its sequences by name.

    Returns:
        Evaluated frames, and the metrics.

    Raises:
        DriveError: The folder holds no sequence of the set.
        PerceptionError: A frame cannot be read or used.
    """
    if set is None:
        return evaluate(open_labelled_drive(root, flags))
    present, absent = find_sequences(root, set, flags.sequence)
    # All are opened before the first is evaluated, which takes minutes.
    opened = {
        one.name: open_labelled_drive(root, replace(flags, sequence=one.sequence))
        for one in present
    }
    evaluated = {name: evaluate(drive) for name, drive in opened.items()}
    drives = {name: data for name, (data, _) in evaluated.items()}
    reports = {name: report for name, (_, report) in evaluated.items()}
    names = [one.name for one in absent]
    return EvaluatedSet(root.resolve(), set, drives, names), combine(reports)
