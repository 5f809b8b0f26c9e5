"""What an adaptation gives: precision before and after, whether it is used, and the files of the report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from data.results.documents import describe_machine, write_json
from export.adapted_network import MeasuredClass
from perception.atomic_file import write_atomically
from perception.evaluation.report import Metric, Metrics, Table
from perception.render.bar_plots import plot_groups

KEPT, MEAN = "kept apart", "mean"
_MIN_LABELS = 50  # by which a precision is known to a few points


@dataclass(frozen=True)
class AdaptedPrecision(Metrics):
    """Precision of a class in a set of scans, in percent, before and after.

    Attributes:
        labels: Number of labels that count.
        ap_before: Average precision.
        ap_after: The same after.
        mean_before: Mean of average precisions at stricter and looser matches.
        mean_after: The same after.
    """

    labels: Annotated[int, Metric("labels")]
    ap_before: Annotated[float, Metric("AP before [%]", ".1f")]
    ap_after: Annotated[float, Metric("after", ".1f")]
    mean_before: Annotated[float, Metric("mean AP before [%]", ".1f")]
    mean_after: Annotated[float, Metric("after", ".1f")]

    @property
    def gain(self) -> Annotated[float, Metric("gain", "+.1f")]:
        """Mean average precision that was gained, in points."""
        return self.mean_after - self.mean_before

    @classmethod
    def of(cls, before: MeasuredClass, after: MeasuredClass) -> "AdaptedPrecision":
        """Return the precision of a class."""
        values = (100 * one for one in (before.ap, after.ap, before.mean_ap, after.mean_ap))
        # What is detected in no frame states no labels.
        return cls(max(before.labels, after.labels), *values)

    @classmethod
    def mean(cls, classes: Sequence["AdaptedPrecision"]) -> "AdaptedPrecision":
        """Return the mean over the labels of the classes that have enough, or of all."""
        used = [one for one in classes if one.labels >= _MIN_LABELS] or classes
        counts = [one.labels for one in used]
        names = ("ap_before", "ap_after", "mean_before", "mean_after")
        values = [[getattr(one, name) for one in used] for name in names]
        return cls(sum(counts), *np.average(values, axis=1, weights=counts).tolist())


SetPrecision = Mapping[str, Mapping[str, AdaptedPrecision]]
"""Precision by set of scans and class, the mean last."""


@dataclass(frozen=True)
class AdaptationReport:
    """What an adaptation gives.

    Attributes:
        title: What is measured, in words.
        sets: Precision of the sets.
        guards: Sets that may not lose.
        max_lost: Points that they may.
        share: Share of the way from the first weights to the trained ones.
    """

    title: str
    sets: SetPrecision
    guards: Sequence[str]
    max_lost: float
    share: float

    @property
    def is_better(self) -> bool:
        """Whether the adapted weights are to be used."""
        return not self.reasons

    @property
    def lost(self) -> dict[str, float]:
        """Points that a guard has lost, of those that have lost too much."""
        gains = {name: self.sets[name][MEAN].gain for name in self.guards}
        return {name: -gain for name, gain in gains.items() if gain < -self.max_lost}

    @property
    def reasons(self) -> list[str]:
        """Why they are not, in words."""
        kept = self.sets[KEPT][MEAN]
        found = [f"{KEPT} gains {kept.gain:+.1f}"] if kept.gain <= 0 else []
        if kept.labels < _MIN_LABELS:
            found.append(f"{KEPT} has {kept.labels} labels, {_MIN_LABELS} are needed")
        return found + [f"{name} loses {points:.1f}" for name, points in self.lost.items()]

    @property
    def table(self) -> Table[AdaptedPrecision]:
        """Table of all sets."""
        rows = {
            f"{name}, {of_class}": one
            for name, classes in self.sets.items()
            for of_class, one in classes.items()
        }
        return Table(self.title, AdaptedPrecision.columns(), rows, "scans, class")

    def write(self, out: Path, stated: Mapping[str, object]) -> str:
        """Write adapt.json, adapt.md and adapt.png into a folder; return the result in words.

        Args:
            out: Folder.
            stated: What the document states besides.
        """
        sets = {
            name: {kind: one.to_json() for kind, one in classes.items()}
            for name, classes in self.sets.items()
        }
        result = {"is_better": self.is_better, "reasons": self.reasons, "share": self.share}
        machine = {"machine": describe_machine()}
        write_json(
            out / "adapt.json",
            {**stated, **machine, "measured": self.title, **result, "sets": sets},
        )
        words = f"better, {self.share:.0%} of the way to the trained weights"
        if not self.is_better:
            words = f"not better, the weights stay as they are: {', '.join(self.reasons)}"
        text = (
            f"# Adaptation\n\n{words}\n\n```\n{self.table.text()}\n```\n\n![precision](adapt.png)\n"
        )
        write_atomically(out / "adapt.md", text.encode())
        means = [classes[MEAN] for classes in self.sets.values()]
        bars = {
            "before": np.array([one.mean_before for one in means]),
            "after": np.array([one.mean_after for one in means]),
        }
        names = [name.replace(" ", "\n") for name in self.sets]
        plot_groups(out / "adapt.png", "before and after", names, {"mean AP [%]": bars})
        return words
